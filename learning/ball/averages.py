"""What the reward of P1 5.3 refers to, from a trajectory that was found (P1 5.2): where the ball is when each
fragment ends, on average, and H as hands really have the ball."""

from __future__ import annotations

import numpy as np

from ..choose import Ahead
from ..graph import STEPS
from ..rollout import Rollout
from ..tasks.arms import HELD, Arms
from ..tasks.fingers import FINGERS
from .optimised import Optimised, Playback


def averaged(task: Arms, found: Optimised) -> tuple[np.ndarray, np.ndarray]:
    """ball (fragments, 3) [m]: where it is when each fragment ends, as the task's term `ball` has it, mean of
    the times that the fragment was gone through. touch (fragments * STEPS, 2) bool: the frames of H in which
    the fingers of that hand are within 5 cm of the ball (Eq. 7), on average of the same times; those of
    checkpoints always are. What the trajectory does not come through stays as the reference has it.

    It is played back in all worlds of the task, so a task of few worlds is quickest. Raises ValueError where
    it does not play back, as on other legs."""
    graph, columns = task.graph, task.columns
    assert graph.touch is not None
    place = np.arange(task.probe.size)
    tips = np.array([[place[columns[f"to {side}_{tip}_tip"]] for tip in FINGERS] for side in "lr"])
    ball = np.zeros((graph.count, 3))
    apart = np.zeros((graph.count, STEPS, 2))
    times = np.bincount(found.k, minlength=graph.count)
    rollout = Rollout(task, Playback(found), Ahead(), found.starts(task.worlds))
    lost = False
    for step in rollout.steps(len(found)):
        lost |= bool(rollout.failed[0])
        k, felt = rollout.k[0], task.probe.read()[0].astype(float)
        apart[k, step] += np.linalg.norm(felt[tips], axis=2).mean(axis=1) - task.model.ball_radius
        if step == STEPS - 1:
            ball[k] += felt[columns["ball"]]
    if lost or rollout.failed[0]:
        raise ValueError("the trajectory does not play back in these worlds: the ball is lost")
    seen, share = times > 0, np.maximum(times, 1)
    near = (apart / share[:, None, None] <= HELD) | ~seen[:, None, None]
    ball = np.where(seen[:, None], ball / share[:, None], task.goal[:, columns["ball"]])
    return ball, graph.touch & near.reshape(-1, 2)
