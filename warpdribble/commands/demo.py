"""`warpdribble demo`: a controller that ships, at work."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from .console import bar, check_range, compiling, find_device, say, warmed
from .output import Outputs, check_outputs, write_outputs

FIRST = "dribble-right-authored"
"""The controller that is shown when none is named."""
PUSHED = 0.4
"""Share of the take after which the push comes."""


@dataclass
class Demo(Outputs):
    """A player that has learned to dribble, on its own feet, pushed once; needs no data."""

    controller: Positional[str] = FIRST
    """Which of those that ship; --list shows them."""
    list: bool = False
    """Show what ships, and do nothing else."""
    seconds: float = 20.0
    """How long."""
    push: float = 100.0
    """[N] Force of the push on the torso, forward, 0.2 s long; 0 for none."""
    out: Path = Path("out/demo.usdc")
    """The take: .usda, .usdc or .usdz. The pictures (.png) and the replay (.html) go beside it."""

    def run(self) -> int:
        import numpy as np

        from ..learning import Run, Streams
        from ..learning.evaluate.pushes import PUSH_TIME, Push
        from ..learning.evaluate.record import record
        from ..learning.methods import STAGES
        from ..learning.runs.folder import shipped_controllers
        from ..sims.errors import InputError

        if self.list:
            for name in shipped_controllers():
                say(f"{name:24} {Run.load(name).info['skill']['description']}")
            return 0
        if self.controller not in shipped_controllers():
            raise InputError(f"no such controller ({', '.join(shipped_controllers())} ship)", self.controller)
        check_range("--seconds", self.seconds, 0.05, 600.0)
        check_range("--push", self.push, 0.0, 1e4)
        check_outputs(self)
        find_device(self.device)
        one = Run.load(self.controller).learned(STAGES)
        graph = one.graph
        say(f"skill     {one.skill['name']}: {one.skill['description']}, learned")
        with compiling():
            task = warmed(one.task(1, self.device))
        fragments = max(1, round(self.seconds / graph.period))
        when, lasts = int(PUSHED * fragments), max(1, round(PUSH_TIME / graph.period))
        push = Push(self.push, np.array([when]), lasts, 1)
        start = one.starts.draw(Streams([np.random.default_rng(0)]))
        with bar(f"simulating {self.seconds:.1f} s", fragments) as progress:
            seen = record(task, one.controller, start, fragments, disturber=push, progress=progress)
        if not seen:
            raise InputError("the simulation broke down (non-finite state)", hint="seed")
        if self.push:
            say(f"pushed    with {self.push:g} N for {PUSH_TIME:g} s after {when * graph.period:.1f} s")
        cycles = fragments / graph.cycle
        write_outputs(self, task.model, seen[0], f"{one.skill['name']}, learned", "free", cycles)
        say(
            "next      open the take in Blender (or any USD viewer); others: warpdribble demo --list;\n"
            "          let it follow your own clip, warpdribble simulate CLIP.bvh --repeat 10;\n"
            "          or learn one, warpdribble learn SKILL --out RUN"
        )
        return 0
