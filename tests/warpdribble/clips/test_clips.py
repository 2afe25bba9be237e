import numpy as np
import pytest

from warpdribble.clips.bvh import read_bvh
from warpdribble.clips.read import ClipError, read_clip, read_part
from warpdribble.sims.errors import InputError


def with_axes(text, order):
    """A BVH text with its axes renamed: order 'ZXY' makes X the Z axis, Y the X axis and Z the Y axis."""
    to = ["XYZ".index(letter) for letter in order]

    def moved(values):
        new = [""] * 3
        for value, place in zip(values, to):
            new[place] = value
        return new

    lines = []
    for line in text.splitlines():
        words = line.split()
        if words[0] == "OFFSET":
            line = "OFFSET " + " ".join(moved(words[1:]))
        elif words[0] == "CHANNELS":
            turns = [order["XYZ".index(w[0])] + w[1:] for w in words[-3:]]
            line = " ".join([*words[:-3], *turns])
        elif len(words) > 9:
            line = " ".join([*moved(words[:3]), *words[3:]])
        lines.append(line)
    return "\n".join(lines) + "\n"


def test_every_clip_reads(mocap):
    clips = sorted([*mocap.glob("cmu/*.bvh"), *mocap.glob("ballplay_m/*.pt")])
    assert len(clips) == 109
    for path in clips:
        motion, notes = read_clip(path)
        assert notes and np.isfinite(motion.rotations).all()
        left = motion.rest()[0]
        assert 0.7 < np.ptp(left[:, 2]) < 2.2, path


def test_the_same_person_whatever_axis_points_up(cmu_clip, tmp_path):
    """The same recording with other axes: the same motion but for where the world's X lies."""
    same, _ = read_clip(cmu_clip)
    for order, up in (("ZXY", "X"), ("YZX", "Z")):
        path = tmp_path / f"{order}.bvh"
        path.write_text(with_axes(cmu_clip.read_text(), order))
        motion, notes = read_clip(path)
        assert f"{up} points up" in notes
        assert np.allclose(motion.rest()[0], same.rest()[0], atol=1e-5)
        assert np.allclose(motion.forward()[0], same.forward()[0], atol=1e-5)


def test_units_and_up_can_be_given(cmu_clip):
    told, _ = read_clip(cmu_clip)
    given, notes = read_clip(cmu_clip, units="cmu", up="y")
    assert np.allclose(told.root_position, given.root_position)
    assert any("given" in note for note in notes)
    cm, _ = read_clip(cmu_clip, units=0.01)
    assert np.allclose(told.offsets / 0.05644444, cm.offsets / 0.01, atol=1e-4)
    lying, _ = read_clip(cmu_clip, up="z")
    assert np.ptp(lying.rest()[0][:, 2]) < 0.5


@pytest.mark.parametrize("reading", [{"units": "mile"}, {"units": "-1"}, {"units": "nan"}, {"up": "w"}])
def test_units_and_axes_that_are_none(cmu_clip, reading):
    ((hint, value),) = reading.items()
    with pytest.raises(InputError, match=f"there is no .* '{value}': it is") as error:
        read_clip(cmu_clip, **reading)
    assert error.value.hint == hint


def test_ballplay_has_its_own_units(ballplay_clip):
    read_clip(ballplay_clip, units="m", up="z")
    with pytest.raises(ClipError, match="in metres, Z up: say neither units nor up"):
        read_clip(ballplay_clip, units="cm")


def test_any_clip_s_rate_can_be_given(cmu_clip, amc_clip, ballplay_clip):
    for path, reading in ((cmu_clip, {}), (amc_clip, {"units": "m", "up": "z"}), (ballplay_clip, {})):
        as_it_is, _ = read_clip(path, **reading)
        motion, notes = read_clip(path, rate=50, **reading)
        assert motion.rate == 50.0 != as_it_is.rate and any("rate given: 50 Hz" in note for note in notes)
        assert np.array_equal(motion.root_position, as_it_is.root_position)


@pytest.mark.parametrize("name", ["clip.fbx", "clip", "clip.asf"])
def test_other_files_are_refused(tmp_path, name):
    (tmp_path / name).write_text("x")
    with pytest.raises(ClipError, match=name):
        read_clip(tmp_path / name)


def test_a_part_is_cut_after_it_was_repaired(cmu_clip):
    whole, _ = read_part(cmu_clip, repairs="ground,toes")
    part, notes = read_part(cmu_clip, (20, 60), "toes, ground")
    assert np.array_equal(part.rotations, whole.rotations[20:61])
    assert [n.split(":")[0] for n in notes[-2:]] == ["repair toes", "repair ground"]
    for frames in ((60, 20), (0, 500), (-3, 5)):
        with pytest.raises(ClipError, match="0 to 120") as error:
            read_part(cmu_clip, frames)
        assert error.value.hint == "frames"
    with pytest.raises(InputError, match="no repair 'hair': there are spikes, ") as error:
        read_part(cmu_clip, repairs="hair")
    assert error.value.hint == "repairs"


def test_more_than_one_end_site_is_no_mistake(cmu_clip):
    text = cmu_clip.read_text()
    end = text[text.index("End Site") : text.index("}", text.index("End Site")) + 1]
    cmu_clip.write_text(text.replace(end, f"{end}\n{end}", 1))
    motion, _ = read_bvh(cmu_clip)
    assert "LeftToeBase_end_2" in motion.joint_names
