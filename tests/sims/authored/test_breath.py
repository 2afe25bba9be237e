"""The body goes along with a dribble as recorded ones do: read off poses alone, not off the numbers that made
them."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import find_peaks, savgol_filter
from scipy.spatial.transform import Rotation

from warpdribble.clips import read_clip
from warpdribble.sims import Model, authored_clip, retargeted
from warpdribble.sims.model import pose
from warpdribble.sims.planar import heading


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def measured(player, joint_q):
    """Name -> (frames,) of what goes along [cm, degrees]."""
    body_q = pose.forward(player, joint_q)
    at = {name: body_q[:, player.body(name)] for name in ("pelvis", "torso", "l_lower_arm", "l_upper_arm")}
    level = Rotation.from_rotvec(np.outer(heading(at["pelvis"][:, 3:]), [0, 0, 1])).inv()
    torso = level * Rotation.from_quat(at["torso"][:, 3:])
    ahead, up = torso.apply([1, 0, 0]), torso.apply([0, 0, 1])
    arm = level.apply(at["l_lower_arm"][:, :3] - at["l_upper_arm"][:, :3])
    knees = [joint_q[:, player.q_slice(f"{side}_knee")][:, 0] for side in "lr"]
    return {
        "height": 100 * at["pelvis"][:, 2],
        "bend": np.degrees(np.arctan2(up[:, 0], up[:, 2])),
        "yaw": np.degrees(np.arctan2(ahead[:, 1], ahead[:, 0])),
        "knees": np.degrees(np.mean(knees, axis=0)),
        "free arm": np.degrees(np.arctan2(arm[:, 0], -arm[:, 2])),
        "free elbow": np.degrees(joint_q[:, player.q_slice("l_elbow")][:, 0]),
    }


def harmonic(values, starts):
    """Half of the way, and the top in cycles from `starts`, of the first harmonic of a mean cycle, its drift
    taken out."""
    turns = np.linspace(0.0, 1.0, 41)
    cycles = [np.interp(a + turns * (b - a), np.arange(len(values)), values) for a, b in pairwise(starts)]
    mean = np.mean(cycles, axis=0)
    mean = mean - turns * (mean[-1] - mean[0])
    wave = 2.0 * np.mean(mean[:-1] * np.exp(-2j * np.pi * turns[:-1]))
    return abs(wave), -np.angle(wave) / (2.0 * np.pi) % 1.0


def releases(player, joint_q, hand):
    """Rows in which the ball leaves a hand: about 50 ms after the hand falls fastest."""
    height = pose.forward(player, joint_q, [player.body(hand)])[:, player.body(hand), 2]
    speed = savgol_filter(height, 15, 3, deriv=1, delta=player.timestep)
    return find_peaks(-speed, height=0.7, distance=30)[0] + 5


def apart(a, b):
    return abs((a - b + 0.5) % 1.0 - 0.5)


@pytest.fixture(scope="module")
def authored(player):
    joint_q = authored_clip(player, "dribble_right").reference.joint_q
    starts = [0, len(joint_q) - 1]
    return {name: harmonic(values, starts) for name, values in measured(player, joint_q).items()}


def test_the_body_sinks_as_the_ball_leaves_and_rises_to_meet_it(authored):
    half, top = authored["height"]
    assert 1.5 < half < 4.0 and 0.5 < top < 0.7
    half, top = authored["knees"]
    assert 4.0 < half < 9.0 and apart(top, authored["height"][1] + 0.5) < 0.05


@pytest.mark.parametrize(("clip", "hand"), [("06_10", "r_hand"), ("06_12", "r_hand")])
def test_shoulders_turn_and_the_free_arm_swings_as_in_a_recording(player, mocap, authored, clip, hand):
    motion = read_clip(mocap / "cmu" / f"{clip}.bvh")[0]
    joint_q = retargeted(player, motion).reference.joint_q
    rows = {"06_10": (325, 775), "06_12": (333, 867)}[clip]
    starts = [row for row in releases(player, joint_q, hand) if rows[0] <= row <= rows[1]]
    assert len(starts) > 4
    recorded = {name: harmonic(values, starts) for name, values in measured(player, joint_q).items()}
    for name in ("yaw", "free arm", "free elbow"):
        assert authored[name][0] == pytest.approx(recorded[name][0], rel=0.5), name
        assert apart(authored[name][1], recorded[name][1]) < 0.15, name
    assert authored["height"][0] > recorded["height"][0]  # it is livelier than these


@pytest.mark.parametrize("clip", ["044_006pickle_lleg_2", "041_018pickle_pick2back_7"])
def test_pelvis_and_knees_go_with_the_push_as_in_a_recording(player, mocap, authored, clip):
    """Low and lively ones, from hand to hand: twice as far, at the same time."""
    joint_q = retargeted(player, read_clip(mocap / "ballplay_m" / f"{clip}.pt")[0]).reference.joint_q
    rows = np.concatenate([releases(player, joint_q, hand) for hand in ("l_hand", "r_hand")])
    starts = {"044_006pickle_lleg_2": (64, 128, 202, 270), "041_018pickle_pick2back_7": (219, 290, 362)}[clip]
    assert all(np.abs(rows - row).min() <= 8 for row in starts)
    recorded = {name: harmonic(values, starts) for name, values in measured(player, joint_q).items()}
    for name in ("height", "knees", "bend"):
        assert 0.4 < authored[name][0] / recorded[name][0] <= 1.3, name
        assert apart(authored[name][1], recorded[name][1]) < 0.2, name
