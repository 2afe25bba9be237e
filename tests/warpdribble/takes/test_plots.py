import numpy as np
import pytest
from matplotlib.image import imread

from warpdribble.takes.plots import write_plots
from warpdribble.takes.take import TakeError


def drawn(path, fallen=None, frames=80):
    turn = np.linspace(0.0, 3.0, frames)
    wanted = np.stack([np.sin(turn), 1.0 - np.cos(turn), np.ones(frames)], axis=1)
    error = 0.02 + 0.01 * np.sin(5.0 * turn)
    return write_plots(path, 50.0, wanted + 0.05, wanted, error, 0.3 * error, fallen, "a title")


def test_plots_are_drawn(tmp_path):
    picture = imread(drawn(tmp_path / "plots.png"))[..., :3]
    assert picture.shape[0] > 500 and picture.shape[1] > 1400
    blue = (picture[..., 2] > picture[..., 0] + 0.3).mean()
    assert blue > 0.002
    assert [p.name for p in tmp_path.iterdir()] == ["plots.png"]


def test_a_fall_is_marked(tmp_path):
    clean = imread(drawn(tmp_path / "a.png"))[..., :3]
    marked = imread(drawn(tmp_path / "b.png", np.arange(80) > 50))[..., :3]
    reddish = [(p[..., 0] > p[..., 2] + 0.05).mean() for p in (clean, marked)]
    assert reddish[1] > reddish[0] + 0.05


def test_one_frame_is_enough(tmp_path):
    assert drawn(tmp_path / "one.png", np.ones(1, bool), frames=1).is_file()


def test_only_png_is_drawn(tmp_path):
    with pytest.raises(TakeError, match=r"\.png"):
        drawn(tmp_path / "plots.svg")
