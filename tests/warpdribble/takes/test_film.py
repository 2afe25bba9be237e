"""Pictures of takes: where things are seen, their colours and their shadows, against geometry; films."""

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.takes import camera
from warpdribble.takes.film import SUN, Camera, frame_count, write_film
from warpdribble.takes.take import Take, TakeError

SIZE = (90, 120)


@pytest.fixture(scope="module")
def take():
    player = Model.load("player")
    body_q = pose.forward(player, np.tile(player.start_q, (60, 1)))
    ball = player.body("ball")
    body_q[:, ball, :3] = [0.5, -0.4, 0.9]
    body_q[:, ball, 0] += 0.01 * np.arange(60)
    return Take.of(player, body_q, 100.0)


def seen_at(take, frame, point, size=SIZE, fills=0.72):
    """Row and column at which a point [m] is in the picture, by projection."""
    player = [b for b, name in enumerate(take.body_names) if name != take.ball]
    poses, _ = camera.following(take, player, camera.BACK, fills)
    x, y, z = Rotation.from_quat(poses[frame, 3:]).inv().apply(point - poses[frame, :3])
    scale = camera.FOCAL / (0.5 * camera.HEIGHT) / -z
    half = size[1] / 2
    return round(half - scale * y * half - 0.5), round(size[0] / 2 + scale * x * half - 0.5)


def without_ball(take):
    ball = take.body_names.index("ball")
    return Take(take.body_names, [s for s in take.shapes if s.body != ball], take.body_q, take.fps)


def pixels(picture):
    return np.asarray(picture, float)


def test_the_ball_is_seen_where_it_is(take):
    """What is orange there, and is not without the ball; as large as it should be."""
    seen, bare = (Camera(one, SIZE, skin=False, samples=3) for one in (take, without_ball(take)))
    player = [b for b, name in enumerate(take.body_names) if name != take.ball]
    poses, _ = camera.following(take, player, camera.BACK, 0.72)
    for frame in (0, 50):
        picture = pixels(seen.picture(frame))
        r, g, b = np.moveaxis(picture, 2, 0)
        orange = (r > 1.6 * b) & (g < 0.85 * r) & (g > 0.45 * r) & (r > 120)
        orange &= np.abs(picture - pixels(bare.picture(frame))).max(axis=2) > 10.0
        centre = take.worlds[0, frame, take.body_names.index("ball"), :3]
        row, column = seen_at(take, frame, centre)
        rows, columns = np.nonzero(orange)
        assert abs(np.median(rows) - row) < 2.0 and abs(np.median(columns) - column) < 2.0
        away = np.linalg.norm(poses[frame, :3] - centre)
        radius = SIZE[1] * 0.119 / away * camera.FOCAL / camera.HEIGHT
        near = np.hypot(rows - row, columns - column) < 1.3 * radius
        assert near.sum() == pytest.approx(0.87 * np.pi * radius**2, rel=0.2)  # seams are black


def test_it_throws_a_shadow(take):
    """On the floor, away from the sun; nothing is darker there without the ball."""
    centre = np.array([0.5, -0.4, 0.9])
    spot = centre - SUN / SUN[2] * centre[2]
    row, column = seen_at(take, 0, spot)
    pictures = [Camera(one, SIZE, skin=False, samples=3).picture(0) for one in (take, without_ball(take))]
    with_it, without = (pixels(picture)[row, column].mean() for picture in pictures)
    assert with_it < 0.8 * without


def test_the_camera_shows_all_of_the_player(take):
    """Head and feet, in so much of the height as was asked for."""
    picture = pixels(Camera(take, SIZE, samples=2, fills=0.6).picture(0))
    head = take.worlds[0, 0, take.body_names.index("head"), :3] + [0.0, 0.0, 0.22]
    top, column = seen_at(take, 0, head, fills=0.6)
    dark = picture[:, column].mean(axis=1) < 120.0  # hair
    assert abs(np.flatnonzero(dark)[0] - top) <= 4
    bottom, _ = seen_at(take, 0, np.array([*head[:2], 0.0]), fills=0.6)
    assert (bottom - top) / SIZE[1] == pytest.approx(0.6, abs=0.06)


def test_shapes_are_shown_without_a_skin(take):
    with_it, without = (pixels(Camera(take, SIZE, skin=skin).picture(0)) for skin in (True, False))
    assert 0.01 < (np.abs(with_it - without).max(axis=2) > 40).mean() < 0.4


def test_a_picture_is_the_same_again(take):
    one = Camera(take, SIZE)
    first = pixels(one.picture(0))
    one.picture(40)
    np.testing.assert_array_equal(pixels(one.picture(0)), first)


@pytest.mark.parametrize("suffix", [".webp", ".gif"])
def test_a_film_moves_and_goes_on_for_ever(take, tmp_path, suffix):
    done = []
    path = write_film(tmp_path / f"a{suffix}", take, size=(40, 50), samples=1, progress=done.append)
    assert done == list(range(1, frame_count(take) + 1)) and len(done) == 12
    with Image.open(path) as film:
        assert (film.n_frames, film.size, film.info["loop"]) == (12, (40, 50), 0)
        first = np.asarray(film.convert("RGB"), float)
        assert film.info.get("duration", 50) == 50
        film.seek(11)
        assert np.abs(np.asarray(film.convert("RGB"), float) - first).max() > 40
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_what_cannot_be_filmed(take, tmp_path):
    with pytest.raises(TakeError, match=r"\.webp, \.gif"):
        write_film(tmp_path / "a.mp4", take)
    with pytest.raises(TakeError, match="no frame 99"):
        write_film(tmp_path / "a.gif", take, first=99, size=(8, 8))
    with pytest.raises(ValueError, match="the take has 2"):
        Camera(Take(take.body_names, take.shapes, np.stack([take.body_q] * 2), 100.0))
