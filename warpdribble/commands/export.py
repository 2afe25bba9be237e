"""`warpdribble export`: a learned policy becomes a take, or an ONNX model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from .console import bar, check_new, check_range, compiling, find_device, say, warmed
from .output import Outputs, check_outputs, write_outputs


@dataclass
class Export(Outputs):
    """Simulate a learned policy, nothing holding the root; write a USD take and pictures."""

    folder: Positional[Path]
    """The run, a folder that warpdribble learn wrote; or what ships (warpdribble demo --list)."""
    seconds: float = 20.0
    """How long, in whole fragments of 0.05 s."""
    stage: str = ""
    """Which of the run's stages; the last that was learned when empty."""
    push: float = 0.0
    """[N] Largest force of random pushes of 0.2 s on the torso, every 3 s or so."""
    seed: int = 0
    """Of the start and the pushes."""
    onnx: Path | None = None
    """Write the network of the stage `policy` to this file instead, and no take."""

    def run(self) -> int:
        if self.onnx is not None:
            return self._network(self.onnx)
        import numpy as np

        from ..learning import Disturbance, RandomWalk, Run, Streams
        from ..learning.evaluate.record import record
        from ..learning.methods import STAGES
        from ..learning.tasks.disturbance import Disturber
        from ..sims.errors import InputError

        check_range("--seconds", self.seconds, 0.05, 600.0)
        check_range("--push", self.push, 0.0, 1e4)
        check_range("--seed", self.seed, 0, 2**32)
        one = Run.load(self.folder).learned(STAGES, self.stage)
        check_outputs(self)
        find_device(self.device)
        with compiling():
            task = warmed(one.task(1, self.device))
        streams = Streams([np.random.default_rng(self.seed)])
        fragments = max(1, round(self.seconds / one.graph.period))
        with bar(f"simulating {self.seconds:.1f} s", fragments) as progress:
            seen = record(
                task,
                one.controller,
                one.starts.draw(streams),
                fragments,
                chooser=RandomWalk(streams),
                disturber=Disturber(Disturbance(push=self.push), streams),
                progress=progress,
            )
        if not seen:
            raise InputError("the simulation broke down (non-finite state)", hint="seed")
        say(
            f"skill     {one.skill['name']}: {one.skill['description']}, "
            f"learned in {one.iteration} iterations"
        )
        cycles = fragments / one.graph.cycle if one.stage.ball else None
        write_outputs(self, task.model, seen[0], f"{one.skill['name']}, learned", "free", cycles)
        return 0

    def _network(self, path: Path) -> int:
        """Write what decides as an ONNX model."""
        from ..learning import STAGES, Run
        from ..learning.policies.network import NetworkPolicy
        from ..learning.policies.onnx import onnx_model
        from ..sims.errors import InputError
        from ..sims.files import whole
        from ..takes.take import check_writable

        one = Run.load(self.folder).learned(STAGES, self.stage or "policy")
        if not isinstance(one.controller, NetworkPolicy):
            raise InputError(f"what {one.stage.name} has learned is no network", self.folder, "stage")
        check_new([check_writable(path, (".onnx",))], self.overwrite)
        model = onnx_model(one.controller, f"{one.skill['name']}, {one.iteration} iterations")
        with whole(path) as part:
            part.write_bytes(model.SerializeToString())
        policy = one.controller
        say(
            f"network   {path} (s (n, {len(policy.mean)}) float32, k (n,) int64 of {len(policy.a_hat)} "
            f"fragments -> action (n, {policy.a_hat.shape[1]}))"
        )
        return 0
