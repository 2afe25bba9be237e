"""`warpdribble export`: a learned policy becomes a take."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from .console import bar, check_range, compiling, find_device, say, warmed
from .output import Outputs, check_outputs, say_run, write_outputs


@dataclass
class Export(Outputs):
    """Simulate a learned policy, nothing holding the root; write a USD take and pictures."""

    folder: Positional[Path]
    """The run, a folder that warpdribble learn wrote; or dribble-right-authored, which ships."""
    seconds: float = 20.0
    """How long, in whole fragments of 0.05 s."""
    push: float = 0.0
    """[N] Largest force of random pushes of 0.2 s on the torso, every 3 s or so."""
    seed: int = 0
    """Of the start and the pushes."""

    def run(self) -> int:
        from ..learning.evaluate.record import record
        from ..learning.runs.folder import Run
        from ..learning.tasks.disturbance import Disturbance
        from ..sims.reference.reference import Reference
        from ..simulate import measure

        check_range("--seconds", self.seconds, 0.05, 600.0)
        check_range("--push", self.push, 0.0, 1e4)
        check_range("--seed", self.seed, 0, 2**32)
        run = Run.load(self.folder)
        check_outputs(self.out)
        find_device(self.device)
        with compiling():
            task = warmed(run.task(1, self.device))
        model = task.model
        with bar(f"simulating {self.seconds:.1f} s", round(self.seconds / run.graph.period)) as progress:
            seen = record(
                task, run.policy, run.states, self.seconds, self.seed, Disturbance(push=self.push), progress
            )
        skill = run.config["skill"]
        say(f"skill     {skill['name']}: {skill['description']}, learned in {run.iteration} iterations")
        reference = Reference(seen.reference_q, model.timestep)
        shown = measure(model, reference, seen.body_q, seen.joint_q, seen.wall_time)
        say_run(shown, "free")
        write_outputs(self, model, shown, f"{skill['name']}, learned", "free")
        return 0
