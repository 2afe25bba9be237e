"""Learning curves of the stage ddpg, as Liu and Hodgins 2018 draw them (Fig. 12, 13).

    python -m warpdribble.reports.curves RUN [RUN ...] docs/pictures/ddpg-curves.png

A point is how often the ball was lost in 10 000 transitions; runs that began without a linear policy are
dashed.
"""

from __future__ import annotations

import sys
from pathlib import Path

from ..learning.methods import STAGES
from ..learning.runs.folder import Run
from ..learning.runs.log import read_rows

STAGE = STAGES["ddpg"]


def draw(runs: list[Path], out: Path) -> None:
    """A line for each run."""
    from matplotlib.figure import Figure

    from ..takes.sheet import save

    figure = Figure(figsize=(7.0, 3.6), dpi=110, layout="constrained")
    ax = figure.subplots()
    for path in runs:
        run = Run.load(path)
        folder = run.stage(STAGE)
        config, rows = folder.config(), read_rows(folder.path)
        x = [row["transitions"] / 1e6 for row in rows]
        usual = config.begin == "linear"
        name = run.info["skill"]["name"] + ("" if usual else f", begun with {config.begin}")
        ax.plot(x, [row["terminal"] for row in rows], "-" if usual else "--", lw=1, label=name)
    ax.axhline(config.few, color="0.7", lw=0.8)
    ax.set_yscale("symlog", linthresh=10.0)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("transitions [million], those of the linear policy included")
    ax.set_ylabel("terminal states in 10 000")
    ax.grid(alpha=0.3)
    ax.legend(fontsize=7)
    save(figure, "DDPG: how often the ball is lost while it is learned", out)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit("usage: python -m warpdribble.reports.curves RUN [RUN ...] OUT.png")
    draw([Path(name) for name in sys.argv[1:-1]], Path(sys.argv[-1]))
