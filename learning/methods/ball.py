"""The stage `ball`: cycle after cycle of arms and fingers that really play with the ball, for the legs that
`locomotion` has learned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...sims.errors import InputError
from ...sims.model import Model
from ..arrays import Arrays
from ..ball import newton
from ..ball.hold import in_hand
from ..ball.newton import Newton, NewtonConfig
from ..ball.optimised import Optimised, Playback
from ..ball.paper import Paper, PaperConfig, population
from ..ball.smc import Smc, SmcConfig
from ..ball.usual import Usual
from ..ball.windows import holding
from ..evaluate.attempts import ROOT_DRIVE
from ..graph import STEPS, ControlGraph
from ..rollout import Controller
from ..runs.stage import Context, Learner, Stage
from ..starts import Starts
from ..tasks.arms import USUAL, Arms, BallWeights
from ..tasks.follow import OpenLoop
from ..tasks.locomotion import STEERED
from . import samcon


@dataclass(frozen=True)
class BallConfig:
    """Parameters of the search for a trajectory."""

    iterations: int = 300
    """tries of a cycle, or of a window between checkpoints, at most"""
    method: str = "usual"
    """one of METHODS"""
    cycles: int = 100
    """to be found in a row (N_rep of P1 5.2)"""
    smc: SmcConfig = field(default=SmcConfig())
    paper: PaperConfig = field(default=PaperConfig())
    newton: NewtonConfig = field(default=NewtonConfig())
    weights: BallWeights = field(default=BallWeights())


def legs(context: Context) -> Controller:
    """The locomotion policy that the stage starts from; none where the root is held."""
    if context.graph.tracked:
        return OpenLoop(STEERED)
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
    made = Arms(player, graph, worlds, legs(context), context.device, threads, weights, state, closely)
    if graph.tracked:
        made.sim.set_root_drive(*ROOT_DRIVE)
    return made


def felt(context: Context, worlds: int, threads: int | None = None) -> Arms:
    """Worlds in which a policy of arms feels what its parameters say."""
    return arms(context, worlds, threads, context.config.cost, context.config.state)


def task(context: Context, worlds: int) -> Arms:
    """Worlds in which what was found can be played back."""
    return arms(context, worlds, weights=context.config.weights)


def ball_in_hand(model: Model, graph: ControlGraph) -> Starts:
    """A state of the reference with the ball in the hand, where a fragment begins soon after a checkpoint."""
    assert graph.touch is not None and graph.checkpoints is not None
    before = graph.touch.reshape(graph.count, STEPS, 2)[:, -1].any(axis=1)
    began = np.roll(before, 1)
    mark = int(graph.checkpoints[0]) if len(graph.checkpoints) else 0
    after = (np.arange(graph.count) * STEPS - mark - 1) % (graph.count * STEPS)
    k = int(np.argmin(np.where(began, after, np.inf)))
    joint_q = in_hand(model, graph.start_q[k], holding(graph, k))
    return Starts(np.array([k]), joint_q[None], graph.start_qd[[k]])


def make(context: Context) -> Learner:
    """The learner of the method that the parameters name."""
    c: BallConfig = context.config
    if c.method not in METHODS:
        raise InputError(f"there is no method '{c.method}'; there are {', '.join(METHODS)}", hint="method")
    return METHODS[c.method](context)


def _smc(context: Context) -> Smc:
    c: BallConfig = context.config
    worlds = task(context, c.smc.particles)
    begin = ball_in_hand(worlds.model, context.graph)
    return Smc(worlds, c.smc, c.cycles, c.iterations, begin, context.seed)


def _paper(context: Context) -> Learner:
    c: BallConfig = context.config
    size = population(Model.load("player"), context.graph, c.paper)
    worlds = arms(context, size, weights=c.weights, closely=True)
    return Paper(worlds, c.paper, c.cycles, c.iterations, context.seed)


def _newton(context: Context, searches: bool = True) -> Newton:
    c: BallConfig = context.config
    few, steps, slopes = (
        arms(context, size, weights=c.weights, closely=True)
        for size in newton.sizes(Model.load("player"), context.graph, c.newton)
    )
    return Newton(few, steps, slopes, c.newton, c.cycles, c.iterations, context.seed, searches)


def _usual(context: Context) -> Learner:
    if context.graph.ends:
        return _newton(context)
    return Usual(_newton(context, searches=False), lambda: _smc(context))


METHODS: dict[str, Callable[[Context], Learner]] = {
    "usual": _usual,
    "newton": _newton,
    "smc": _smc,
    "paper": _paper,
}
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
