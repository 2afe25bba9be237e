"""What the hands' report changes in the player, and what it measures, against numbers by hand."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from warpdribble.assets.player import BALL_MASS
from warpdribble.reports.hands import PRESENT, Setting, edited, held_rows, said, settings, table, wander
from warpdribble.reports.motion import shake
from warpdribble.sims import Model
from warpdribble.sims.trajectory import Trajectory


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def pair(model, *names):
    """The contact of two shapes."""
    (found,) = [p for p in model.pairs if {model.shapes[k].name for k in p["shapes"]} == set(names)]
    return found


def test_what_the_file_has_stays(player):
    same = edited(PRESENT)
    assert same.pairs == player.pairs
    for name, values in player.tables.items():
        np.testing.assert_array_equal(same.tables[name], values, err_msg=name)


def test_gains_are_those_of_wrists_or_fingers_alone(player):
    kp, kd = (edited(Setting(wrist=2.0, fingers=0.5)).tables[name] for name in ("dof_kp", "dof_kd"))
    factor = np.ones(player.nv)
    for joint in player.joints:
        if joint.name.endswith("wrist"):
            factor[joint.dof] = 2.0
        elif joint.name.endswith(("mcp", "pip", "dip")):
            factor[joint.dof] = 0.5
    np.testing.assert_allclose(kp, factor * player.tables["dof_kp"])
    np.testing.assert_allclose(kd, factor * player.tables["dof_kd"])


@pytest.mark.parametrize("friction", [0.4, 1.2])
def test_hand_and_ball_touch_otherwise_and_the_ground_does_not(player, friction):
    model = edited(Setting(friction=friction, restitution=0.2))
    for shape in ("r_hand", "l_index_3"):
        assert pair(model, shape, "ball")["friction"] == pytest.approx(friction)
        assert pair(model, shape, "ball")["restitution"] == pytest.approx(0.2)
    for shape in ("ground", "r_lower_arm_b"):
        assert pair(model, shape, "ball") == pair(player, shape, "ball")


def test_a_soft_hand_is_a_spring_and_a_critical_damper():
    """Of a step h: cfm = 1 / (h k + d), erp = h k cfm (ODE user guide 3.8)."""
    model, k = edited(Setting(spring=20e3)), 20e3
    touch, h = pair(model, "r_hand", "ball"), model.timestep
    load = 1.0 / touch["cfm"]
    assert load * touch["erp"] / h == pytest.approx(k)
    assert load * (1.0 - touch["erp"]) == pytest.approx(2.0 * np.sqrt(k * BALL_MASS))


def test_forearms_are_thinner_and_a_heel_is_the_hands(player):
    model = edited(Setting(forearm=0.02, heel=0.024))
    sizes = {s.name: s.size[0] for s in model.shapes if s.kind == "capsule"}
    assert {sizes[f"{side}_lower_arm_b"] for side in "lr"} == {0.02}
    (heel,) = [s for s in model.shapes if s.name == "r_heel"]
    assert model.body_names[heel.body] == "r_hand" and heel.size[0] == 0.024
    np.testing.assert_array_equal(model.body_mass, player.body_mass)


def test_each_value_is_tried_alone():
    for setting in [s for s in settings() if s != PRESENT]:
        assert sum(a != b for a, b in zip(asdict(setting).values(), asdict(PRESENT).values())) == 1


def test_a_ball_that_circles_on_a_palm_wanders_by_the_circles_radius(player):
    """Over whole turns, wherever the hand goes, and however high it lies."""
    turn = np.linspace(0.0, 4.0 * np.pi, 41)[:-1]
    body_q = np.zeros((40, len(player.body_names), 7))
    body_q[..., 6] = 1.0
    hand, at, _ = player.sites["r_palm"]
    body_q[:, hand, 0] = np.linspace(0.0, 1.0, 40)
    circle = 0.02 * np.stack([np.cos(turn), np.sin(turn)], axis=1)  # the palm looks down
    ball = player.body(player.roles.one("ball"))
    body_q[:, ball, :3] = body_q[:, hand, :3] + at
    body_q[:, ball, :2] += circle
    body_q[:, ball, 2] -= 0.12 + 0.05 * turn
    seen = Trajectory(np.zeros((40, player.nq)), body_q, 0.01, np.zeros((40, player.nq)))
    held = np.zeros((40, 2), bool)
    held[:, 1] = True
    assert wander(player, seen, held) == pytest.approx(0.02, rel=1e-6)


def test_rows_of_a_hold_follow_the_fragments():
    touch = np.zeros((15, 2), bool)
    touch[5:10, 1] = True
    rows = held_rows(touch, np.array([1, 2, 0, 1]))
    assert rows.shape == (21, 2) and not rows[:, 0].any()
    np.testing.assert_array_equal(np.flatnonzero(rows[:, 1]), [0, 1, 2, 3, 4, 5, 16, 17, 18, 19, 20])


def test_shaking_is_acceleration_between_5_and_30_hz():
    """A speed sin(w t) at 100 Hz has the acceleration w cos(w t), which central differences see as
    sin(w h) / h."""
    t = 0.01 * np.arange(400)
    fast, slow = (shake(np.sin(2.0 * np.pi * f * t)[None], 100.0) for f in (12.0, 1.0))
    assert fast == pytest.approx(np.sin(2.0 * np.pi * 12.0 * 0.01) / 0.01 / np.sqrt(2.0), rel=0.03)
    assert slow < 0.05 * 2.0 * np.pi / np.sqrt(2.0)


def test_a_line_has_the_starts_of_a_setting():
    soft = asdict(replace(PRESENT, spring=20e3))
    rows = [
        {"skill": "b", "setting": s, "cycles": 2, "fingers": f, "wander": 1.0, "offsets": 0.2, "twitch": 40.0}
        | {"reference": 9.0, "rounds": 12.0}
        for s, f in ((asdict(PRESENT), 0.5), (soft, 1.0), (soft, np.nan), (soft, 3.0))
    ]
    _, _, first, second = table(rows).splitlines()
    assert first.startswith("| b | nothing | 2 of 2 | 0.50 (0.50 - 0.50) |")
    assert second.startswith("| b | spring [kN/m] 20 | 6 of 6 | 2.00 (1.00 - 3.00) |")
    assert said("spring", np.inf) == "stiff" and said("forearm", 0.027) == "27"
