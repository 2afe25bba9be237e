"""How a simulated run went, in three panels: where the player walked, and how far it was off over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .sheet import INK, RIGHT_COLOUR, save
from .take import check_writable

REFERENCE_COLOUR = "#b0b7bf"
FALL_COLOUR = "#c0392b"


def write_plots(
    path: str | Path,
    fps: float,
    root: np.ndarray,
    wanted_root: np.ndarray,
    angle_error: np.ndarray,
    position_error: np.ndarray,
    fallen: np.ndarray | None = None,
    title: str = "",
) -> Path:
    """Draw the root's path and the tracking errors as PNG; the file appears whole or not at all.

    root, wanted_root: (frames, 3) [m]; angle_error (frames,) [rad]; position_error (frames,) [m]; fallen
    (frames,) bool. Raises TakeError.
    """
    path = check_writable(path, (".png",))
    figure = Figure(figsize=(14.0, 5.0), dpi=110, facecolor="white", layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=[1.0, 1.7])
    _draw_path(figure.add_subplot(grid[:, 0]), root, wanted_root)
    times = np.arange(len(root)) / fps
    upper, lower = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    _draw_error(upper, times, np.degrees(angle_error), "joints off [deg]", fallen)
    _draw_error(lower, times, 100.0 * position_error, "bodies off [cm]", fallen)
    upper.tick_params(labelbottom=False)
    lower.set_xlabel("time [s]", color=INK)
    return save(figure, title, path)


def _draw_path(axes: Axes, root: np.ndarray, wanted: np.ndarray) -> None:
    """Seen from above; never less than half a metre across, so that standing looks like standing."""
    axes.plot(*wanted[:, :2].T, color=REFERENCE_COLOUR, linewidth=3.0, label="reference")
    axes.plot(*root[:, :2].T, color=RIGHT_COLOUR, linewidth=1.4, label="simulated")
    axes.plot(*root[0, :2], "o", color=INK, markersize=5, label="start")
    both = np.concatenate([root[:, :2], wanted[:, :2]])
    middle = 0.5 * (both.min(axis=0) + both.max(axis=0))
    half = max(0.25, 0.55 * float(np.ptp(both, axis=0).max()))
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    axes.set_xlabel("root x [m]", color=INK)
    axes.set_ylabel("root y [m]", color=INK)
    axes.legend(frameon=False, fontsize=9, loc="upper right")
    _plain(axes)


def _draw_error(
    axes: Axes, times: np.ndarray, error: np.ndarray, label: str, fallen: np.ndarray | None
) -> None:
    axes.plot(times, error, color=RIGHT_COLOUR, linewidth=1.3)
    mean = float(np.mean(error))
    axes.axhline(mean, color=REFERENCE_COLOUR, linewidth=1.0, zorder=0)
    axes.text(
        1.0,
        1.0,
        f"mean {mean:.2f}, worst {np.max(error):.2f}",
        transform=axes.transAxes,
        ha="right",
        va="bottom",
        fontsize=9,
        color=INK,
    )
    if fallen is not None and np.any(fallen):
        axes.fill_between(
            times,
            0.0,
            1.0,
            where=fallen,
            transform=axes.get_xaxis_transform(),
            color=FALL_COLOUR,
            alpha=0.15,
            linewidth=0.0,
        )
        axes.text(
            times[int(np.argmax(fallen))],
            0.02,
            " down",
            transform=axes.get_xaxis_transform(),
            color=FALL_COLOUR,
            fontsize=9,
        )
    axes.set_ylabel(label, color=INK)
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(times[0], max(times[-1], 1e-3))
    _plain(axes)


def _plain(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=INK)
