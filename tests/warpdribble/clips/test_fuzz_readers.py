"""Bytes at random into every reader: a ClipError in one line, or a sound motion; nothing else, and soon."""

import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from warpdribble.clips.read import ClipError, read_clip
from warpdribble.sims.recording.quality import examine

LONGEST = 5.0
"""[s] that reading a broken file may take."""


def cut(rng, data):
    return data[: rng.integers(0, len(data))]


def overwritten(rng, data):
    data = bytearray(data)
    for _ in range(rng.integers(1, 12)):
        data[rng.integers(0, len(data))] = rng.integers(0, 256)
    return bytes(data)


def shuffled(rng, data):
    """A part of the file in another order, in pieces of 1 to 64 bytes."""
    size = int(rng.choice([1, 4, 16, 64]))
    pieces = [data[i : i + size] for i in range(0, len(data), size)]
    first, last = np.sort(rng.integers(0, len(pieces) + 1, 2))
    part = pieces[first:last]
    return b"".join([*pieces[:first], *(part[i] for i in rng.permutation(len(part))), *pieces[last:]])


def lines_shuffled(rng, data):
    lines = data.split(b"\n")
    first, last = np.sort(rng.integers(0, len(lines) + 1, 2))
    part = lines[first:last]
    return b"\n".join([*lines[:first], *(part[i] for i in rng.permutation(len(part))), *lines[last:]])


def doubled(rng, data):
    first, last = np.sort(rng.integers(0, len(data) + 1, 2))
    return data[:last] + data[first:last] * int(rng.integers(1, 4)) + data[last:]


def removed(rng, data):
    first, last = np.sort(rng.integers(0, len(data) + 1, 2))
    return data[:first] + data[last:]


def other_numbers(rng, data):
    """Some words replaced by numbers that hurt."""
    words = data.split(b" ")
    hurting = [b"nan", b"-inf", b"1e308", b"1e-308", b"-1", b"0", b"9" * 30, b"1e9", b"#", b"\x00"]
    for _ in range(rng.integers(1, 5)):
        words[rng.integers(0, len(words))] = hurting[rng.integers(0, len(hurting))]
    return b" ".join(words)


def noise(rng, data):
    return rng.bytes(int(rng.integers(0, 3000)))


FRAME_ENDS = (b"shin 0 0 0",)
CHANGES = (cut, overwritten, shuffled, lines_shuffled, doubled, removed, other_numbers, noise)


@pytest.fixture
def clips(cmu_clip, amc_clip, ballplay_clip):
    """Per kind of file: the clip that is read, the file that is broken, and its bytes."""
    lines = cmu_clip.read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("Frame Time"))
    short = [line.replace("Frames: 122", "Frames: 4") for line in lines[: first + 5]]
    cmu_clip.write_text("\n".join(short) + "\n")
    skeleton = amc_clip.with_name("01.asf")
    files = {"bvh": (cmu_clip, cmu_clip), "amc": (amc_clip, amc_clip), "asf": (amc_clip, skeleton)}
    files["pt"] = (ballplay_clip, ballplay_clip)
    for clip, _ in files.values():
        read(clip)
    return {kind: (clip, broken, broken.read_bytes()) for kind, (clip, broken) in files.items()}


def read(clip):
    """The small skeleton of the .amc clip is no person: its units have to be given."""
    return read_clip(clip, units="m", up="z") if clip.suffix == ".amc" else read_clip(clip)


def attempt(clip):
    """Whether a file is refused; anything but a ClipError in one line or a sound motion fails."""
    began = time.perf_counter()
    refused = False
    try:
        motion, _ = read(clip)
        assert np.isfinite(motion.rotations).all() and np.isfinite(motion.offsets).all()
        assert np.allclose(np.linalg.norm(motion.rotations, axis=-1), 1.0)
        with np.errstate(all="raise", under="ignore"):
            examine(motion)
    except ClipError as error:
        refused = True
        assert "\n" not in str(error) and len(str(error)) < 1000
    assert time.perf_counter() - began < LONGEST
    return refused


def fuzz(clips, kind, cases, seed):
    clip, broken, data = clips[kind]
    others = sorted(p for p in clip.parent.iterdir())
    refused = 0
    for case in range(cases):
        rng = np.random.default_rng([seed, case])
        change = CHANGES[case % len(CHANGES)]
        changed = change(rng, data)
        broken.write_bytes(changed)
        was_refused = attempt(clip)
        assert was_refused or change is not noise, case
        refused += was_refused
    broken.write_bytes(data)
    assert sorted(p for p in clip.parent.iterdir()) == others  # nothing was written
    return refused


@pytest.mark.parametrize("kind", ["bvh", "amc", "asf", "pt"])
def test_broken_bytes(clips, kind):
    assert fuzz(clips, kind, 160, seed=1) > 80


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["bvh", "amc", "asf", "pt"])
def test_ten_thousand_broken_files(clips, kind):
    assert fuzz(clips, kind, 2500, seed=2) > 1000


@pytest.mark.parametrize("suffix", [".bvh", ".amc", ".pt"])
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=400))
def test_any_bytes_are_refused(tmp_path, suffix, data):
    path = tmp_path / f"clip{suffix}"
    path.write_bytes(data)
    assert attempt(path)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=st.text(st.sampled_from("0123456789.-+e \n{}:#ROTJINFraemsOFSETCHANLxyz"), max_size=300))
def test_texts_that_look_like_it(amc_clip, text):
    skeleton = amc_clip.with_name("01.asf")
    for path in (amc_clip.with_suffix(".bvh"), skeleton, amc_clip):
        path.write_text(text)
        attempt(path if path.suffix != ".asf" else amc_clip)


@pytest.mark.parametrize("kind", ["bvh", "amc", "asf", "pt"])
def test_every_cut(clips, kind):
    """A file cut short anywhere is refused, but within its last number, and an .amc file, which does not say
    how many frames it has, behind a frame."""
    clip, broken, data = clips[kind]
    tail = len(data) - 12
    for length in [*range(0, tail, max(1, tail // 150)), *range(tail, len(data))]:
        broken.write_bytes(data[:length])
        assert attempt(clip) or length > tail or data[:length].strip().endswith(FRAME_ENDS), length
