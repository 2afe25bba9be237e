"""A contact sheet: what a take looks like at a glance, poses above and heights and contacts
below."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from ..sims.files import whole
from ..sims.model import Shape
from ..sims.signals import runs
from .take import Take, TakeError, check_writable

POSES = 8
SPACING = 1.05
"""[m] between neighbouring poses."""
VIEW = (-50.0, 0.0)
"""[deg] where the viewer stands: about the vertical from +X, and above the horizon."""
Outline = tuple[np.ndarray, float] | np.ndarray
"""Centre (2,) and radius, or points (n, 2) [m]."""
INK = "#30363d"
BALL_COLOUR, RIGHT_COLOUR, LEFT_COLOUR = "#d9662b", "#1f6fb4", "#5a9367"


def write_sheet(
    path: str | Path,
    take: Take,
    hands: dict[str, np.ndarray],
    contacts: dict[str, np.ndarray],
    title: str = "",
) -> Path:
    """Draw a take as PNG; the file appears whole or not at all. Raises TakeError.

    hands: name -> height (frames,) [m], drawn beside the ball's; contacts: name -> (frames,) bool,
    one strip each.
    """
    path = check_writable(path, (".png",))
    figure = Figure(figsize=(14.0, 7.2), dpi=110, facecolor="white", layout="constrained")
    poses, heights, strips = figure.subplots(
        3, 1, height_ratios=[4.4, 2.6, 0.25 + 0.2 * max(1, len(contacts))]
    )
    times = np.arange(len(take.body_q)) / take.fps
    frames = np.linspace(0, len(times) - 1, POSES).round().astype(int)
    _draw_poses(poses, take, frames, times)
    _draw_heights(heights, take, hands, times, frames)
    _draw_strips(strips, contacts, times)
    heights.sharex(strips)
    return save(figure, title, path)


def save(figure: Figure, title: str, path: Path) -> Path:
    """Write a figure under its title; the file appears whole or not at all. Raises TakeError."""
    figure.suptitle(title, fontsize=12, color=INK, x=0.01, ha="left")
    try:
        with whole(path) as part:
            figure.savefig(part)
    except OSError as error:
        raise TakeError(path, f"cannot be written: {error.strerror or error}") from None
    return path


def _draw_poses(axes: Axes, take: Take, frames: np.ndarray, times: np.ndarray) -> None:
    """Poses side by side, each seen from the same direction, far shapes first and paler."""
    turn = np.radians(VIEW)
    right = np.array([-np.sin(turn[0]), np.cos(turn[0]), 0.0])
    toward = np.array([np.cos(turn[0]) * np.cos(turn[1]), np.sin(turn[0]) * np.cos(turn[1]), np.sin(turn[1])])
    screen = np.stack([right, np.cross(toward, right), toward])
    axes.axhline(0.0, color="#b9a184", linewidth=1.2, zorder=0)
    for number, frame in enumerate(frames):
        body_q = take.body_q[frame]
        player = [i for i, name in enumerate(take.body_names) if name != take.ball]
        middle = body_q[player[0], :3] * [1.0, 1.0, 0.0] if player else np.zeros(3)
        drawn = [
            _outline(shape, body_q, screen, middle)
            for shape in take.shapes
            if shape.body >= 0 and shape.kind != "plane"
        ]
        drawn.sort(key=lambda d: d[0])
        patches, colours = [], []
        for depth, outline, rgba in drawn:
            paler = np.clip(0.05 - depth, 0.0, 0.4)
            patches.append(_patch(outline, number * SPACING))
            colours.append((1.0 - paler) * np.asarray(rgba[:3]) + paler)
        axes.add_collection(
            PatchCollection(patches, facecolor=colours, edgecolor=INK, linewidth=0.35, zorder=2)
        )
        axes.text(number * SPACING, -0.28, f"{times[frame]:.2f} s", ha="center", fontsize=10, color=INK)
    axes.set_xlim(-0.6 * SPACING, (len(frames) - 0.25) * SPACING)
    axes.set_ylim(-0.36, 1.9)
    axes.set_aspect("equal")
    axes.axis("off")


def _outline(
    shape: Shape, body_q: np.ndarray, screen: np.ndarray, middle: np.ndarray
) -> tuple[float, Outline, np.ndarray]:
    """Depth, outline and colour of a shape as the viewer sees it."""
    body = Rotation.from_quat(body_q[shape.body, 3:])
    turn = body * Rotation.from_quat(shape.quat)
    centre = body_q[shape.body, :3] + body.apply(shape.pos) - middle
    seen = screen @ centre
    if shape.kind == "sphere":
        return seen[2], (seen[:2], shape.size[0]), shape.rgba
    if shape.kind == "capsule":
        axis = (screen @ turn.apply([0.0, 0.0, shape.size[1]]))[:2]
        ring = np.linspace(0.0, 2.0 * np.pi, 25)
        circle = shape.size[0] * np.stack([np.cos(ring), np.sin(ring)], axis=1)
        points = np.concatenate([circle + axis, circle - axis]) + seen[:2]
    else:
        signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        points = (turn.apply(signs * shape.size[:3]) + centre) @ screen[:2].T
    return seen[2], points[ConvexHull(points).vertices], shape.rgba


def _patch(outline: Outline, shift: float) -> Patch:
    aside = np.array([shift, 0.0])
    if isinstance(outline, tuple):
        centre, radius = outline
        return Circle(centre + aside, radius)
    return Polygon(outline + aside)


def _draw_heights(
    axes: Axes, take: Take, hands: dict[str, np.ndarray], times: np.ndarray, frames: np.ndarray
) -> None:
    if take.ball in take.body_names:
        ball = take.body_q[:, take.body_names.index(take.ball), 2]
        axes.plot(times, ball, color=BALL_COLOUR, linewidth=1.8, label="ball")
    for name, height in hands.items():
        colour = LEFT_COLOUR if name.startswith("l") else RIGHT_COLOUR
        axes.plot(times, height, color=colour, linewidth=1.4, label=name)
    for frame in frames:
        axes.axvline(times[frame], color="#c9ced4", linewidth=0.8, zorder=0)
    axes.set_ylabel("height of the centre [m]", color=INK)
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelbottom=False, colors=INK)


def _draw_strips(axes: Axes, contacts: dict[str, np.ndarray], times: np.ndarray) -> None:
    """One row per contact, a bar wherever it holds."""
    step = times[1] - times[0] if len(times) > 1 else 1.0
    for row, on in enumerate(contacts.values()):
        bars = [(times[a] - step / 2, (b + 1 - a) * step) for a, b in runs(on)]
        axes.broken_barh(bars, (row - 0.34, 0.68), color=INK)
    axes.set_yticks(range(len(contacts)), list(contacts), fontsize=9)
    axes.set_ylim(len(contacts) - 0.4, -0.6)
    axes.set_xlim(times[0], max(times[-1], step))
    axes.set_xlabel("time [s]", color=INK)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0, colors=INK)
