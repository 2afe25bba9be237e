"""`warpdribble simulate` and `warpdribble demo`: a clip becomes a simulated take."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from .clip_input import ClipInput
from .console import bar, check_device, check_range, compiling, quiet_warp, ready, say, warmed
from .output import Outputs, check_outputs, say_run, write_outputs

LONGEST = 600.0
"""[s] of one take."""
SHORT = 60.0
"""[s] up to which several starts of the ball are tried: all of them are kept in memory."""

LEARNED = "dribble-right-authored"
"""The shipped controller of the demo."""


@dataclass
class Simulate(ClipInput, Outputs):
    """Let a simulated player follow a recorded clip or a skill; write a USD take and a picture.

    In place of a clip: the name of a skill (warpdribble skill list) or a skill's .toml file.
    """

    repeat: int = 1
    """How many times in a row; the ends are made to meet."""
    mapping: str = ""
    """Names of the skeleton's joints: cmu, ballplay, mixamo, lafan, or your own .toml file; told from the
    clip when empty."""
    root: Literal["free", "tracked"] = "free"
    """free: only the joints are driven. tracked: virtual forces hold the pelvis to the clip too."""
    model: str = "player"
    """The player, or the path of an MJCF file with the same body names."""

    def run(self) -> int:
        from ..sims import Model

        _check(self)
        return _simulate(self, Model.load(self.model))


@dataclass
class Demo(Outputs):
    """A player that has learned to stand dribbles, on its own feet; needs no data."""

    repeat: int = 5
    """How many dribbles."""
    push: float = 0.0
    """[N] Largest force of random pushes of 0.2 s on the torso, every 3 s or so."""
    out: Path = Path("out/demo.usdc")
    """The take: .usda, .usdc or .usdz. The pictures (.png) and the replay (.html) go beside it."""

    def run(self) -> int:
        from ..sims import Model

        _check(self)
        check_range("--push", self.push, 0.0, 1e4)
        return _demo(self, Model.load("player"))


def _check(command: Simulate | Demo) -> None:
    """Raise ValueError or OSError for what cannot work, before anything is computed."""
    if command.repeat < 1:
        raise ValueError(f"--repeat {command.repeat}: give a number of 1 or more")
    check_device(command.device)
    quiet_warp()
    check_outputs(command.out)


def _demo(command: Demo, model) -> int:
    import numpy as np

    from ..learning.evaluate.steer import Steered
    from ..learning.graph import cyclic_graph
    from ..learning.runs.folder import Run
    from ..learning.tasks.disturbance import Disturbance
    from ..learning.tasks.locomotion import Locomotion
    from ..sims.authored.dribble import dribble_right
    from ..sims.reference.reference import Cycle
    from ..simulate import TRIES, ball_in_reference

    clip = dribble_right(model)
    _check_length(clip.reference, command.repeat)
    cycle = Cycle(clip.reference)
    reference = cycle.repeat(model, command.repeat)
    ball = ball_in_reference(model, reference)
    say(f"clip      authored dribble, right hand, {clip.reference.duration:.2f} s a cycle, legs learned")
    with compiling():
        task = warmed(Locomotion(model, cyclic_graph(model, cycle), TRIES, command.device))
    start, random = np.zeros(TRIES, int), np.random.default_rng(0)
    pushed = Disturbance(push=command.push)
    legs = Steered(task, Run.load(LEARNED).policy, start, random, pushed)
    _finish(command, task.sim, reference, ball, "authored dribble", "free", legs.step)
    say(
        "next      open the take in Blender (or any USD viewer); push: warpdribble demo --push 300;\n"
        "          let it follow your own clip, warpdribble simulate CLIP.bvh --repeat 10;\n"
        "          or learn one, warpdribble learn SKILL --out RUN"
    )
    return 0


def _simulate(command: Simulate, model) -> int:
    from ..sims.reference.reference import close_cycle
    from ..simulate import ball_from_hand, dribbling_hand, load_clip
    from ..skills.skill import is_skill

    if is_skill(command.clip):
        return _simulate_skill(command, model)
    reference, notes = load_clip(model, mapping=command.mapping, **command.reading())
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
    sim = _sim(command, model, reference, ball)
    _finish(command, sim, reference, ball, f"{command.clip.name}, {part}", command.root)
    return 0


def _simulate_skill(command: Simulate, model) -> int:
    from ..simulate import ball_in_reference
    from ..skills.skill import read_skill
    from ..skills.staged import stage_skill

    one = stage_skill(model, read_skill(command.clip))
    reference = one.reference
    say(f"skill     {one.skill.name}: {one.skill.description}, {reference.duration:.2f} s")
    for note in one.notes:
        say(f"          {note}")
    _check_length(reference, command.repeat)
    if command.repeat > 1:
        if one.cycle is None:
            raise ValueError(f"--repeat {command.repeat}: the skill '{one.skill.name}' is not cyclic")
        reference = one.cycle.repeat(model, command.repeat)
    has_ball = one.ball is not None and "ball" in model.body_names
    ball = ball_in_reference(model, reference) if has_ball else None
    sim = _sim(command, model, reference, ball)
    _finish(command, sim, reference, ball, f"skill {one.skill.name}", command.root)
    return 0


def _check_length(reference, repeat: int) -> None:
    """Raise ValueError where a take would not fit into memory."""
    most = max(1, int(LONGEST / reference.duration))
    if repeat > most:
        raise ValueError(f"--repeat {repeat}: at most {most} for this clip ({LONGEST:.0f} s)")


def _finish(command: Outputs, sim, reference, ball, source: str, root: str, step=None) -> None:
    """Simulate, say how it went, and write the take and its picture."""
    from ..simulate import simulate

    with bar(f"simulating {reference.duration:.1f} s", reference.frame_count) as progress:
        run = simulate(sim, reference, root, ball, progress, step)
    say_run(run, root)
    write_outputs(command, sim.model, run, source, root)


def _sim(command: Simulate, model, reference, ball):
    """Worlds enough for the starts that are tried."""
    from ..simulate import TRIES

    tries = TRIES if ball is not None and reference.duration < SHORT else 1
    return ready(model, tries, command.device)
