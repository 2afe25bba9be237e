"""What a command says, and how it passes the time."""

from __future__ import annotations

import contextlib
import re
import sys


def say(line: str) -> None:
    """A line of the report, at once even through a pipe."""
    print(line, flush=True)


def ready(model, worlds: int, device: str):
    """A simulation that has compiled what it needs; the wait is shown."""
    from rich.console import Console

    from ..sims import Simulation

    waiting = "compiling kernels (once; about a minute the first time, then cached) ..."
    console = Console(stderr=True)
    if not console.is_terminal:
        print(waiting, file=sys.stderr, flush=True)
    with console.status(waiting):
        sim = Simulation(model, world_count=worlds, device=device)
        sim.step(1)
        sim.reset()
    return sim


@contextlib.contextmanager
def bar(label: str, total: int):
    """Progress of a long job on stderr: yields what to call with the steps done."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(label, total=total)
        yield lambda done: bar.update(task, completed=done)


def quiet_warp() -> None:
    """Let Warp report errors only."""
    import warp

    warp.config.log_level = warp.LOG_ERROR


def check_device(device: str) -> None:
    """Raise ValueError for what is no device's name."""
    if not re.fullmatch(r"cpu|cuda(:\d+)?", device):
        raise ValueError(f"--device {device}: give cpu, cuda or cuda:0, cuda:1, ...")
