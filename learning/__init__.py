"""Learning to move and to dribble.

Public names stand here; what is deeper may move.
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
