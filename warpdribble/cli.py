"""The command line: `warpdribble simulate`, `warpdribble demo`, `warpdribble bench`.

Whatever is wrong with the input ends in one line on stderr that says what to do, and exit status 2.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import OmitSubcommandPrefixes, Positional, subcommand


@dataclass
class Simulate:
    """Let a simulated player follow a recorded clip; write a USD take and a picture."""

    clip: Positional[Path]
    """Recorded clip, a .bvh file."""
    frames: tuple[int, int] = (0, -1)
    """First and last frame of the part to use, counted from 0; -1 is the clip's last."""
    repeat: int = 1
    """How many times in a row; the ends are made to meet."""
    root: Literal["free", "tracked"] = "free"
    """free: only the joints are driven. tracked: virtual forces hold the pelvis to the clip too."""
    out: Path = Path("out/take.usdc")
    """The take: .usda, .usdc or .usdz. The picture goes beside it, as .png."""
    model: str = "player"
    """The player, or the path of an MJCF file with the same body names."""
    device: str = "cpu"
    """Where to simulate: cpu, cuda:0, ..."""


@dataclass
class Demo:
    """Simulate a dribble that comes with warpdribble; needs no data."""

    repeat: int = 5
    """How many dribbles."""
    root: Literal["free", "tracked"] = "free"
    """free: only the joints are driven. tracked: virtual forces hold the pelvis too."""
    out: Path = Path("out/demo.usdc")
    """The take: .usda, .usdc or .usdz. The picture goes beside it, as .png."""
    device: str = "cpu"
    """Where to simulate: cpu, cuda:0, ..."""


ABOUT = "Recorded motion becomes a simulated basketball player. Also: warpdribble bench."
LONGEST = 600.0
"""[s] of one take."""
SHORT = 60.0
"""[s] up to which several starts of the ball are tried: all of them are kept in memory."""
COMMANDS = OmitSubcommandPrefixes[
    Annotated[Simulate, subcommand("simulate")] | Annotated[Demo, subcommand("demo")]
]


def main(arguments: list[str] | None = None) -> int:
    """Run a command; the exit status."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    if arguments[:1] == ["bench"]:
        return _bench(arguments[1:])
    try:
        return _run(_parse(arguments))
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 2
    except (ValueError, OSError) as error:
        return _complain(" ".join(str(error).split()))
    except FloatingPointError as error:
        _complain(str(error))
        return 1
    except KeyboardInterrupt:
        _complain("stopped")
        return 130


def _parse(arguments: list[str]) -> Simulate | Demo:
    """The command asked for; a mistake becomes one line. Raises SystemExit."""
    if {"-h", "--help"} & set(arguments):
        return tyro.cli(COMMANDS, args=arguments, prog="warpdribble", description=ABOUT)
    box, width = io.StringIO(), os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = "400"
    try:
        with contextlib.redirect_stderr(box):
            return tyro.cli(COMMANDS, args=arguments, prog="warpdribble", description=ABOUT)
    except SystemExit:
        _complain(_first_sentence(box.getvalue()) + " (see warpdribble --help)")
        raise
    finally:
        del os.environ["COLUMNS"]
        if width is not None:
            os.environ["COLUMNS"] = width


def _first_sentence(box: str) -> str:
    """What a framed message of tyro says before its first rule, as one line."""
    said = []
    for line in box.splitlines()[1:]:
        text = line.strip("│ ╭╮╰╯")
        if not text or set(text) == {"─"}:
            break
        said.append(text)
    return " ".join(" ".join(said).split()).rstrip(".") or "the command could not be understood"


def _complain(message: str) -> int:
    print(f"warpdribble: {message}", file=sys.stderr)
    return 2


def _bench(arguments: list[str]) -> int:
    from importlib import import_module

    try:
        bench = import_module(".benchmarks.command", __package__)
    except ModuleNotFoundError:
        return _complain("the benchmarks are not installed")
    return bench.main(arguments) or 0


def _run(command: Simulate | Demo) -> int:
    if command.repeat < 1:
        raise ValueError(f"--repeat {command.repeat}: give a number of 1 or more")
    if not re.fullmatch(r"cpu|cuda(:\d+)?", command.device):
        raise ValueError(f"--device {command.device}: give cpu, cuda or cuda:0, cuda:1, ...")
    import warp

    warp.config.log_level = warp.LOG_ERROR
    from .sims import Model
    from .take import check_writable

    check_writable(command.out)
    check_writable(command.out.with_suffix(".png"), (".png",))
    if isinstance(command, Demo):
        return _demo(command, Model.load("player"))
    return _simulate(command, Model.load(command.model))


def _demo(command: Demo, model) -> int:
    from .author import dribble_right
    from .sims.reference import Cycle
    from .simulate import ball_in_reference

    clip = dribble_right(model)
    _check_length(clip.reference, command.repeat)
    reference = Cycle(clip.reference).repeat(model, command.repeat)
    ball = ball_in_reference(model, reference)
    say(f"clip      authored dribble, right hand, {clip.reference.duration:.2f} s a cycle")
    _finish(command, model, reference, ball, "authored dribble")
    say(
        "next      open the take in Blender (or any USD viewer), or let the player follow your own "
        "clip:\n          warpdribble simulate CLIP.bvh --repeat 10"
    )
    return 0


def _simulate(command: Simulate, model) -> int:
    from .sims.reference import close_cycle
    from .simulate import ball_from_hand, dribbling_hand, load_clip

    reference, notes = load_clip(model, command.clip, command.frames)
    _check_length(reference, command.repeat)
    first, last = command.frames
    part = f"frames {first} to {'the last' if last < 0 else last}"
    say(f"clip      {command.clip}, {part}, {reference.duration:.2f} s")
    for note in notes:
        say(f"          {note}")
    if command.repeat > 1:
        cycle = close_cycle(model, reference)
        reference = cycle.repeat(model, command.repeat)
        say(f"          its ends are {57.3 * cycle.gap:.1f} degrees per joint apart: blended")
    ball = None
    if "ball" in model.body_names:
        ball = ball_from_hand(model, reference, dribbling_hand(model, reference))
    _finish(command, model, reference, ball, f"{command.clip.name}, {part}")
    return 0


def _check_length(reference, repeat: int) -> None:
    """Raise ValueError where a take would not fit into memory."""
    most = max(1, int(LONGEST / reference.duration))
    if repeat > most:
        raise ValueError(f"--repeat {repeat}: at most {most} for this clip ({LONGEST:.0f} s)")


def _finish(command: Simulate | Demo, model, reference, ball, source: str) -> None:
    """Simulate, say how it went, and write the take and its picture."""
    from . import __version__
    from .sheet import write_sheet
    from .simulate import TRIES, simulate
    from .take import Take, validate, write_take

    tries = TRIES if ball is not None and reference.duration < SHORT else 1
    sim = _ready(model, tries, command.device)
    with _bar(f"simulating {reference.duration:.1f} s", reference.frame_count) as progress:
        run = simulate(sim, reference, command.root, ball, progress)
    _summary(run, command)
    take = Take(
        body_names=list(model.body_names),
        shapes=model.shapes,
        body_q=run.body_q,
        fps=1.0 / model.timestep,
        notes={"creator": f"warpdribble {__version__}", "clip": source, "root": command.root},
    )
    heights = {
        label: run.body_q[:, model.body(body), 2]
        for label, body in (("right hand", "r_hand"), ("left hand", "l_hand"))
        if body in model.body_names
    }
    picture = command.out.with_suffix(".png")
    write_take(command.out, take)
    write_sheet(picture, take, heights, run.contacts, f"{source}, root {command.root}")
    errors = validate(command.out)
    state = "valid USD" if not errors else f"USD validation: {'; '.join(errors)}"
    say(f"take      {command.out} ({len(take.body_q)} frames at {take.fps:g} fps, {state})")
    say(f"picture   {picture}")


def _summary(run, command) -> None:
    import numpy as np

    fell = f", first at {run.fallen.argmax() * run.reference.timestep:.2f} s" if run.falls else ""
    say(
        f"simulated {run.reference.duration:.2f} s with root {command.root}, "
        f"{run.real_time_factor:.1f} x real time"
    )
    say(
        f"tracking  joints {np.degrees(run.angle_error.mean()):.1f} degrees, "
        f"bodies {100.0 * run.position_error.mean():.1f} cm off (means, fingers left out)"
    )
    say(f"falls     {run.falls}{fell}")
    if "ball on ground" in run.contacts:
        ground = run.contacts["ball on ground"]
        bounces = int(np.sum(ground[1:] & ~ground[:-1]))
        say(f"ball      {bounces} bounces (put in play, not yet controlled)")


def say(line: str) -> None:
    """A line of the report, at once even through a pipe."""
    print(line, flush=True)


def _ready(model, worlds: int, device: str):
    """A simulation that has compiled what it needs; the wait is shown."""
    from rich.console import Console

    from .sims import Simulation

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
def _bar(label: str, total: int):
    """Progress of a long job on stderr: yields what to call with the steps done."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(label, total=total)
        yield lambda done: bar.update(task, completed=done)
