"""The benchmarks run and count what they say they count; how fast is not tested."""

import json

import numpy as np
import pytest

from warpdribble.benchmarks import command, scene


def test_scene_has_the_ball_in_hand_and_both_feet_down():
    s = scene.hold(worlds=3, fragments=2)
    assert s.targets.shape == (2, 3, s.model.nq)
    assert not np.array_equal(s.targets[0], s.targets[1])
    side = command.Ours(s, 3, "cpu", 1, None)
    for _ in range(10):
        side.advance()
    contacts = side.sim.contacts()
    touching = {b for k, (a, b) in enumerate(contacts.shapes) if contacts.impulse[0, k, 0] > 0}
    assert "ball" in touching
    assert {"l_foot", "r_foot"} <= touching


def test_both_sides_start_alike():
    """The peer's state is the scene's, and it is driven by the first world's targets."""
    s = scene.hold(worlds=1, fragments=1)
    peer = command.MuJoCo(s, "default (Newton)")
    ours = command.Ours(s, 1, "cpu", 1, None)
    for _ in range(2):
        peer.advance()
        ours.advance()
    there = scene.mujoco_q(s.model, ours.sim.joint_q[0].astype(float))
    # 0.1 s in; MuJoCo's contacts give way by millimetres
    assert np.abs(there[:3] - peer.data.qpos[:3]).max() < 4e-3


def test_json(capsys, tmp_path):
    out = tmp_path / "results.jsonl"
    arguments = ["step", "--worlds", "16", "--rounds", "3", "--format", "json", "--out", str(out)]
    assert command.main(arguments) == 0
    result = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert json.loads(out.read_text()) == result
    assert result["rows"][0]["worlds"] == 16
    assert result["rows"][0]["steps_per_second"] > 0
    assert set(result["peers"]) == set(command.SETTINGS)
    assert result["kib_per_world"] <= 48


@pytest.mark.slow
def test_solve_gets_closer_with_more_sweeps(capsys):
    assert command.main(["solve", "--sweeps", "2", "20", "--worlds", "32", "--format", "json"]) == 0
    few, many = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert many["residual_median"] < 0.2 * few["residual_median"]
