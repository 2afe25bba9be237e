"""The same motion begun with small variations of the ball, side by side: a ball that nobody controls is in
play the longer the luckier it starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from ...sims.ball import Ball
from ...sims.model import Model
from ...sims.reference import Reference
from ...sims.reference.soles import pressed
from ...sims.trajectory import Trajectory
from ..graph import ControlGraph, clip_graph
from ..starts import Starts
from ..tasks.follow import Follow
from .refine import refine

TRIES = 16
"""Starts of the ball; a vector unit steps as many worlds in the time of one."""
ROOT_DRIVE = (300e3, 30e3, 60e3, 6e3)
"""Virtual gains of a tracked root: [N/m], [N s/m], [N m/rad], [N m s/rad]. The rates are a tenth
of the stiffnesses, as with the player's joints, so that one lead in time makes up for all their
damping."""
STRIDE, LOW, SETTLED = 0.9, 0.3, 0.6
"""[m], [m], [s] A ball is out of play that is farther than the first from the root, or that stays below the
second for the third."""


def follow(
    model: Model,
    reference: Reference,
    worlds: int,
    root: Literal["free", "tracked"] = "free",
    device: str = "cpu",
    progress: Callable[[int], object] | None = None,
) -> Follow:
    """Worlds that follow a reference from its first row to its last. root "tracked": virtual forces hold the
    root to it, too, which carry the player's weight where its feet do not, and the targets are those that
    `refine` finds, with the feet pressed to the ground as they have to be to carry it. progress: of
    `refine`."""
    if root == "free":
        return Follow(model, clip_graph(model, reference, model.roles.feet), worlds, device)

    return _held(model, tracked_graph(model, reference, device, progress=progress), worlds, device)


def tracked_graph(
    model: Model,
    reference: Reference,
    device: str = "cpu",
    ball: Ball | None = None,
    progress: Callable[[int], object] | None = None,
) -> ControlGraph:
    """A reference as a graph whose root is held, with the targets that `refine` finds. ball: who plays with
    it when. progress: of `refine`."""
    lead = ROOT_DRIVE[1] / ROOT_DRIVE[0]
    graph = replace(clip_graph(model, reference, (), lead, ball), tracked=True)
    begin = starts(model, reference, 1, ball=False)
    wanted = pressed(model, reference)
    return refine(model, wanted, graph, lambda g: _held(model, g, 1, device), begin, lead, progress)


def _held(model: Model, graph: ControlGraph, worlds: int, device: str) -> Follow:
    task = Follow(model, graph, worlds, device)
    task.sim.set_root_drive(*ROOT_DRIVE)
    return task


def starts(model: Model, reference: Reference, worlds: int, ball: bool) -> Starts:
    """The first row of a reference for every world. ball: the ball moves as in the reference, in all worlds
    but the first with a small, fixed variation."""
    joint_q = np.tile(reference.joint_q[0], (worlds, 1))
    joint_qd = np.tile(reference.velocity(model)[0], (worlds, 1))
    if ball:
        joint = model.roles.one("ball_joint")
        q, dof = model.q_slice(joint).start, model.dof_slice(joint).start
        path = reference.joint_q[:2, q : q + 3]
        vary = np.random.default_rng(0).uniform(-1.0, 1.0, (worlds, 6))
        vary[0] = 0.0
        joint_q[:, q : q + 3] = path[0] + vary[:, :3] * [0.015, 0.015, 0.0]
        joint_q[:, q + 3 : q + 7] = [0.0, 0.0, 0.0, 1.0]
        joint_qd[:, dof : dof + 3] = (path[1] - path[0]) / reference.timestep
        joint_qd[:, dof : dof + 3] += vary[:, 3:] * [0.1, 0.1, 0.2]
        joint_qd[:, dof + 3 : dof + 6] = 0.0
    return Starts(np.zeros(worlds, int), joint_q, joint_qd)


def longest_in_play(model: Model, seen: list[Trajectory]) -> Trajectory:
    """The one whose ball stays in play longest, the first where there is no ball. Raises FloatingPointError
    for none, as all have become non-finite."""
    if not seen:
        raise FloatingPointError("the simulation broke down (non-finite state)")
    if model.roles.ball is None:
        return seen[0]
    return max(seen, key=lambda one: time_in_play(model, one))


def time_in_play(model: Model, seen: Trajectory) -> int:
    """Frames until the ball is more than a stride from the player's root or has stopped bouncing."""
    ball = seen.body_q[:, model.body(model.roles.one("ball")), :3]
    root = seen.body_q[:, model.body(model.roles.one("root_body")), :3]
    lost = np.linalg.norm((ball - root)[:, :2], axis=-1) > STRIDE
    window = int(SETTLED / seen.timestep)
    settled = np.cumsum((ball[:, 2] < LOW).astype(int))
    settled[window:] -= settled[:-window].copy()
    lost |= settled >= window
    return int(lost.argmax()) if lost.any() else len(lost)
