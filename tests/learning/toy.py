"""A stage as anyone may add one: a random search over offsets of the arms, on top of what locomotion found.

One file with a `Stage` and one line, `STAGES["toy"] = TOY`: the commands do the rest.
"""

from dataclasses import dataclass

import numpy as np

from warpdribble.learning import Ahead, Locomotion, Report, Rollout, Stage, Starts, locomotion_model
from warpdribble.learning.methods import samcon
from warpdribble.learning.tasks.locomotion import legs_graph


@dataclass(frozen=True)
class ToyConfig:
    iterations: int = 12
    candidates: int = 64
    walk: int = 42
    """fragments that each is tried for"""
    sigma: float = 0.05
    """[rad]"""


@dataclass
class Tried(Report):
    cost: float
    """of the best so far"""


class Armed(Locomotion):
    """The player whose policy moves the arms too."""

    def __init__(self, context, worlds):
        super().__init__(locomotion_model(), legs_graph(context.graph), worlds, context.device)
        self.actions = self.course.columns


class LegsAndArms:
    """Legs as they were learned; arms off by constants (worlds or 1, fragments, arms) [rad]."""

    def __init__(self, context, arms):
        self.legs = samcon.STAGE.controller(context, context.needs["locomotion"])
        self.arms = arms

    def act(self, obs, k):
        world = np.arange(len(k)) % len(self.arms)
        return np.concatenate([self.legs.act(obs, k), self.arms[world, k]], axis=1)


class RandomSearch:
    def __init__(self, context):
        self.context, self.iteration, self.cost = context, 0, np.inf
        self.task = Armed(context, context.config.candidates)
        legs = context.needs["locomotion"]
        self.starts = Starts(*(legs[f"states.{name}"] for name in ("k", "joint_q", "joint_qd")))
        self.arms = np.zeros((context.graph.count, self.task.actions - legs["a_hat"].shape[1]))

    @property
    def done(self):
        return self.iteration >= self.context.config.iterations

    def iterate(self):
        c, random = self.context.config, np.random.default_rng((self.context.seed, self.iteration))
        tried = self.arms + c.sigma * random.standard_normal((c.candidates, *self.arms.shape))
        tried[0] = self.arms
        same = np.zeros(c.candidates, int)
        start = self.starts[same]
        rollout = Rollout(self.task, LegsAndArms(self.context, tried), Ahead(), start)
        cost = np.mean([fragment.cost for fragment in rollout.fragments(c.walk)], axis=0)
        self.arms, self.cost = tried[np.argmin(cost)], float(cost.min())
        self.iteration += 1
        return Tried(self.iteration, self.done, self.cost)

    @property
    def result(self):
        return {"arms": self.arms} | {f"states.{name}": v for name, v in vars(self.starts).items()}

    @property
    def state(self):
        return {"arms": self.arms, "cost": np.array(self.cost), "iteration": np.array(self.iteration)}

    def restore(self, state):
        self.arms, self.cost, self.iteration = state["arms"], float(state["cost"]), int(state["iteration"])


TOY = Stage(
    name="toy",
    about="to carry the arms so that the legs have less to do",
    config=ToyConfig,
    make=RandomSearch,
    controller=lambda context, result: LegsAndArms(context, result["arms"][None]),
    task=Armed,
    needs=("locomotion",),
)
