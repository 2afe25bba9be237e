"""What a command says, and how it passes the time."""

from __future__ import annotations

import contextlib
import functools
import math
import os
import re
import select
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TextIO, TypeVar

if TYPE_CHECKING:
    from ..learning.tasks.follow import Follow


Task = TypeVar("Task", bound="Follow")


class Progress(Protocol):
    """What a long job calls with the steps done, and a note to show."""

    def __call__(self, done: int, note: str = "", total: int | None = None) -> None: ...


def say(line: str) -> None:
    """A line of the report, at once even through a pipe."""
    print(line, flush=True)


def hang_up() -> bool:
    """Whether nobody reads stdout or stderr any more; what is still to be written to either goes nowhere."""
    gone = [stream for stream in (sys.stdout, sys.stderr) if _unread(stream)]
    for stream in gone:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
    return bool(gone)


def _unread(stream: TextIO) -> bool:
    """Whether a stream is a pipe whose other end is closed."""
    try:
        watch = select.poll()
        watch.register(stream.fileno(), 0)
    except (AttributeError, OSError, ValueError):  # no such thing here, or no file behind the stream
        return False
    return any(event & select.POLLERR for _, event in watch.poll(0))


@contextlib.contextmanager
def compiling() -> Iterator[None]:
    """Show, on stderr, where kernels are compiled meanwhile; nothing where they are cached."""
    from rich.console import Console

    from ..sims.worlds.batch import telling

    waiting = "compiling kernels (once; about a minute, then they are cached) ..."
    console, shown = Console(stderr=True), contextlib.ExitStack()
    told = False

    def tell() -> None:
        nonlocal told
        if not told and console.is_terminal:
            shown.enter_context(console.status(waiting))
        elif not told:
            print(waiting, file=sys.stderr, flush=True)
        told = True

    with shown, telling(tell):
        yield


def warmed(task: Task) -> Task:
    """A task that has compiled what it needs."""
    import numpy as np

    from ..learning import Ahead, OpenLoop, Rollout, Streams, reference_starts

    starts = reference_starts(task.graph).draw(Streams([np.random.default_rng(0)], task.worlds))
    rollout = Rollout(task, OpenLoop(task.actions), Ahead(), starts)
    for _ in rollout.fragments(1):
        rollout.become(np.arange(task.worlds))
    task.sim.bodies()
    return task


@contextlib.contextmanager
def bar(label: str, total: int) -> Iterator[Progress]:
    """Progress of a long job on stderr: yields what to call with the steps done, and a note to show."""
    from rich.console import Console
    from rich.progress import Progress as Bars

    console = Console(stderr=True)
    with Bars(console=console, transient=True, disable=not console.is_terminal) as bars:
        task = bars.add_task(label, total=total)
        yield lambda done, note="", total=None: bars.update(
            task, completed=done, description=f"{label}{note}", total=total
        )


NO_DRIVER = "NVIDIA CUDA driver"
"""Of what Warp says on a machine without one."""


def quiet_warp() -> None:
    """Let Warp report errors only. That there is no CUDA driver is said where there is a card to drive."""
    import warp

    warp.config.log_level = warp.LOG_ERROR
    warp_begins()


@functools.cache
def warp_begins() -> str:
    """Begin Warp, once; what it says of CUDA, "" for nothing."""
    import warp

    said = _on_stderr(warp.init)
    for line in said.splitlines():
        if NO_DRIVER not in line or _has_card():
            print(line, file=sys.stderr, flush=True)
    return " ".join(re.sub(r"Warp CUDA \w+: ", "", said).split())


def _on_stderr(job: Callable[[], object]) -> str:
    """What native code writes to stderr while a job is done."""
    try:
        kept = os.dup(2)
    except OSError:  # closed
        job()
        return ""
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            job()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
        file.seek(0)
        return file.read().decode(errors="replace")


def _has_card() -> bool:
    """Whether a card of NVIDIA's is on the PCI bus, where Linux lists that."""
    for vendor in Path("/sys/bus/pci/devices").glob("*/vendor"):
        with contextlib.suppress(OSError):
            display = vendor.with_name("class").read_text().startswith("0x03")
            if display and vendor.read_text().strip() == "0x10de":
                return True
    return False


def check_device(device: str) -> None:
    """Raise ValueError for what is no device's name."""
    if not re.fullmatch(r"cpu|cuda(:\d+)?", device):
        raise ValueError(f"--device {device}: give cpu, cuda or cuda:0, cuda:1, ...")


def find_device(device: str) -> None:
    """Raise ValueError for a device that is not there. Silences Warp."""
    from ..sims.worlds import batch

    check_device(device)
    quiet_warp()
    try:
        batch.find_device(device)
    except ValueError as error:
        said = warp_begins()
        raise ValueError(f"--device {device}: {error}{said and f' ({said})'}") from None


def check_range(option: str, value: float, least: float, most: float) -> None:
    """Raise ValueError for a number outside a range, or none."""
    if not least <= value <= most:
        raise ValueError(f"{option} {value:g}: give a number from {least:g} to {most:g}")


def check_new(paths: Iterable[Path], overwrite: bool) -> None:
    """Raise ValueError for files that are there, and would be lost, unless they may be."""
    there = [path for path in paths if path.exists()]
    if there and not overwrite:
        more = f", and {len(there) - 1} more" if len(there) > 1 else ""
        raise ValueError(
            f"{there[0]}: is there already{more}; give another name, or --overwrite to replace it"
        )


def without_nan(value: Any) -> Any:
    """For JSON, which has no NaN: null in its place, all the way down."""
    if isinstance(value, dict):
        return {key: without_nan(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [without_nan(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
