"""Targets found by trying: against the targets that are only led, on a stride that is authored here and on a
recorded walk."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.clips.read import read_clip
from warpdribble.learning.evaluate import refine
from warpdribble.learning.evaluate.attempts import follow, starts
from warpdribble.learning.evaluate.record import record
from warpdribble.learning.evaluate.refine import TRIES
from warpdribble.learning.evaluate.tracking import track
from warpdribble.learning.graph import clip_graph
from warpdribble.learning.tasks.follow import Follow, OpenLoop
from warpdribble.sims import Model
from warpdribble.sims.reference import Reference
from warpdribble.sims.retarget.retarget import retarget


@pytest.fixture(scope="module")
def strides(player):
    """Legs that swing and bend in the air at 1 Hz, hips by 30 degrees."""
    t = np.arange(0.0, 2.0, player.timestep)
    joint_q = np.tile(player.start_q, (len(t), 1)).astype(float)
    joint_q[:, 2] += 0.3
    for sign, side in ((1.0, "l"), (-1.0, "r")):
        angle = sign * np.radians(30.0) * np.sin(2.0 * np.pi * t)
        hip = player.q_slice(f"{side}_hip")
        joint_q[:, hip] = np.stack([0 * t, np.sin(angle / 2), 0 * t, np.cos(angle / 2)], axis=1)
        joint_q[:, player.q_slice(f"{side}_knee")] = np.abs(angle)[:, None]
    return Reference(joint_q, player.timestep)


def followed(player, reference, task):
    graph = task.graph
    seen = record(task, OpenLoop(), starts(player, reference, 1, ball=False), graph.count, worlds=[0])[0]
    return track(player, seen.first(reference.frame_count))


def test_feet_are_where_the_reference_has_them(player, strides):
    """Led alone they are 6 times as far off; there is nothing to slide on."""
    found = followed(player, strides, follow(player, strides, 1, "tracked"))
    graph = clip_graph(player, strides, (), 0.1)
    led = Follow(player, graph, 1)
    led.sim.set_root_drive(300e3, 30e3, 60e3, 6e3)
    before = followed(player, strides, led)
    assert max(limb.far for limb in found.limbs) < 0.01
    assert max(limb.far for limb in before.limbs) > 0.03
    assert all(np.isnan(limb.sliding) for limb in found.limbs)
    assert found.falls == 0
    # the root's drive, 300 kN/m, would give 2.5 mm under the weight that it carries
    assert np.abs(found.root - found.wanted_root).max() < 1e-3


def test_a_recorded_walker_does_not_slide(player, mocap):
    """Two steps; where the root gives by millimetres feet slide by 20 to 30 cm/s as they land and leave."""
    full = Model.load("player")
    walk = retarget(full, read_clip(mocap / "cmu" / "06_01.bvh")[0].slice(0, 190))
    reference = replace(walk, joint_q=player.convert_q(full, walk.joint_q))
    found = followed(player, reference, follow(player, reference, 1, "tracked"))
    feet = [limb for limb in found.limbs if limb.name in player.roles.feet]
    assert len(feet) == 2 and found.falls == 0
    assert max(limb.sliding for limb in feet) < 0.06
    assert max(limb.far for limb in feet) < 0.01


def test_the_best_try_is_the_one_whose_places_are_right(monkeypatch):
    """Not the one whose angles are: fingers have half of them."""
    player = Model.load("player", without=("ball",))
    still = Reference(np.tile(player.start_q, (41, 1)), player.timestep)
    graph = clip_graph(player, still, ())
    rows = np.tile(player.start_q, (len(graph.targets), 1)).astype(float)
    leg, fingers = rows.copy(), rows.copy()
    leg[:, player.q_slice("r_knee")] += 0.1
    for name in player.joint_names:
        if player.joint_type(name) == "hinge" and ("_pip" in name or "_dip" in name):
            fingers[:, player.q_slice(name)] += 0.4
    apart = [np.mean((tried - rows) ** 2) for tried in (leg, fingers)]
    assert apart[0] < apart[1]
    tries = iter([leg, fingers])
    monkeypatch.setattr(refine, "TRIES", 2)
    monkeypatch.setattr(refine, "_follow", lambda task, starts: next(tries))
    begin = starts(player, still, 1, ball=False)
    best = refine.refine(player, still, graph, lambda graph: graph, begin, 0.1)
    assert best is not graph


def test_progress_is_said_and_the_first_try_is_kept_where_it_is_best(player):
    """A player held still in the air: there is little to learn, and nothing gets worse."""
    still = Reference(np.tile(player.start_q, (41, 1)) + 0.5 * (np.arange(player.nq) == 2), player.timestep)
    said = []
    task = follow(player, still, 1, "tracked", progress=said.append)
    assert said == list(range(1, TRIES + 1))
    assert followed(player, still, task).position_error.mean() < 2e-3
