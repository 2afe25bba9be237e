"""The folder of a run: a skill, its control graph, and what each stage has learned for it.

    run.json         what makes the run the one it is: the skill, the seed
    skill.toml       the skill, as it was given
    graph.npz        its control graph; the clip is not needed any more
    <stage>/
        config.json      the stage's parameters
        checkpoint.npz   the learner's state
        policy.npz       its best result so far, and states to start it from
        progress.csv     a row per iteration, and the same in tensorboard/
        needs-*.npz      results of other stages that it started from, as they were then

Every file is replaced as a whole, the checkpoint last: stopped at any moment, learning goes on as if it had
not been.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...assets import path as asset
from ...sims.errors import InputError
from ...sims.files import PART, check_folder, sweep, whole
from ..arrays import Arrays
from ..graph import ControlGraph
from ..rollout import Controller
from ..starts import Starts
from ..tasks.locomotion import Locomotion
from .files import LOCK, held, read_arrays, said_if_damaged, write_arrays, write_json
from .log import Log
from .stage import Context, Learner, Stage

RUN, SKILL, GRAPH = "run.json", "skill.toml", "graph.npz"
CONFIG, CHECKPOINT, RESULT = "config.json", "checkpoint.npz", "policy.npz"
CONTROLLERS = "controllers"
SECONDS = "seconds"
FREE = ("version", "iterations")
"""Keys in which what is asked for may differ from what there is."""


@dataclass(frozen=True)
class Run:
    """A run on disk."""

    folder: Path
    info: dict[str, Any]
    """as in run.json: "skill" (a table), "seed", "version\""""

    @staticmethod
    def begin(folder: str | Path, skill: dict[str, Any], seed: int = 0) -> Run:
        """A new run, or the one that is there and goes on. Raises InputError for a folder that holds another
        run, or anything else."""
        folder = Path(folder)
        info = json.loads(json.dumps({"skill": skill, "seed": seed, "version": __version__}))
        stored = _stored(folder)
        if stored is not None and (apart := differences(stored, info)):
            raise InputError(f"holds another run: {apart[0]}", folder, "out")
        try:
            check_folder(folder)
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror or error}", folder, "out") from None
        return Run(folder, stored or info)

    @staticmethod
    def load(folder: str | Path) -> Run:
        """One that is there, or a shipped controller by name. Raises InputError for what is no run."""
        folder = Path(folder)
        if not folder.exists() and str(folder) in shipped_controllers():
            folder = asset(CONTROLLERS) / folder
        if not folder.is_dir():
            known = ", ".join(shipped_controllers())
            raise InputError(f"no such folder ({known} ships)", folder, "learn")
        if not (folder / RUN).exists():
            raise InputError("holds no run", folder, "run")
        return Run(folder, _read_info(folder))

    @property
    def seed(self) -> int:
        return int(self.info["seed"])

    @property
    def begun(self) -> bool:
        """Whether its graph is there already."""
        return (self.folder / GRAPH).exists()

    def keep(self, skill_text: str, make: Callable[[], ControlGraph]) -> None:
        """Make the graph and keep it with the skill's file, where the run is new. Raises InputError for a
        folder that another process holds."""
        if self.begun:
            return
        with held(self.folder):
            sweep(self.folder)
            graph = make()
            write_json(self.folder / RUN, self.info)
            with whole(self.folder / SKILL) as part:
                part.write_text(skill_text, encoding="utf-8")
            with whole(self.folder / GRAPH) as part:
                graph.save(part)

    @property
    def graph(self) -> ControlGraph:
        with said_if_damaged(self.folder / GRAPH, "learn again", "out"):
            return ControlGraph.load(self.folder / GRAPH)

    def stage(self, stage: Stage) -> StageFolder:
        return StageFolder(self.folder / stage.name, stage)

    def context(
        self, stage: Stage, config: Any, device: str = "cpu", workers: int = 1, learns: bool = True
    ) -> Context:
        """For a learner of a stage, or only for its result. Raises InputError where a stage that it needs for
        that has not been learned."""
        folder, needs = self.folder / stage.name, {}
        graph = self.graph
        wanted = stage.needs if learns or stage.uses is None else stage.uses
        for need in () if graph.tracked and stage.ball else wanted:
            if (kept := self.stage(stage).need(need)).exists():
                needs[need] = read_arrays(kept, RESULT_REMEDY)
                continue
            if not (self.folder / need / RESULT).exists():
                reason = f"{stage.name} starts from what {need} has learned, and there is nothing yet"
                raise InputError(reason, self.folder, "needs")
            needs[need] = read_result(self.folder / need)
        return Context(graph, config, self.seed, device, workers, folder, needs)

    def learned(self, stages: Mapping[str, Stage], name: str = "") -> Learned:
        """What a stage has learned, by default the last of `stages` that has. Raises InputError where none
        has."""
        there = [s for s in stages if (self.folder / s / CONFIG).exists()]
        if name and name not in stages:
            reason = f"there is no stage '{name}'; there are {', '.join(stages)}"
            raise InputError(reason, self.folder, "stage")
        if not there or (name and name not in there):
            raise InputError(f"has no policy yet: no {name or 'stage'} was learned", self.folder, "learn")
        done = [s for s in there if (self.folder / s / RESULT).exists()]
        stage = stages[name or (done or there)[-1]]
        folder = self.stage(stage)
        arrays = read_result(folder.path)
        context = self.context(stage, folder.config(), learns=False)
        with said_if_damaged(folder.path / RESULT, RESULT_REMEDY):
            return Learned(
                self,
                stage,
                context,
                stage.controller(context, arrays),
                _starts(arrays),
                int(arrays["iteration"]),
            )


@dataclass(frozen=True)
class Learned:
    """What a stage has learned, ready for use."""

    run: Run
    stage: Stage
    context: Context
    controller: Controller
    """the best so far"""
    starts: Starts
    """to start it from"""
    iteration: int
    """after which it was written"""

    @property
    def graph(self) -> ControlGraph:
        return self.context.graph

    @property
    def skill(self) -> dict[str, Any]:
        return dict(self.run.info["skill"])

    def task(self, worlds: int, device: str = "cpu") -> Locomotion:
        """Worlds in which it can be tried."""
        return self.stage.task(replace(self.context, device=device), worlds)


@dataclass(frozen=True)
class StageFolder:
    """What one stage keeps."""

    path: Path
    stage: Stage

    def config(self, asked: Any = None, iterations: int | None = None) -> Any:
        """The stage's parameters: those asked for, else those it was begun with, else its defaults; keys
        that an older file lacks have their defaults. iterations: in all; None for what it was begun with.
        Raises InputError where others were asked for than it was begun with."""
        stored = self._stored()
        if asked is None:
            config = self.stage.config() if stored is None else stored
        elif stored is None:
            config = asked
        else:
            if apart := differences(plain(stored), plain(asked)):
                raise InputError(f"holds another run: {apart[0]}", self.path, "out")
            config = replace(asked, iterations=stored.iterations)
        return config if iterations is None else replace(config, iterations=iterations)

    def _stored(self) -> Any:
        path = self.path / CONFIG
        if not path.exists():
            return None
        with said_if_damaged(path, "put it right, or learn again", "out"):
            return filled(self.stage.config(), json.loads(path.read_text(encoding="utf-8")))

    @property
    def learned(self) -> bool:
        """Whether it has a result."""
        return (self.path / RESULT).exists()

    def make(self) -> None:
        """Make the folder, without what killed writers have left in it. Only for who holds the run."""
        self.path.mkdir(exist_ok=True)
        sweep(self.path)

    def need(self, name: str) -> Path:
        """Where the result of another stage is kept, as it was when this one began: it may be learned on."""
        return self.path / f"needs-{name}.npz"

    def begin(self, config: Any, needs: Mapping[str, Arrays]) -> None:
        """Keep the parameters, and the results that it starts from."""
        for name, arrays in needs.items():
            if not self.need(name).exists():
                write_arrays(self.need(name), arrays)
        write_json(self.path / CONFIG, plain(config))

    def restore(self, learner: Learner) -> float:
        """Bring a learner to where the checkpoint has it; the seconds that this took when it was learned."""
        path = self.path / CHECKPOINT
        if not path.exists():
            return 0.0
        remedy = "delete it to learn from the start"
        state = read_arrays(path, remedy, "out")
        with said_if_damaged(path, remedy, "out"):
            seconds = float(state.pop(SECONDS))
            learner.restore(state)
        return seconds

    def save(self, state: Arrays, seconds: float) -> None:
        """Write the checkpoint."""
        write_arrays(self.path / CHECKPOINT, state | {SECONDS: np.array(seconds)})

    def save_result(self, result: Arrays, iteration: int) -> None:
        write_arrays(self.path / RESULT, result | {"iteration": np.array(iteration)})

    def log(self, names: list[str], done: int) -> Log:
        """names: the columns; the first is the iteration, the last the time [s]. done: iterations that
        count."""
        return Log(self.path, names, done)


RESULT_REMEDY = "delete it and learn on (more iterations): a check writes it anew"


def read_result(folder: Path) -> Arrays:
    """The best that a stage has found so far. Raises InputError where there is none yet."""
    path = folder / RESULT
    if not path.exists():
        raise InputError("has no policy yet", folder.parent, "go on")
    return read_arrays(path, RESULT_REMEDY)


def _starts(arrays: Arrays) -> Starts:
    return Starts(*(arrays[f"states.{f.name}"] for f in fields(Starts)))


def shipped_controllers() -> list[str]:
    """Names of the runs that come with warpdribble."""
    return sorted(path.name for path in asset(CONTROLLERS).iterdir() if path.is_dir())


def plain(config: Any) -> dict[str, Any]:
    """A dataclass as JSON has it."""
    return dict(json.loads(json.dumps(asdict(config))))


def filled(default: Any, stored: Any, name: str = "it") -> Any:
    """A dataclass like `default` with the values of a stored table; what the table lacks keeps its default.
    Raises TypeError for keys that are none, and for values of another kind."""
    if not is_dataclass(default):
        return _alike(default, stored, name)
    if not isinstance(stored, Mapping):
        raise TypeError(f"{name} is no table")
    known = {f.name for f in fields(default)}
    if unknown := set(stored) - known:
        raise TypeError(f"unknown key '{sorted(unknown)[0]}'")
    values = {key: filled(getattr(default, key), value, key) for key, value in stored.items()}
    return replace(default, **values)  # type: ignore[type-var]


def _alike(default: Any, value: Any, name: str) -> Any:
    """A value as JSON has it for a field with a default."""
    if isinstance(default, tuple):
        value = tuple(value) if isinstance(value, list) else value
    kind = type(default)
    if kind is float:
        value = float(value) if type(value) is int else value
    if default is not None and type(value) is not kind:
        said = {int: "whole number", float: "number", bool: "true or false", str: "text"}
        raise TypeError(f"{name} is no {said.get(kind, kind.__name__)}")
    return value


def changed(config: Any, asked: Sequence[str]) -> Any:
    """A dataclass with other values, each as "name=value" or "name.name=value", the value as JSON has it or
    plain text. Raises InputError for a name that it lacks, and for a value of another kind."""
    for one in asked:
        name, there, text = one.partition("=")
        if not there:
            raise InputError(f"'{one}' is no NAME=VALUE", hint="set")
        try:
            value = json.loads(text)
        except json.JSONDecodeError:
            value = text
        for key in reversed(name.split(".")):
            value = {key: value}
        try:
            config = filled(config, value)
        except TypeError as error:
            raise InputError(f"'{one}': {error}", hint="set") from None
    return config


def differences(there: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    """In which keys two tables differ, beyond those that may. A key that one lacks, being of another version,
    stands for what is empty: "", false, nothing."""
    a, b = _flat(there), _flat(here)
    return [
        f"{key} is {_shown(a, key)} there and {_shown(b, key)} here"
        for key in [*b, *(key for key in a if key not in b)]
        if key not in FREE
        and (a.get(key) or b.get(key))
        and (key not in a or key not in b or a[key] != b[key])
    ]


def _flat(config: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in config.items():
        flat |= _flat(value, f"{above}{key}.") if isinstance(value, dict) else {above + key: value}
    return flat


def _shown(flat: Mapping[str, Any], key: str) -> str:
    text = json.dumps(flat[key]) if key in flat else "missing"
    return text if len(text) <= 60 else text[:57] + "..."


def _stored(folder: Path) -> dict[str, Any] | None:
    """The info of the run in a folder; None for a folder that is free. Raises InputError."""
    if folder.exists() and not folder.is_dir():
        raise InputError("is a file, not a folder", folder, "out")
    if (folder / RUN).exists():
        return _read_info(folder)
    names = sorted(p.name for p in folder.iterdir()) if folder.exists() else []
    others = [name for name in names if not name.startswith(PART) and name != LOCK]
    if CONFIG in others and GRAPH in others:
        raise InputError("holds a run of an older version, which cannot go on", folder, "out")
    if others:
        raise InputError(f"is not empty and holds no run ({others[0]})", folder, "out")
    return None


def _read_info(folder: Path) -> dict[str, Any]:
    path = folder / RUN
    with said_if_damaged(path, "put it right, or learn again", "out"):
        info = json.loads(path.read_text(encoding="utf-8"))
        info["skill"]["name"], int(info["seed"])
        return dict(info)
