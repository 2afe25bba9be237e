"""The stage `ball`: cycle after cycle of arms and fingers that really play with the ball, for the legs that
`locomotion` has learned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ....sims.errors import InputError
from ....sims.model import Model
from ...graph import STEPS, ControlGraph
from ...policies.linear import LinearPolicy
from ...runs.stage import Arrays, Context, Learner, Stage
from ...starts import Starts
from ...tasks.arms import USUAL, Arms, BallWeights
from .. import samcon
from . import newton
from .newton import Newton, NewtonConfig
from .optimised import Optimised, Playback
from .paper import Paper, PaperConfig, population
from .smc import Smc, SmcConfig


@dataclass(frozen=True)
class BallConfig:
    """Parameters of the search for a trajectory."""

    iterations: int = 300
    """tries of a cycle, or of a window between checkpoints, at most"""
    method: str = "smc"
    """one of METHODS"""
    cycles: int = 100
    """to be found in a row (N_rep of P1 5.2)"""
    smc: SmcConfig = field(default=SmcConfig())
    paper: PaperConfig = field(default=PaperConfig())
    newton: NewtonConfig = field(default=NewtonConfig())
    weights: BallWeights = field(default=BallWeights())


def legs(context: Context) -> LinearPolicy:
    """The locomotion policy that the stage starts from."""
    return samcon.learned(context, context.needs[samcon.STAGE.name])


def arms(
    context: Context,
    worlds: int,
    threads: int | None = None,
    weights: BallWeights = USUAL,
    state: str = "reduced",
    closely: bool = False,
) -> Arms:
    """Worlds of the player with the ball. Raises InputError for a graph without."""
    graph = context.graph
    if graph.touch is None or not np.any(graph.touch):
        reason = "nobody plays with a ball here: nothing in the motion shows one"
        raise InputError(reason, hint="contact")
    player = Model.load("player")
    return Arms(player, graph, worlds, legs(context), context.device, threads, weights, state, closely)


def task(context: Context, worlds: int) -> Arms:
    """Worlds in which what was found can be played back."""
    return arms(context, worlds, weights=context.config.weights)


def ball_in_hand(graph: ControlGraph) -> Starts:
    """The state of the reference that begins the first checkpoint's fragment: the ball is in the hand."""
    assert graph.checkpoints is not None
    k = np.array([int(graph.checkpoints[0]) // STEPS if len(graph.checkpoints) else 0])
    return Starts(k, graph.start_q[k], graph.start_qd[k])


def make(context: Context) -> Learner:
    """The learner of the method that the parameters name."""
    c: BallConfig = context.config
    if c.method not in METHODS:
        raise InputError(f"there is no method '{c.method}'; there are {', '.join(METHODS)}", hint="method")
    return METHODS[c.method](context)


def _smc(context: Context) -> Learner:
    c: BallConfig = context.config
    return Smc(
        task(context, c.smc.particles),
        c.smc,
        c.cycles,
        c.iterations,
        ball_in_hand(context.graph),
        context.seed,
    )


def _paper(context: Context) -> Learner:
    c: BallConfig = context.config
    size = population(Model.load("player"), context.graph, c.paper)
    worlds = arms(context, size, weights=c.weights, closely=True)
    return Paper(worlds, c.paper, c.cycles, c.iterations, context.seed)


def _newton(context: Context) -> Learner:
    c: BallConfig = context.config
    few, steps, slopes = (
        arms(context, size, weights=c.weights, closely=True)
        for size in newton.sizes(Model.load("player"), context.graph, c.newton)
    )
    return Newton(few, steps, slopes, c.newton, c.cycles, c.iterations, context.seed)


METHODS: dict[str, Callable[[Context], Learner]] = {"smc": _smc, "paper": _paper, "newton": _newton}
"""How a trajectory is found."""


def playback(context: Context, arrays: Arrays) -> Playback:
    """What was found, as it was found."""
    return Playback(Optimised.of(arrays))


STAGE = Stage(
    name="ball",
    about="offsets of arms and fingers, open loop, that keep the ball for a hundred cycles",
    config=BallConfig,
    make=make,
    controller=playback,
    task=task,
    ball=True,
    needs=(samcon.STAGE.name,),
    save_iterations=20,
)
