"""What trajectory optimisation finds: a long sequence of actions, open loop, under which a player keeps the
ball, and the states that it comes through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from ...sims.planar import turned
from ..arrays import Arrays
from ..choose import Ahead
from ..rollout import Rollout
from ..starts import Starts
from ..tasks.arms import Arms


@dataclass(frozen=True)
class Optimised:
    """Fragments in a row, as many as were found so far."""

    k: np.ndarray
    """(n,) fragments of the graph"""
    action: np.ndarray
    """(n, 20) what was done in each [rad; fingers: share of the way to a fist]"""
    joint_q: np.ndarray
    """(n, nq) where each began [m, rad, -], as simulated: the player walks on over the ground"""
    joint_qd: np.ndarray
    """(n, nv) [m/s, rad/s]"""
    fingers: np.ndarray
    """(n,) [m] mean distance of the fingers from the ball in H (Eq. 7), NaN where H has no frame"""

    def __len__(self) -> int:
        return len(self.k)

    @staticmethod
    def joined(parts: Sequence[Optimised]) -> Optimised:
        """One after the other."""
        return Optimised(*(np.concatenate([vars(p)[f.name] for p in parts]) for f in fields(Optimised)))

    @property
    def arrays(self) -> Arrays:
        """By name, for a file."""
        return dict(vars(self))

    @property
    def result(self) -> Arrays | None:
        """Of a stage: the arrays, and the state that it starts from; None where nothing was found."""
        if not len(self):
            return None
        return self.arrays | {f"states.{name}": part for name, part in vars(self.starts(1)).items()}

    def starts(self, worlds: int) -> Starts:
        """Its first state, for each of some worlds."""
        return Starts(*(np.repeat(x[:1], worlds, axis=0) for x in (self.k, self.joint_q, self.joint_qd)))

    @staticmethod
    def of(arrays: Arrays) -> Optimised:
        return Optimised(*(np.asarray(arrays[f.name]) for f in fields(Optimised)))

    def last(self, count: int) -> Optimised:
        """The last `count` fragments of it, or all."""
        return Optimised(*(x[max(0, len(self) - count) :] for x in vars(self).values()))

    def distance(self, count: int) -> np.ndarray:
        """(cycles,) [m] mean distance of the fingers in H over each whole cycle of `count` fragments: the
        first term of Eq. 6."""
        whole = len(self) // count * count
        return np.asarray(np.nanmean(self.fingers[:whole].reshape(-1, count), axis=1))

    def offsets(self, active: np.ndarray) -> np.ndarray:
        """(n,) mean length of the offsets chi of the arms that act on the ball (Fig. 11); active (n, 20)."""
        arms = active.reshape(len(self), 2, -1)[:, :, 0]
        length = np.linalg.norm(self.action.reshape(len(self), 2, -1), axis=2)
        return np.asarray((length * arms).sum(axis=1) / np.maximum(arms.sum(axis=1), 1))


class Playback:
    """The controller that does what was found, from its first fragment on, whatever happens; then nothing."""

    def __init__(self, found: Optimised):
        self.found, self.row = found, 0

    def begin(self) -> None:
        """From its first fragment again."""
        self.row = 0

    def act(self, obs: np.ndarray, k: np.ndarray) -> np.ndarray:
        action = np.zeros((len(k), self.found.action.shape[1]))
        if self.row < len(self.found):
            action[:] = self.found.action[self.row]
        self.row += 1
        return action


def played(task: Arms, found: Optimised, fragments: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Play it back in all worlds of a task from its first state: for how many fragments (worlds,) nothing is
    lost, and the fingers' distance (fragments,) in the first world."""
    count = len(found) if fragments is None else fragments
    rollout, fingers = Rollout(task, Playback(found), Ahead(), found.starts(task.worlds)), []
    stands, lived = np.ones(task.worlds, bool), np.zeros(task.worlds, int)
    for fragment in rollout.fragments(count):
        stands &= ~fragment.failed
        lived += stands
        fingers.append(task.fingers[0])
    return lived, np.array(fingers)


def states_of(task: Arms, found: Optimised) -> Starts:
    """The states that it comes through (n,), to start from: where the reference begins each fragment, and as
    far off its heading as it is."""
    turns = task.turns[found.k]
    faced = task.begins[found.k[0]] + np.concatenate([[0.0], np.cumsum(turns[:-1])])
    by = task.begins[found.k] - faced
    place = task.graph.start_q[found.k, :2]
    return Starts(found.k, *turned(found.joint_q, found.joint_qd, by, place, task.loose))


def observed(task: Arms, starts: Starts) -> np.ndarray:
    """(n, obs) what a policy feels in given states, in so many worlds at a time as the task has."""
    out = []
    for first in range(0, len(starts), task.worlds):
        rows = np.minimum(np.arange(first, first + task.worlds), len(starts) - 1)
        some = starts[rows]
        task.reset(some)
        out.append(task.observe(some.k))
    return np.concatenate(out)[: len(starts)]
