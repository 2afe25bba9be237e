"""A take's camera: one player is followed, several worlds are all in view."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pxr import Gf, Usd, UsdGeom
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from ..sims.planar import heading
from ..skin.meshes import shape_mesh
from . import figure

if TYPE_CHECKING:
    from .take import Take

PATH = "/World/Camera"
FOCAL, WIDTH, HEIGHT = 35.0, 36.0, 20.25
"""[mm] lens and film: 16 to 9."""
BACK = (0.80, -0.55, 0.25)
"""Towards the camera from what it sees; of a player, as it faces when the take begins."""
FILLS = 0.5
"""Share of the frame's height that the player takes up."""
STEADY = 0.5
"""[Hz] The camera takes no part in what moves faster: steps, sway, the ball's rhythm."""
MOST = 0.95
"""Share of the time for which the frame is wide enough, where a player stands up or crouches."""
SIDES = 0.9
"""Share of a picture's width that a player may take up, who is wider than tall."""
EVERY = 3
"""Of a shape's points one in so many is looked at."""
LOOKS = 40
"""Frames whose player is measured."""


def add(stage: Usd.Stage, take: Take, edit: dict[str, Usd.EditTarget], places: np.ndarray) -> None:
    """The camera of a take whose bodies are drawn at `places` (worlds, frames, bodies, 3 or more) [m]."""
    player = [b for b, name in enumerate(take.body_names) if name != take.ball]
    if len(places) == 1 and player:
        poses, distance = following(take, player)
    else:
        poses, distance = seeing_all(places[..., :3].reshape(-1, 3))
    camera = UsdGeom.Camera.Define(stage, PATH)
    camera.CreateFocalLengthAttr(FOCAL)
    camera.CreateHorizontalApertureAttr(WIDTH)
    camera.CreateVerticalApertureAttr(HEIGHT)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.05, 200.0))
    camera.CreateFocusDistanceAttr(distance)
    figure.animate(edit["animation"].GetLayer(), poses[:, None], [PATH])


def following(
    take: Take,
    player: list[int],
    back: tuple[float, float, float] = BACK,
    fills: float = FILLS,
    aspect: float = WIDTH / HEIGHT,
) -> tuple[np.ndarray, float]:
    """Poses (frames, 7) of a camera that goes along with the player's bodies, without their haste, and how
    far [m] it stays away. back, fills: as BACK and FILLS; farther for who is wider than tall. aspect: of the
    picture, its width by its height."""
    body_q = np.asarray(take.worlds[0], float)
    way = _smooth(body_q[:, player[0], :2], take.fps)
    turn = _toward(Rotation.from_rotvec([0.0, 0.0, heading(body_q[0, player[0], 3:])]).apply(back))
    frames = np.unique(np.linspace(0, len(body_q) - 1, LOOKS).round().astype(int))
    points = _surface(take, player, body_q[frames]) - np.pad(way[frames], ((0, 0), (0, 1)))[:, None]
    low, high = points[..., 2].min(axis=1), points[..., 2].max(axis=1)
    bottom, top = float(np.quantile(low, 1.0 - MOST)), float(np.quantile(high, MOST))
    middle, taller = 0.5 * (bottom + top), (top - bottom) / float(np.median(high - low))
    seen = (points - [0.0, 0.0, middle]) @ turn.as_matrix()
    distance = 4.0
    for _ in range(6):
        columns, rows, _ = np.moveaxis(seen / np.maximum(distance - seen[..., 2:], 0.1), -1, 0)
        high = taller * float(np.median(np.ptp(rows, axis=1)))
        wide = float(np.quantile(2.0 * np.abs(columns).max(axis=1), MOST))
        distance *= max(high / fills, wide / (aspect * SIDES)) * FOCAL / HEIGHT
    eyes = np.concatenate([way, np.full((len(way), 1), middle)], axis=1) + distance * turn.as_matrix()[:, 2]
    return np.concatenate([eyes, np.tile(turn.as_quat(), (len(eyes), 1))], axis=1), distance


def seeing_all(points: np.ndarray) -> tuple[np.ndarray, float]:
    """One pose (1, 7) of a camera with all points (n, 3) [m] in view, and how far [m] they are."""
    low, high = points.min(axis=0), points.max(axis=0)
    distance = 3.6 + 1.1 * float(np.linalg.norm((high - low)[:2]))
    turn = _toward(np.array(BACK))
    centre = np.array([*(0.5 * (low + high))[:2], 0.9])
    return np.concatenate([centre + distance * turn.as_matrix()[:, 2], turn.as_quat()])[None], distance


def _smooth(way: np.ndarray, fps: float) -> np.ndarray:
    """A way (frames, 2) [m] without what is quick. It is taken on beyond its ends, turned about them, so that
    the filter neither begins nor ends at rest."""
    more = min(len(way) - 1, round(fps / STEADY))
    longer = np.pad(way, ((more, more), (0, 0)), mode="reflect", reflect_type="odd")
    spread = np.sqrt(2.0 * np.log(2.0)) / (2.0 * np.pi * STEADY) * fps  # half of what moves at STEADY is left
    return np.asarray(gaussian_filter1d(longer, spread, axis=0)[more : more + len(way)])


def _toward(back: np.ndarray) -> Rotation:
    """How a camera is turned that looks along -`back`, upright."""
    back = back / np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    return Rotation.from_matrix(np.stack([right, np.cross(back, right), back], axis=1))


def _surface(take: Take, bodies: list[int], body_q: np.ndarray) -> np.ndarray:
    """Points (frames, n, 3) [m] of the shapes of some bodies in body_q (frames, nbody, 7); their places where
    there are none."""
    points = [body_q[:, bodies, :3]]
    for shape in take.shapes:
        if shape.body in bodies and shape.kind != "plane":
            turn = Rotation.from_quat(body_q[:, shape.body, 3:]).as_matrix()
            own = np.asarray(shape_mesh(shape).points)[::EVERY]
            points.append(own @ turn.transpose(0, 2, 1) + body_q[:, shape.body, None, :3])
    return np.concatenate(points, axis=1)
