"""A contact sheet: what a take looks like at a glance, poses above and heights and contacts
below."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..sims.files import whole
from ..sims.signals import runs
from .film import Camera
from .take import Take, TakeError, check_writable

POSES = 8
SIZE = (216, 360)
"""Pixels of a pose."""
INK = "#30363d"
BALL_COLOUR, RIGHT_COLOUR, LEFT_COLOUR = "#d9662b", "#1f6fb4", "#5a9367"


def write_sheet(
    path: str | Path,
    take: Take,
    hands: dict[str, np.ndarray],
    contacts: dict[str, np.ndarray],
    title: str = "",
    skin: bool = False,
) -> Path:
    """Draw a take of one world as PNG; the file appears whole or not at all. Raises TakeError.

    hands: name -> height (frames,) [m], drawn beside the ball's; contacts: name -> (frames,) bool,
    one strip each. skin: the player as one smooth body.
    """
    path = check_writable(path, (".png",))
    figure = Figure(figsize=(14.0, 7.2), dpi=110, facecolor="white", layout="constrained")
    poses, heights, strips = figure.subplots(
        3, 1, height_ratios=[4.4, 2.6, 0.25 + 0.2 * max(1, len(contacts))]
    )
    times = np.arange(len(take.body_q)) / take.fps
    frames = np.linspace(0, len(times) - 1, POSES).round().astype(int)
    _draw_poses(poses, take, frames, times, skin)
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


def _draw_poses(axes: Axes, take: Take, frames: np.ndarray, times: np.ndarray, skin: bool) -> None:
    """Pictures side by side."""
    seen = Camera(take, SIZE, skin=skin)
    width, height = SIZE
    for number, frame in enumerate(frames):
        axes.imshow(seen.picture(frame), extent=(number * width, (number + 1) * width, 0, height))
        middle = (number + 0.5) * width
        axes.text(middle, -0.03 * height, f"{times[frame]:.2f} s", ha="center", va="top", color=INK)
    axes.set_xlim(0, len(frames) * width)
    axes.set_ylim(-0.1 * height, height)
    axes.axis("off")


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
