from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.clips.read import read_clip
from warpdribble.sims.recording.motion import Motion
from warpdribble.sims.recording.quality import examine
from warpdribble.sims.recording.repair import REPAIRS, repair

RATE = 120.0
NAMES, PARENTS = ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase"), np.array([-1, 0, 1, 2, 3])


def walking(frames=240, height=0.88):
    """A leg that swings."""
    times = np.arange(frames) / RATE
    turns = np.zeros((frames, 5, 3))
    turns[:, 1, 1] = 0.3 * np.sin(2 * np.pi * times)
    turns[:, 2, 1] = 0.3 - 0.3 * np.cos(2 * np.pi * times)
    rotations = Rotation.from_rotvec(turns.reshape(-1, 3)).as_quat().reshape(frames, 5, 4)
    offsets = np.array([[0, 0, 0], [0, 0.1, 0], [0, 0, -0.4], [0, 0, -0.4], [0.12, 0, -0.08]])
    root = np.stack([0 * times, 0 * times, 0 * times + height], axis=1)
    return Motion(NAMES, PARENTS, offsets, rotations, root, RATE, np.tile([0.0, 0, 0, 1], (5, 1)))


def angles(a, b):
    apart = Rotation.from_quat(a.reshape(-1, 4)).inv() * Rotation.from_quat(b.reshape(-1, 4))
    return apart.magnitude().reshape(a.shape[:-1])


def test_a_spike_is_bridged_and_nothing_else_is_touched():
    good = walking()
    rotations, root = good.rotations.copy(), good.root_position.copy()
    rotations[100:102, 3] = Rotation.from_rotvec([[0.4, 0, 0], [0.5, 0.1, 0]]).as_quat()
    root[50] += [0.0, 0.1, 0.0]
    repaired, notes = repair(replace(good, rotations=rotations, root_position=root), ["spikes"])
    assert angles(repaired.rotations, good.rotations).max() < 1e-6
    assert np.allclose(repaired.root_position, good.root_position)
    assert notes == ["repair spikes: frames bridged: LeftFoot 2, place of the root 1"]
    assert repair(good, ["spikes"])[1] == ["repair spikes: none found"]


def test_a_step_is_no_spike():
    motion = walking()
    root = motion.root_position.copy()
    root[100:] += [0.5, 0.0, 0.0]
    repaired, _ = repair(replace(motion, root_position=root), ["spikes"])
    assert np.array_equal(repaired.root_position, root)


def test_toe_noise_goes_and_the_rest_stays():
    good = walking()
    noise = Rotation.from_rotvec(np.random.default_rng(0).normal(scale=0.1, size=(240, 3)))
    rotations = good.rotations.copy()
    rotations[:, 4] = noise.as_quat()
    repaired, notes = repair(replace(good, rotations=rotations), ["toes"])
    assert np.array_equal(repaired.rotations[:, :4], good.rotations[:, :4])
    assert angles(repaired.rotations[:, 4], good.rotations[:, 4]).mean() < 0.35 * noise.magnitude().mean()
    assert "degrees" in notes[0]


def test_feet_are_put_on_the_ground():
    motion = walking(height=0.95)
    repaired, notes = repair(motion, ["ground"])
    assert examine(repaired).ground == pytest.approx(0.02, abs=1e-6)
    assert notes[0].startswith("repair ground: moved by -")
    with_ball = replace(motion, ball=motion.root_position)
    assert repair(with_ball, ["ground"])[0] is with_ball


def test_a_low_pass_keeps_what_is_slow_and_takes_what_is_fast():
    good = walking()
    kept, _ = repair(good, ["lowpass"])
    inner = slice(20, -20)
    assert angles(kept.rotations, good.rotations)[inner].max() < np.radians(0.1)
    noise = Rotation.from_rotvec(np.random.default_rng(1).normal(scale=0.05, size=(240 * 5, 3)))
    noisy = (Rotation.from_quat(good.rotations.reshape(-1, 4)) * noise).as_quat().reshape(240, 5, 4)
    repaired, _ = repair(replace(good, rotations=noisy), ["lowpass"])
    off = angles(repaired.rotations, good.rotations)[inner].mean()
    assert off < 0.5 * noise.magnitude().mean()


def test_recorded_positions_are_repaired_and_a_ball_is_not(mocap):
    motion, _ = read_clip(mocap / "ballplay_m" / "044_006pickle_lleg_2.pt")
    positions = motion.positions.copy()
    positions[60, motion.index("L_Ankle")] += [0.0, 0.0, 0.3]
    repaired, notes = repair(replace(motion, positions=positions), ["spikes"])
    assert "place of L_Ankle 1" in notes[0]
    assert np.allclose(repaired.positions[60], motion.positions[60], atol=0.02)
    assert np.array_equal(repair(motion, REPAIRS)[0].ball, motion.ball)


@pytest.mark.parametrize("clip", ["06_02", "06_03", "09_12"])
def test_repaired_recordings_have_no_jumps_left(mocap, clip):
    motion, _ = read_clip(mocap / "cmu" / f"{clip}.bvh")
    repaired, notes = repair(motion, REPAIRS)
    assert len(notes) == 4
    assert len(examine(motion).jumps) > 10
    assert len(examine(repaired).jumps) == 0
    assert examine(repaired).ground == pytest.approx(0.02, abs=0.005)


@pytest.mark.parametrize("frames", [1, 2, 5, 9])
def test_short_motions_pass(frames):
    repaired, notes = repair(walking(frames), REPAIRS)
    assert repaired.frame_count == frames and len(notes) == 4


def test_an_unknown_repair_is_refused():
    with pytest.raises(ValueError, match="no repair 'shoes': there are spikes, "):
        repair(walking(), ["shoes"])
