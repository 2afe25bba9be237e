from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from warpdribble.sims.recording.motion import Motion

NAMES, PARENTS = ("hips", "spine", "arm", "leg"), np.array([-1, 0, 1, 0])


def wave(frames=25, rate=50.0, seed=0):
    """A smooth motion of four joints."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames) / rate
    turns = rng.normal(size=(4, 3))[None] * np.sin(4.0 * times)[:, None, None]
    return Motion(
        joint_names=NAMES,
        parents=PARENTS,
        offsets=rng.normal(size=(4, 3)),
        rotations=Rotation.from_rotvec(turns.reshape(-1, 3)).as_quat().reshape(frames, 4, 4),
        root_position=np.stack([times, np.cos(times), 0.1 * times], axis=1),
        rate=rate,
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (4, 1)),
    )


def test_forward_kinematics_equal_chained_matrices():
    motion = wave()
    positions, rotations = motion.forward()
    for frame in (0, 7, 24):
        world = [None] * 4
        for joint, parent in enumerate(PARENTS):
            local = np.eye(4)
            local[:3, :3] = Rotation.from_quat(motion.rotations[frame, joint]).as_matrix()
            local[:3, 3] = motion.root_position[frame] if parent < 0 else motion.offsets[joint]
            world[joint] = local if parent < 0 else world[parent] @ local
            assert np.allclose(positions[frame, joint], world[joint][:3, 3], atol=1e-12)
            turn = Rotation.from_quat(rotations[frame, joint]).as_matrix()
            assert np.allclose(turn, world[joint][:3, :3], atol=1e-12)


def test_resampling_to_the_same_rate_changes_nothing():
    motion = wave()
    same = motion.resample(motion.rate)
    assert np.allclose(same.root_position, motion.root_position)
    apart = Rotation.from_quat(same.rotations.reshape(-1, 4)).inv() * Rotation.from_quat(
        motion.rotations.reshape(-1, 4)
    )
    assert apart.magnitude().max() < 1e-7


@settings(max_examples=25, deadline=None)
@given(rate=st.floats(5.0, 400.0), seed=st.integers(0, 1000))
def test_resampling_keeps_ends_duration_and_unit_length(rate, seed):
    motion = wave(seed=seed)
    new = motion.resample(rate)
    assert np.allclose(np.linalg.norm(new.rotations, axis=-1), 1.0, atol=1e-12)
    assert new.duration == pytest.approx(motion.duration)
    assert abs(motion.duration * rate - (new.frame_count - 1)) <= 0.5 + 1e-9
    for frame in (0, -1):
        assert np.allclose(new.root_position[frame], motion.root_position[frame])
        apart = Rotation.from_quat(new.rotations[frame]).inv() * Rotation.from_quat(motion.rotations[frame])
        assert apart.magnitude().max() < 1e-7


def test_resampling_up_and_down_again_returns_the_frames():
    motion = wave()
    back = motion.resample(4 * motion.rate).resample(motion.rate)
    assert np.allclose(back.forward()[0], motion.forward()[0], atol=1e-9)


def test_slice_includes_both_ends_and_refuses_what_is_not_there():
    motion = wave()
    assert motion.slice(3, 10).frame_count == 8
    assert np.array_equal(motion.slice(3, 10).root_position[-1], motion.root_position[10])
    for first, last in ((-1, 5), (5, 5), (6, 5), (0, 25)):
        with pytest.raises(ValueError, match="not a range"):
            motion.slice(first, last)


def test_what_only_some_formats_record_goes_along():
    plain, frames = wave(), 25
    assert plain.slice(3, 10).ball is None and plain.resample(100.0).positions is None
    ball = np.linspace([0.0, 0.0, 1.0], [2.4, 0.0, 1.0], frames)
    held = np.arange(frames) < 10
    motion = replace(plain, ball=ball, ball_held=held, positions=plain.forward()[0])
    part = motion.slice(3, 12)
    assert np.array_equal(part.ball, ball[3:13]) and np.array_equal(part.ball_held, held[3:13])
    assert np.array_equal(part.positions, motion.positions[3:13])
    fine = motion.resample(4 * motion.rate)
    assert np.allclose(fine.ball[:, 0], np.linspace(0.0, 2.4, 97))
    assert fine.ball_held.dtype == bool and fine.ball_held[:37].all() and not fine.ball_held[39:].any()
    assert np.allclose(fine.positions[::4], motion.positions)
    with pytest.raises(ValueError, match="ball is"):
        replace(motion, ball=ball[:-1])


def test_an_unknown_joint_is_named_with_those_there_are():
    with pytest.raises(ValueError, match=r"no joint 'tail'.*hips"):
        wave().index("tail")


def test_children_before_parents_are_refused():
    motion = wave()
    with pytest.raises(ValueError, match="parents"):
        Motion(
            NAMES,
            np.array([-1, 2, 0, 0]),
            motion.offsets,
            motion.rotations,
            motion.root_position,
            motion.rate,
            motion.rest_rotations,
        )
