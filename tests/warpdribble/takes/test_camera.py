"""What the camera of a take shows, as OpenUSD projects it."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom
from scipy.spatial.transform import Rotation

from warpdribble.sims.planar import over_ground
from warpdribble.skin import skin
from warpdribble.takes import Take, write_take
from warpdribble.takes.camera import FILLS

FPS = 50.0


def along(take, places, turns):
    """A take's first frames again and again, led along places (frames, 2) with turns (frames,) [rad]."""
    frames = np.arange(len(places)) % len(take.body_q)
    body_q = np.array(take.body_q[frames], float)
    for poses, place, turn in zip(body_q, places, turns, strict=True):
        poses[:] = over_ground(poses, np.zeros(2), place, turn)
    return Take.of(take.model, body_q, FPS)


def projected(path, points, frame):
    """Points (n, 3) in the frame of the camera, which goes from -1 to 1 both ways."""
    stage = Usd.Stage.Open(str(path))
    frustum = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera(frame).frustum
    matrix = np.array(frustum.ComputeViewMatrix()) @ np.array(frustum.ComputeProjectionMatrix())
    seen = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ matrix
    assert np.all(seen[:, 3] > 0.0)
    return seen[:, :2] / seen[:, 3:]


def eyes(path, frames):
    stage = Usd.Stage.Open(str(path))
    prim = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Camera"))
    return np.array([np.array(prim.ComputeLocalToWorldTransform(f))[3, :3] for f in range(frames)])


time = np.arange(300) / FPS
WAYS = {
    "stands": (np.zeros((300, 2)), np.zeros(300)),
    "runs off": (np.stack([5.0 * time, -1.0 * time], axis=1), np.full(300, -0.2)),
    "runs a circle": (
        3.0 * np.stack([np.cos(time), np.sin(time)], axis=1),
        time + 0.5 * np.pi,
    ),
    "sets off": (np.stack([np.maximum(time - 3.0, 0.0) * 4.0, 0.0 * time], axis=1), np.zeros(300)),
}


@pytest.mark.parametrize("way", WAYS)
def test_the_player_fills_half_the_height_all_the_way(dribble_take, tmp_path, way):
    take = along(dribble_take, *WAYS[way])
    path = write_take(tmp_path / "take.usdc", take, skin=True)
    built, heights = skin.of(take.model), []
    for frame in range(0, 300, 13):
        seen = projected(path, built.posed(take.body_q[frame]), frame)
        low, high = seen.min(axis=0), seen.max(axis=0)
        heights.append(0.5 * (high[1] - low[1]))
        assert np.abs(0.5 * (low + high)).max() < 0.2, f"off the middle in frame {frame}"
    assert np.median(heights) == pytest.approx(FILLS, abs=0.03)
    assert min(heights) > FILLS - 0.1 and max(heights) < FILLS + 0.1


def test_it_does_not_shake_with_its_player(dribble_take, tmp_path):
    """Steps at 3 Hz and a sway, on a straight way: the camera goes nearly as if there were none."""
    steady = np.stack([3.0 * time, 0.0 * time], axis=1)
    steps = np.stack([0.05 * np.sin(6.0 * np.pi * time), 0.04 * np.sin(3.0 * np.pi * time)], axis=1)
    found = []
    for number, way in enumerate((steady, steady + steps)):
        take = along(dribble_take, way, np.zeros(300))
        found.append(eyes(write_take(tmp_path / f"{number}.usdc", take), 300))
    assert np.abs(found[1] - found[0]).max() < 0.02
    rest = np.diff(found[1], 2, axis=0) * FPS**2  # [m/s^2]; the player's reach 18
    assert np.abs(rest).max() < 0.5
    assert np.ptp(found[1][:, 2]) == 0.0


@pytest.mark.parametrize("turn", [0.0, 2.0, -2.8])
def test_it_stands_where_the_face_is_seen(dribble_take, tmp_path, turn):
    take = along(dribble_take, np.full((36, 2), 5.0), np.full(36, turn))
    eye = eyes(write_take(tmp_path / "take.usdc", take), 1)[0]
    ahead = Rotation.from_euler("z", turn).apply([1.0, 0.0, 0.0])
    away = (eye - [5.0, 5.0, 0.0])[:2]
    assert away @ ahead[:2] > 0.7 * np.linalg.norm(away)


def test_one_frame_is_enough(dribble_take, tmp_path):
    take = along(dribble_take, np.zeros((1, 2)), np.zeros(1))
    path = write_take(tmp_path / "take.usdc", take)
    seen = projected(path, take.body_q[0, :, :3], 0)
    assert np.abs(seen).max() < 0.6


def test_several_worlds_are_all_in_view(dribble_take, tmp_path):
    worlds = np.stack([dribble_take.body_q] * 9)
    path = write_take(tmp_path / "take.usdc", Take.of(dribble_take.model, worlds, FPS))
    corners = np.array([[x, y, z] for x in (-3, 0, 3) for y in (-3, 0, 3) for z in (0.0, 1.8)], float)
    assert np.abs(projected(path, corners, 0)).max() < 1.0
