"""The quality report against motions made for it, and against what is known of the recorded clips."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.clips.read import read_clip, read_part
from warpdribble.sims.recording.motion import Motion
from warpdribble.sims.recording.quality import examine

NAMES = ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase", "RightArm", "RightForeArm", "RightHand")
PARENTS = np.array([-1, 0, 1, 2, 3, 0, 5, 6])
LEG = [[0, 0, 0], [0, 0.1, 0], [0, 0, -0.4], [0, 0, -0.4], [0.12, 0, -0.08]]
OFFSETS = np.array([*LEG, [0, -0.2, 0.4], [0.3, 0, 0], [0.3, 0, 0]])


def standing(frames=360, rate=120.0, speed=0.0, rng=0):
    """Somebody with one leg and one arm, standing (or gliding at `speed`) with a little unrest, who moves the
    hand up and down at 1.5 Hz."""
    times = np.arange(frames) / rate
    turns = np.random.default_rng(rng).normal(scale=1e-3, size=(frames, len(NAMES), 3))
    turns[:, :5] *= 0.02
    turns[:, 5, 1] += 0.5 * np.cos(2 * np.pi * 1.5 * times)
    rotations = Rotation.from_rotvec(turns.reshape(-1, 3)).as_quat().reshape(frames, len(NAMES), 4)
    root = np.stack([speed * times, 0 * times, 0 * times + 0.88], axis=1)
    rest = np.tile([0.0, 0.0, 0.0, 1.0], (len(NAMES), 1))
    return Motion(NAMES, PARENTS, OFFSETS, rotations, root, rate, rest)


def test_a_made_motion_is_measured():
    quality = examine(standing(speed=0.2), first_frame=100)
    assert quality.root_speed_mean == pytest.approx(0.2, abs=0.005)
    assert quality.ground == pytest.approx(0.0, abs=0.002)
    assert quality.feet["left"].contacts == [(100, 459)]
    assert quality.feet["left"].slide == pytest.approx(0.2, abs=0.01)
    hand = quality.hands["right"]
    assert hand.rate == pytest.approx(1.5, abs=0.03)
    assert hand.top - hand.low == pytest.approx(1.2 * np.sin(0.5), abs=0.03)
    assert hand.strokes[0] == pytest.approx(100, abs=82) and len(hand.strokes) in (4, 5)
    assert not quality.jumps and not quality.frozen and not quality.under_ground
    assert quality.ball_bounces is None


def test_a_jump_a_frozen_arm_and_a_foot_under_the_ground_are_found():
    motion = standing()
    rotations = motion.rotations.copy()
    rotations[120:160, 5:] = rotations[120, 5:]
    rotations[250:, 2] = (
        Rotation.from_rotvec([0, 0.15, 0]) * Rotation.from_quat(rotations[250:, 2])
    ).as_quat()
    root = motion.root_position.copy()
    root[300:330, 2] -= 0.1
    quality = examine(replace(motion, rotations=rotations, root_position=root))
    assert [(e.what, e.first, e.last) for e in quality.frozen] == [("right arm", 120, 159)]
    firsts = [e.first for e in quality.jumps]
    assert 250 in firsts and 300 in firsts and 330 in firsts
    leg = next(e for e in quality.jumps if e.first == 250)
    assert "LeftFoot" in leg.what and leg.size == pytest.approx(0.07, abs=0.02)
    under = quality.under_ground
    assert [(e.what, e.first, e.last) for e in under] == [("left foot", 300, 329)]


def test_bounces_of_a_recorded_ball():
    times = np.arange(360) / 120.0
    height = 0.12 + 0.8 * np.abs(np.cos(np.pi * 1.0 * times))
    ball = np.stack([times, times, height], axis=1)
    quality = examine(replace(standing(), ball=ball, ball_held=height > 0.8))
    assert quality.ball_bounces == [60, 180, 300]
    assert quality.ball_held[0][0] == 0


@pytest.mark.parametrize("frames", [1, 2, 3, 8, 17])
def test_short_motions_are_measured_without_complaint(frames):
    quality = examine(standing(frames))
    assert quality.frames == frames and np.isfinite(quality.root_speed_max)


# clip -> frames where the data's description knows of a jump (README of the recordings)
JUMPS = {
    "cmu/06_02.bvh": [82, 638],
    "cmu/06_03.bvh": [85, 87, 238, 243],
    "cmu/06_04.bvh": [55, 395],
    "cmu/06_09.bvh": [13, 21],
    "cmu/06_12.bvh": [359, 395, 790],
    "cmu/06_13.bvh": [632, 667, 1307, 2115, 2123, 2280, 2666, 2880, 4369],
    "cmu/06_14.bvh": [196, 265],
    "cmu/06_15.bvh": [482, 487],
    "cmu/02_03.bvh": [7],
    "cmu/08_01.bvh": [220],
    "cmu/09_12.bvh": [450, 506, 530, 937, 1004, 1803, 1826],
    "ballplay_m/013_018pickle_run2_3.pt": [36],
    "ballplay_m/009_006pickle_dribble2shot.pt": [97, 99],
    "ballplay_m/031_015pickle_layup_001_001.pt": [81, 85, 107],
}


@pytest.mark.parametrize("clip", JUMPS)
def test_known_jumps_are_found(mocap, clip):
    jumps = examine(read_clip(mocap / clip)[0]).jumps
    for frame in JUMPS[clip]:
        assert any(e.first - 3 <= frame <= e.last + 3 for e in jumps), frame


@pytest.mark.parametrize("clip", ["02_01", "07_01", "06_01", "06_06"])
def test_clean_clips_have_few_jumps(mocap, clip):
    motion, _ = read_clip(mocap / "cmu" / f"{clip}.bvh")
    assert len(examine(motion).jumps) <= 6


def test_known_frozen_part(mocap):
    frozen = examine(read_clip(mocap / "cmu" / "06_02.bvh")[0]).frozen
    assert len(frozen) == 5
    assert all(e.last == 720 and 630 <= e.first <= 639 for e in frozen)
    for clip in ("02_01", "06_12", "06_13"):
        assert not examine(read_clip(mocap / "cmu" / f"{clip}.bvh")[0]).frozen


def test_known_foot_under_the_ground(mocap):
    under = examine(read_clip(mocap / "cmu" / "06_13.bvh")[0]).under_ground
    worst = max(under, key=lambda e: e.size)
    assert worst.what == "left foot" and worst.size == pytest.approx(0.15, abs=0.04)
    assert worst.first >= 2870 and worst.last <= 3040


# clip, window, root speed [m/s], dribbling hand, its rate [Hz], its amplitude [m]: the recordings' table
STEADY = [
    ("06_02", (280, 620), 1.40, "right", 1.12, 0.46),
    ("06_03", (280, 526), 1.34, "right", 1.36, 0.45),
    ("06_04", (20, 395), 1.37, "left", 1.14, 0.44),
    ("06_06", (20, 401), 1.20, "right", 1.40, 0.38),
    ("06_07", (200, 560), 1.29, "right", 1.11, 0.54),
    ("06_08", (100, 341), 1.32, "right", 1.43, 0.37),
    ("06_09", (40, 300), 1.44, "right", 1.59, 0.43),
    ("06_10", (390, 930), 0.11, "right", 1.21, 0.48),
    ("06_12", (400, 1040), 0.14, "right", 1.25, 0.48),
]


@pytest.mark.parametrize(("clip", "frames", "speed", "side", "rate", "amplitude"), STEADY)
def test_dribbles_match_the_table(mocap, clip, frames, speed, side, rate, amplitude):
    quality = examine(read_part(mocap / "cmu" / f"{clip}.bvh", frames)[0], frames[0])
    assert quality.root_speed_mean == pytest.approx(speed, abs=0.04)
    hand = quality.hands[side]
    assert hand.rate == pytest.approx(rate, rel=0.05)
    assert hand.top - hand.low == pytest.approx(amplitude, abs=0.08)
    assert all(frames[0] <= f <= frames[1] for f in hand.strokes)
    other = quality.hands["left" if side == "right" else "right"]
    assert len(other.strokes) <= 1


# clip -> bounce frames: the table of the recordings with a ball
BOUNCES = {
    "009_006pickle_dribble2shot": [30],
    "010_022pickle_runOffBall_002": [],
    "011_018pickle_lrun_1": [16, 82],
    "013_018pickle_pick2run_3": [47, 101],
    "013_018pickle_run2_3": [8, 62],
    "013_018pickle_run_3": [18, 71],
    "031_015pickle_layup_001_001": [43],
    "041_018pickle_pick2back_7": [93, 134, 179, 219],
    "042_018pickle_rturnover_30": [38, 89],
    "044_006pickle_lleg_2": [40, 82, 125, 166],
}


@pytest.mark.parametrize("clip", BOUNCES)
def test_bounces_match_the_table(mocap, clip):
    bounces = examine(read_clip(mocap / "ballplay_m" / f"{clip}.pt")[0]).ball_bounces
    assert len(bounces) == len(BOUNCES[clip])
    assert np.allclose(bounces, BOUNCES[clip], atol=1)
