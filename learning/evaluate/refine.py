"""Targets that a simulation really follows, found by trying: iterative learning control (Arimoto, Kawamura
and Miyazaki 1984).

What a drive leaves of an error is the same each time the same motion is tried, so it can be added to the
target in advance: u <- u + GAIN (e + kd / kp de/dt), which undoes the drive's lag. Errors above SMOOTH are
contacts that differ from try to try, and are left.

A root that is driven learns with the joints. Left alone it gives by millimetres, which is as much as soles
give under the whole weight: it would decide by chance which foot is pressed to the ground, and when.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...sims.model import Model, pose
from ...sims.reference import Reference
from ...sims.reference.reference import difference, integrate
from ...sims.signals import low_pass
from ..choose import Ahead
from ..graph import ControlGraph
from ..rollout import Rollout
from ..starts import Starts
from ..tasks.follow import Follow, OpenLoop
from .tracking import LIGHT

TRIES = 24
GAIN, SMOOTH = 0.6, 10.0
"""share of an error that is taken back at once; [Hz]"""
ASIDE = 50.0
"""[m] that a ball lies away while the player tries."""


def refine(
    model: Model,
    reference: Reference,
    graph: ControlGraph,
    build: Callable[[ControlGraph], Follow],
    starts: Starts,
    root_lead: float,
    progress: Callable[[int], object] | None = None,
) -> ControlGraph:
    """A clip's graph with the best targets of TRIES, each tried in the first world of what `build` makes of
    it, from `starts`. root_lead [s]: damping over stiffness of the root's drive. progress: called with the
    tries done."""
    rate, rows = 1.0 / graph.timestep, np.arange(1, len(graph.targets) + 1)
    wanted = reference.joint_q[np.minimum(rows, reference.frame_count - 1)]
    lead, driven = np.zeros(model.nv), np.zeros(model.nv, bool)
    for joint in model.joints:
        driven[joint.dof] = joint.kind != "free" and joint.kp > 0.0
        lead[joint.dof] = joint.kd / joint.kp if joint.kp > 0.0 else 0.0
    root = model.dof_slice(model.root)
    driven[root], lead[root] = True, root_lead
    places, begin = _places(model, wanted), _aside(model, starts)
    correction, tried, best, least = np.zeros((len(rows), model.nv)), graph, graph, np.inf
    for count in range(TRIES):
        went = _follow(build(tried), begin)
        if not np.isfinite(went).all():
            break
        error = float(np.mean((_places(model, went) - places) ** 2))
        if error < least:
            best, least = tried, error
        off = difference(model, went, wanted) * driven
        smooth = low_pass(off, rate, SMOOTH)
        slope = np.gradient(smooth, graph.timestep, axis=0) if len(rows) > 1 else 0.0 * smooth
        correction += GAIN * (smooth + lead * slope)
        tried = replace(graph, targets=integrate(model, graph.targets, correction))
        if progress:
            progress(count + 1)
    return best


def _follow(task: Follow, starts: Starts) -> np.ndarray:
    """(rows, nq) of the first world, after each step."""
    rollout = Rollout(task, OpenLoop(), Ahead(), starts)
    return np.array([task.sim.joint_q[0] for _ in rollout.steps(task.graph.count)], float)


def _places(model: Model, joint_q: np.ndarray) -> np.ndarray:
    """(rows, bodies, 3) [m] of bodies that are not light: half of all angles are fingers'."""
    root = model.joint_body(model.root)
    counted = [b for b in model.descendants(root) if model.body_mass[b] > LIGHT]
    return pose.forward(model, joint_q, counted)[:, counted, :3]


def _aside(model: Model, starts: Starts) -> Starts:
    """The same with the ball, where there is one, too far away to be touched."""
    if model.roles.ball_joint is None:
        return starts
    joint_q = np.array(starts.joint_q)
    joint_q[:, model.q_slice(model.roles.ball_joint).start] += ASIDE
    return replace(starts, joint_q=joint_q)
