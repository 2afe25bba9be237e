"""Learning to move and to dribble. Public names stand here; what is deeper may move.

The papers' letters (P1: Liu and Hodgins 2018, with Liu et al. 2016 for locomotion), and where they are:

| letter | here | meaning |
|---|---|---|
| C_k, m_k | `graph.ControlGraph` | a control fragment of 0.05 s, and its piece of motion |
| pi_k, M_k, a_hat_k, sigma_k | `LinearPolicy` | the policy of a fragment, a = M_k s + a_hat_k (Eq. 4) |
| s | `obs`, `Task.observe` | the reduced state that a policy sees at a fragment's start |
| a | `action`, `Course.offset` | what turns the drives' targets throughout a fragment |
| E | `cost`, `Task.judge` | what a fragment cost |
| w | `policies.em.Moments` | descendants of an action, its weight in the regression |
| N_s, n_save | `SamconConfig.particles`, `keep` | samples of a fragment, and how many of them go on |
| H | `sims.Ball.touch` | when which hand has the ball, the soft set |
| h_ref | `sims.Ball.heights` | the ball's height at each of its `checkpoints` (Eq. 8) |
"""

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .choose import Ahead, Commanded, RandomWalk
    from .evaluate.trials import Trials, run_trials
    from .graph import ControlGraph, Span, clip_graph, cyclic_graph, joined
    from .methods import STAGES
    from .policies.linear import LinearPolicy
    from .rollout import Controller, Fragment, Rollout
    from .runs.folder import Learned, Run
    from .runs.stage import Context, Learner, Report, Stage
    from .runs.train import train
    from .starts import Starts, Streams, reference_starts
    from .tasks.disturbance import Disturbance
    from .tasks.follow import Follow, OpenLoop
    from .tasks.locomotion import Locomotion, locomotion_model

__all__ = [
    "STAGES",
    "Ahead",
    "Commanded",
    "Context",
    "ControlGraph",
    "Controller",
    "Disturbance",
    "Follow",
    "Fragment",
    "Learned",
    "Learner",
    "LinearPolicy",
    "Locomotion",
    "OpenLoop",
    "RandomWalk",
    "Report",
    "Rollout",
    "Run",
    "Span",
    "Stage",
    "Starts",
    "Streams",
    "Trials",
    "clip_graph",
    "cyclic_graph",
    "joined",
    "locomotion_model",
    "reference_starts",
    "run_trials",
    "train",
]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".choose": "Ahead Commanded RandomWalk",
        ".evaluate.trials": "Trials run_trials",
        ".graph": "ControlGraph Span clip_graph cyclic_graph joined",
        ".methods": "STAGES",
        ".policies.linear": "LinearPolicy",
        ".rollout": "Controller Fragment Rollout",
        ".runs.folder": "Learned Run",
        ".runs.stage": "Context Learner Report Stage",
        ".runs.train": "train",
        ".starts": "Starts Streams reference_starts",
        ".tasks.disturbance": "Disturbance",
        ".tasks.follow": "Follow OpenLoop",
        ".tasks.locomotion": "Locomotion locomotion_model",
    },
)
