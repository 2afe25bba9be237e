import zipfile

import numpy as np
import pytest

from warpdribble.clips.ballplay import COLUMNS, read_ballplay
from warpdribble.clips.errors import ClipError

HANDS = ("Wrist", "Index", "Middle", "Pinky", "Ring", "Thumb")


def rewrite(path, change):
    """Rewrite the archive with its entries {name: bytes} changed."""
    with zipfile.ZipFile(path) as archive:
        entries = {n: archive.read(n) for n in archive.namelist()}
    change(entries)
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in entries.items():
            archive.writestr(name, data)


def edit(change):
    """A change of the table (frames, columns) in place."""

    def apply(entries):
        rows = np.frombuffer(entries["archive/data/0"], "<f4").reshape(-1, COLUMNS).copy()
        change(rows)
        entries["archive/data/0"] = rows.tobytes()

    return apply


def test_a_clip_faces_where_it_was_turned_and_stands_upright(ballplay_clip):
    motion, notes = read_ballplay(ballplay_clip)
    assert (motion.frame_count, motion.rate, len(motion.joint_names)) == (30, 60.0, 53)
    at, _ = motion.forward()
    assert np.allclose(at, motion.positions, atol=1e-5)
    hips = at[0, motion.index("L_Hip")] - at[0, motion.index("R_Hip")]
    assert np.allclose(hips / np.linalg.norm(hips), [-1, 0, 0], atol=1e-5)  # left is +Y, turned by 90
    assert at[0, motion.index("Head"), 2] > 1.4
    rest, _ = motion.rest()
    assert rest[motion.index("L_Wrist"), 1] > 0.5 and rest[motion.index("L_Toe"), 0] > 0.1
    assert notes


def test_ball_and_contact_are_there(ballplay_clip):
    motion, _ = read_ballplay(ballplay_clip)
    assert motion.ball.shape == (30, 3) and motion.ball_held.dtype == bool
    assert motion.ball_held.sum() == 10
    assert motion.slice(5, 12).ball_held.tolist() == [True] * 5 + [False] * 3


def test_every_clip_agrees_with_its_recorded_positions(mocap):
    """Within the numbers of the data's description: mm at the trunk, 3 to 8 cm at wrists and fingers."""
    clips = sorted((mocap / "ballplay_m").glob("*.pt"))
    assert len(clips) == 89
    for path in clips:
        motion, _ = read_ballplay(path)
        off = np.linalg.norm(motion.forward()[0] - motion.positions, axis=2).mean(axis=0)
        limit = {"Torso": 0.012, "Spine": 0.012, "Chest": 0.012, "Neck": 0.012, "Head": 0.012, "Pelvis": 1e-9}
        for joint, name in enumerate(motion.joint_names):
            hand = any(part in name for part in HANDS)
            assert off[joint] < limit.get(name, 0.08 if hand else 0.04), (path.name, name)
        assert np.abs(motion.ball).max() < 10.0


@pytest.mark.parametrize(
    ("clip", "held"),
    [
        ("001_007pickle_pick_002", [(210, 350)]),
        ("042_018pickle_rturnover_30", [(0, 35), (43, 82), (98, 135)]),
        ("010_022pickle_runOffBall_002", []),
    ],
)
def test_hand_contact_is_that_of_the_table(mocap, clip, held):
    motion, _ = read_ballplay(mocap / "ballplay_m" / f"{clip}.pt")
    flags = np.zeros(motion.frame_count, bool)
    for first, last in held:
        flags[first : last + 1] = True
    assert np.array_equal(motion.ball_held, flags)


BROKEN = {
    "not a number": edit(lambda rows: rows.__setitem__((3, 200), np.nan)),
    "infinite": edit(lambda rows: rows.__setitem__((3, 4), np.inf)),
    "no angle": edit(lambda rows: rows.__setitem__((3, 20), 1e6)),
    "far away": edit(lambda rows: rows.__setitem__((slice(None), 324), 1e5)),
    "another skeleton": edit(lambda rows: rows.__setitem__((slice(None), slice(165, 324)), 0.0)),
    "a contact of two": edit(lambda rows: rows.__setitem__((0, 336), 2.0)),
    "columns in disorder": edit(lambda rows: np.random.default_rng(0).shuffle(rows.T)),
    "another size": lambda e: e.update({"archive/data/0": e["archive/data/0"][:-4]}),
    "no rows": lambda e: e.update({"archive/data/0": b""}),
    "no tensor": lambda e: e.pop("archive/data/0"),
    "two tensors": lambda e: e.update({"other/data/0": b""}),
    "doubles": lambda e: e.update({"archive/data.pkl": b"DoubleStorage"}),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_broken_clips_are_refused_in_one_line(ballplay_clip, kind):
    rewrite(ballplay_clip, BROKEN[kind])
    with pytest.raises(ClipError) as refused:
        read_ballplay(ballplay_clip)
    assert str(ballplay_clip) in str(refused.value) and "\n" not in str(refused.value)


def test_a_compressed_archive_is_refused(ballplay_clip):
    with zipfile.ZipFile(ballplay_clip) as archive:
        entries = {n: archive.read(n) for n in archive.namelist()}
    with zipfile.ZipFile(ballplay_clip, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    with pytest.raises(ClipError, match="compressed"):
        read_ballplay(ballplay_clip)


def test_nothing_is_unpickled(ballplay_clip, tmp_path):
    """A pickle that would write a file if it were loaded."""
    trap = tmp_path / "trap"
    evil = f"cos\nsystem\n(S'touch {trap}'\ntR.FloatStorage".encode()
    rewrite(ballplay_clip, lambda e: e.update({"archive/data.pkl": evil}))
    read_ballplay(ballplay_clip)
    assert not trap.exists()
