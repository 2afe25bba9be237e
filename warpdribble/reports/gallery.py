"""The loops of docs/gallery.md, and strips of eight moments of a cycle: what ships, and runs, at work.

    python -m warpdribble.reports.gallery docs/pictures [RUN ...]

writes a short film of each controller that ships, of the demo's player pushed, and of each run, as
loop-NAME.webp: whole cycles, so that they go on without a jump, as far as the motion does; and
strip-NAME.png.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from ..learning import Run, Streams
from ..learning.evaluate.pushes import PUSH_TIME, Push
from ..learning.evaluate.record import record
from ..learning.graph import STEPS
from ..learning.methods import STAGES
from ..learning.runs.folder import shipped_controllers
from ..sims.trajectory import centred
from ..takes.film import Camera, write_film
from ..takes.take import Take

SECONDS = 3.0
"""About so long is a loop."""
SETTLED = 40
"""Fragments before it begins."""
SIZE = (300, 400)
MOMENTS, MOMENT = 8, (150, 240)
PUSHED, PUSH = "dribble-right-authored", 100.0
"""Who is pushed, and how much [N]."""


@dataclass(frozen=True)
class Loop:
    """A film to make."""

    name: str
    run: str
    push: float = 0.0
    """[N] forward, soon after it begins"""


def write_loop(loop: Loop, folder: Path) -> Path:
    """Write it into a folder, and say where it is."""
    one = Run.load(loop.run).learned(STAGES)
    task, cycle = one.task(1), one.graph.cycle
    start = one.starts.draw(Streams([np.random.default_rng(0)]))
    cycles = max(1, round(SECONDS / (cycle * one.graph.period))) * (2 if loop.push else 1)
    lead = SETTLED + int(-(start.k[0] + SETTLED) % cycle)
    push = Push(loop.push, np.array([lead + cycle]), max(1, round(PUSH_TIME / one.graph.period)), 1)
    seen = record(task, one.controller, start, lead + cycles * cycle, disturber=push)[0]
    seen = centred(task.model, seen)
    take = Take.of(task.model, seen.body_q.astype(float), 1.0 / task.model.timestep)
    path = folder / f"loop-{loop.name}.webp"
    write_film(path, take, first=STEPS * lead, count=STEPS * cycles * cycle, size=SIZE)
    if not loop.push:
        frames = STEPS * lead + np.arange(MOMENTS) * STEPS * cycle // MOMENTS
        strip(take, frames).save(folder / f"strip-{loop.name}.png", optimize=True)
    return path


def strip(take: Take, frames: np.ndarray) -> Image.Image:
    """Pictures of frames side by side."""
    seen = Camera(take, MOMENT, samples=3)
    whole = Image.new("RGB", (len(frames) * MOMENT[0], MOMENT[1]))
    for number, frame in enumerate(frames):
        whole.paste(seen.picture(int(frame)), (number * MOMENT[0], 0))
    return whole


def main(folder: Path, runs: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    loops = [Loop(name, name) for name in shipped_controllers()]
    loops += [Loop("pushed", PUSHED, PUSH), *(Loop(Path(run).name, run) for run in runs)]
    for loop in loops:
        path = write_loop(loop, folder)
        print(f"{path} ({path.stat().st_size / 1e6:.2f} MB)", flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit("usage: python -m warpdribble.reports.gallery FOLDER [RUN ...]")
    main(Path(sys.argv[1]), sys.argv[2:])
