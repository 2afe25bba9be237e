import numpy as np
import pytest
from matplotlib.image import imread

from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.takes.sheet import write_sheet
from warpdribble.takes.take import Take, TakeError


@pytest.fixture(scope="module")
def take():
    player = Model.load("player")
    body_q = pose.forward(player, np.tile(player.start_q, (60, 1)))
    return Take(list(player.body_names), player.shapes, body_q, 100.0)


def test_a_sheet_is_drawn_in_colour(take, tmp_path):
    height = take.body_q[:, take.body_names.index("r_hand"), 2]
    contacts = {"ball on ground": np.arange(60) % 20 < 3, "never": np.zeros(60, bool)}
    path = write_sheet(tmp_path / "sheet.png", take, {"right hand": height}, contacts, "a title")
    picture = imread(path)[..., :3]
    assert picture.shape[0] > 600 and picture.shape[1] > 1200
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 200
    assert (picture.min(axis=2) < 0.9).mean() > 0.05
    assert [p.name for p in tmp_path.iterdir()] == ["sheet.png"]


def test_one_frame_is_enough(take, tmp_path):
    still = Take(take.body_names, take.shapes, take.body_q[:1], 100.0)
    assert write_sheet(tmp_path / "still.png", still, {}, {"x": np.ones(1, bool)}).is_file()


def test_only_png_is_drawn(take, tmp_path):
    with pytest.raises(TakeError, match=r"\.png"):
        write_sheet(tmp_path / "sheet.jpg", take, {}, {})
