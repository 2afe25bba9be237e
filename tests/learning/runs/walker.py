"""A stage that takes no time: a number that walks at random, a step an iteration."""

from dataclasses import dataclass, field

import numpy as np

from warpdribble.learning.policies.linear import LinearPolicy
from warpdribble.learning.runs.folder import RESULT, Run
from warpdribble.learning.runs.log import read_rows
from warpdribble.learning.runs.stage import Report, Stage
from warpdribble.learning.runs.train import train
from warpdribble.learning.starts import reference_starts
from warpdribble.learning.tasks.locomotion import Locomotion, locomotion_model

SKILL = {"name": "walking", "description": "a number walks", "frames": [0, 9]}
FILES = ("checkpoint.npz", RESULT)


@dataclass(frozen=True)
class Steps:
    size: float = 1.0
    odd: bool = False


@dataclass(frozen=True)
class WalkerConfig:
    iterations: int = 4
    check_every: int = 2
    steps: Steps = field(default=Steps())
    ways: tuple[int, ...] = (1, -1)


@dataclass
class Walked(Report):
    value: float
    survived: float


class Walker:
    def __init__(self, context):
        self.context, self.iteration, self.value = context, 0, 0.0

    @property
    def done(self):
        return self.iteration >= self.context.config.iterations

    def iterate(self):
        config, way = self.context.config, np.random.SeedSequence((self.context.seed, self.iteration))
        self.iteration += 1
        self.value += config.steps.size * float(np.random.default_rng(way).choice(config.ways))
        fresh = self.iteration % config.check_every == 0
        return Walked(self.iteration, fresh, self.value, 0.5 if fresh else np.nan)

    @property
    def result(self):
        return {"value": np.array(self.value)} | {
            f"states.{name}": part for name, part in vars(reference_starts(self.context.graph)).items()
        }

    @property
    def state(self):
        return {"value": np.array(self.value), "iteration": np.array(self.iteration)}

    def restore(self, state):
        self.value, self.iteration = float(state["value"]), int(state["iteration"])


def still(context, arrays):
    return LinearPolicy.zero(context.graph.count, 17, 20)


STAGE = Stage(
    name="walker",
    about="to walk at random",
    config=WalkerConfig,
    make=Walker,
    controller=still,
    task=lambda context, worlds: Locomotion(locomotion_model(), context.graph, worlds, context.device),
)


def walk(folder, graph, stage=STAGE, seed=0, **how):
    """Learn in a folder as the command does; what `train` says."""
    run = Run.begin(folder, SKILL, seed)
    run.keep('name = "walking"\n', lambda: graph)
    return train(run, stage, **how)


def arrays(path):
    with np.load(path) as file:
        return {name: file[name] for name in file.files if name != "seconds"}


def rows(folder, *but):
    return [{k: v for k, v in row.items() if k not in ("seconds", *but)} for row in read_rows(folder)]


def events(folder, tag):
    """(step, value) pairs as TensorBoard reads them."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    found = EventAccumulator(str(folder / "tensorboard"))
    found.Reload()
    return [(event.step, event.value) for event in found.Scalars(tag)]


def assert_same(one, two, *times):
    """Two folders of a stage, but for times."""
    for name in FILES:
        first, second = arrays(one / name), arrays(two / name)
        assert first.keys() == second.keys()
        for key in first:
            np.testing.assert_array_equal(first[key], second[key], f"{name} {key}")
    np.testing.assert_equal(rows(one, *times), rows(two, *times))
    for tag in read_rows(one)[0].keys() - {"iteration", "seconds", *times}:
        np.testing.assert_equal(events(one, tag), events(two, tag))
