"""The folder of one learning run: all that learning goes on from, and all that using its policy takes.

    config.json      what makes the run the one it is
    skill.toml       the skill, as it was given
    graph.npz        its control graph; the clip is not needed any more
    checkpoint.npz   `Samcon.saved` after the last iteration
    policy.npz       the best policy so far, and states to start it from
    progress.csv     a row per iteration, and the same in tensorboard/

Every file is replaced as a whole, the checkpoint last: stopped at any moment, learning goes on as if it had
not been.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path

import numpy as np

from ... import __version__
from ...assets import path as asset
from ..evaluate.trials import States
from ..graph import ControlGraph
from ..methods.samcon import Progress, Samcon, SamconConfig
from ..policies.linear import LinearPolicy
from ..tasks.locomotion import WEIGHTS, CostWeights, Locomotion, locomotion_model
from .files import PART, read_arrays, said_if_damaged, whole, write_arrays
from .log import Log

CONFIG, SKILL, GRAPH = "config.json", "skill.toml", "graph.npz"
CHECKPOINT, POLICY = "checkpoint.npz", "policy.npz"
CONTROLLERS = "controllers"
FREE = ("version", "samcon.iterations")
"""Keys in which a run may differ from the one that it goes on from."""
SECONDS = "seconds"


@dataclass(frozen=True)
class RunConfig:
    """What a run depends on; the device it runs on does not count."""

    skill: dict
    """the skill's fields, of which "name" and "description" are shown"""
    samcon: SamconConfig = field(default=SamconConfig())
    seed: int = 0
    weights: CostWeights = field(default=WEIGHTS)
    trial_worlds: int = 256
    """trials of a check"""
    stage: str = "locomotion"
    version: str = __version__
    """of warpdribble"""

    def plain(self) -> dict:
        """As JSON has it."""
        return json.loads(json.dumps(asdict(self)))


class RunFolder:
    """A run's folder while it is learned: a new one, or one that goes on."""

    def __init__(self, folder: str | Path, config: RunConfig, iterations: int | None = None):
        """iterations: in all; None for what the run was begun with, or the config has. Raises ValueError for
        a folder that holds another run, or anything else."""
        self.folder = Path(folder)
        stored = _stored(self.folder)
        if stored is not None:
            apart = differences(stored, config.plain())
            if apart:
                raise ValueError(f"{self.folder} holds another run: {apart[0]}; give another --out")
            iterations = iterations or stored["samcon"]["iterations"]
        iterations = iterations or config.samcon.iterations
        self.config = replace(config, samcon=replace(config.samcon, iterations=iterations))
        self.saved = 0
        """iterations in the checkpoint"""
        self._seconds = 0.0
        _check_writable(self.folder)

    @property
    def begun(self) -> bool:
        """Whether its graph is there already."""
        return (self.folder / GRAPH).exists()

    def graph(self, skill_text: str, make: Callable[[], ControlGraph]) -> ControlGraph:
        """The run's graph; made and kept, with the skill's file, where the run is new."""
        path = self.folder / GRAPH
        if not self.begun:
            graph = make()
            self._write_config(self.config.samcon.iterations)
            with whole(self.folder / SKILL) as part:
                part.write_text(skill_text, encoding="utf-8")
            with whole(path) as part:
                graph.save(part)
        return _read_graph(path)

    def samcon(self, graph: ControlGraph, device: str = "cpu") -> Samcon:
        """The learner, where the checkpoint has it. Raises ValueError for a damaged checkpoint."""
        c, model = self.config, locomotion_model()
        tasks = [
            Locomotion(model, graph, worlds, device, weights=c.weights)
            for worlds in (c.samcon.islands * c.samcon.particles, c.trial_worlds)
        ]
        samcon = Samcon(*tasks, c.samcon, c.seed)
        path = self.folder / CHECKPOINT
        if path.exists():
            remedy = "delete it to learn from the start, or give another --out"
            state = read_arrays(path, remedy)
            with said_if_damaged(path, remedy):
                self._seconds = float(state.pop(SECONDS))
                for name, array in samcon.saved.items():
                    if "states." not in name and state[name].shape != array.shape:
                        raise ValueError(f"{name} has the shape {state[name].shape}")
                samcon.resume(state)
            self.saved = samcon.iteration
        return samcon

    def learn(self, samcon: Samcon, progress: Callable[[Progress], None] | None = None) -> bool:
        """Iterate to the end, saving all of it after every iteration. Returns whether TensorBoard's files
        were written too."""
        self._write_config(max(samcon.config.iterations, samcon.iteration))
        names = [f.name for f in fields(Progress)] + [SECONDS]
        began = time.perf_counter() - self._seconds
        with contextlib.closing(Log(self.folder, names, samcon.iteration)) as log:
            while samcon.iteration < samcon.config.iterations:
                report = samcon.iterate()
                self._seconds = time.perf_counter() - began
                log.add(asdict(report) | {SECONDS: self._seconds})
                if np.isfinite(report.survived):
                    self._write_policy(samcon)
                seconds = np.array(self._seconds)
                write_arrays(self.folder / CHECKPOINT, samcon.saved | {SECONDS: seconds})
                self.saved = samcon.iteration
                if progress:
                    progress(report)
        return log.has_events

    def _write_config(self, iterations: int) -> None:
        config = replace(self.config, samcon=replace(self.config.samcon, iterations=iterations))
        with whole(self.folder / CONFIG) as part:
            part.write_text(json.dumps(config.plain(), indent=2) + "\n", encoding="utf-8")

    def _write_policy(self, samcon: Samcon) -> None:
        states = {f"states.{name}": value for name, value in vars(samcon.best_states).items()}
        iteration = np.array(samcon.iteration)
        write_arrays(self.folder / POLICY, vars(samcon.best) | states | {"iteration": iteration})


@dataclass(frozen=True)
class Run:
    """What has been learned, ready for use."""

    folder: Path
    config: dict
    """as in config.json"""
    graph: ControlGraph
    policy: LinearPolicy
    """the best so far"""
    states: States
    """to start it from"""
    iteration: int
    """after which it was written"""
    weights: CostWeights

    @staticmethod
    def load(folder: str | Path) -> Run:
        """Read a run's folder, or a shipped controller by name. Raises ValueError, one line, for what is no
        run or has no policy yet."""
        folder = Path(folder)
        if not folder.exists() and str(folder) in shipped_controllers():
            folder = asset(CONTROLLERS) / folder
        if not folder.is_dir():
            known = ", ".join(shipped_controllers())
            raise ValueError(
                f"{folder}: no such folder; warpdribble learn SKILL --out {folder} makes it ({known} ships)"
            )
        if not (folder / CONFIG).exists():
            raise ValueError(f"{folder} holds no run; give a folder that warpdribble learn wrote")
        config = _read_config(folder)
        if not (folder / GRAPH).exists() or not (folder / POLICY).exists():
            check = config["samcon"]["check_every"]
            raise ValueError(
                f"{folder} has no policy yet, the first comes after {check} iterations: "
                "let it go on with the same warpdribble learn"
            )
        with said_if_damaged(folder / CONFIG, "learn again with another --out"):
            weights = CostWeights(**config["weights"])
        graph = _read_graph(folder / GRAPH)
        path, remedy = folder / POLICY, "delete it and learn on (more --iterations): a check writes it anew"
        arrays = read_arrays(path, remedy)
        with said_if_damaged(path, remedy):
            return Run(
                folder=folder,
                config=config,
                graph=graph,
                policy=LinearPolicy(*(arrays[f.name] for f in fields(LinearPolicy))),
                states=States(*(arrays[f"states.{f.name}"] for f in fields(States))),
                iteration=int(arrays["iteration"]),
                weights=weights,
            )

    def task(self, worlds: int, device: str = "cpu") -> Locomotion:
        """Worlds in which the policy can be tried."""
        return Locomotion(locomotion_model(), self.graph, worlds, device, weights=self.weights)


def shipped_controllers() -> list[str]:
    """Names of the runs that come with warpdribble."""
    return sorted(path.name for path in asset(CONTROLLERS).iterdir() if path.is_dir())


def differences(there: dict, here: dict) -> list[str]:
    """In which keys two configurations differ, beyond those that may."""
    a, b = _flat(there), _flat(here)
    return [
        f"{key} is {_shown(a, key)} there and {_shown(b, key)} here"
        for key in [*b, *(key for key in a if key not in b)]
        if key not in FREE and (key not in a or key not in b or a[key] != b[key])
    ]


def _flat(config: dict, above: str = "") -> dict:
    flat = {}
    for key, value in config.items():
        flat |= _flat(value, f"{above}{key}.") if isinstance(value, dict) else {above + key: value}
    return flat


def _shown(flat: dict, key: str) -> str:
    text = json.dumps(flat[key]) if key in flat else "missing"
    return text if len(text) <= 60 else text[:57] + "..."


def _stored(folder: Path) -> dict | None:
    """The configuration of the run in a folder; None for a folder that is free. Raises ValueError."""
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{folder} is a file; give a folder as --out")
    if (folder / CONFIG).exists():
        return _read_config(folder)
    others = [p.name for p in folder.iterdir() if not p.name.startswith(PART)] if folder.exists() else []
    if others:
        raise ValueError(f"{folder} is not empty and holds no run ({sorted(others)[0]}); give another --out")
    return None


def _read_config(folder: Path) -> dict:
    path = folder / CONFIG
    with said_if_damaged(path, "put it right, or learn again with another --out"):
        config = json.loads(path.read_text(encoding="utf-8"))
        for table, key in (("skill", "name"), ("samcon", "iterations"), ("samcon", "check_every")):
            config[table][key]
        if type(config["samcon"]["iterations"]) is not int:
            raise ValueError("samcon.iterations is no whole number")
    return config


def _read_graph(path: Path) -> ControlGraph:
    with said_if_damaged(path, "learn again with another --out"):
        return ControlGraph.load(path)


def _check_writable(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ValueError(
            f"{folder} cannot be written: {error.strerror or error}; give another --out"
        ) from None
