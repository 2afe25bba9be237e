"""From one skill to another (P1 6): where their references are alike, and bridges of a few fragments over
which one becomes the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..sims.model import Model, pose
from ..sims.planar import over_ground, planar, relative, rotation
from ..sims.reference.feedforward import leading_targets
from ..sims.reference.reference import Reference, difference, integrate
from ..sims.signals import smoothstep
from .graph import STEPS, ControlGraph, central_velocity, cut, joined

BLEND = 3
"""Fragments of a bridge."""
AROUND = 4
"""Fragments before and after a bridge that its targets and velocities are smooth with."""
TIME = 0.1
"""[s] by which velocities count beside places."""
INSTANT = 1e-3
"""[s] over which places are differentiated."""


@dataclass(frozen=True)
class Link:
    """A way from one graph to another: which of them, the last fragment of the one and the first of the
    other, and how far they are apart [m]."""

    start: int
    leaves: int
    goal: int
    enters: int
    apart: float = 0.0


def apart(model: Model, a: ControlGraph, b: ControlGraph) -> np.ndarray:
    """(a.count, b.count) [m] how far the states in which fragments of a begin are from those of b, seen from
    where each player stands and faces: the root mean square distance of the bodies, that of their velocities
    times TIME, and as much again for the farthest foot and for the ball. Infinite where another hand should
    have the ball."""
    (x, v), (y, w) = (_seen(model, graph) for graph in (a, b))
    own, feet = _bodies(model), [model.body(name) for name in model.roles.both("feet")]
    there = np.linalg.norm(x[:, None] - y[None], axis=-1) ** 2
    there += TIME**2 * np.linalg.norm(v[:, None] - w[None], axis=-1) ** 2
    far = np.sqrt(there[..., own].mean(axis=-1)) + np.sqrt(there[..., feet].max(axis=-1))
    if a.touch is not None and b.touch is not None:
        far += np.sqrt(there[..., model.body(model.roles.one("ball"))])
        held, has = (touch.reshape(-1, STEPS, 2)[:, 0] for touch in (a.touch, b.touch))
        far[(held[:, None] != has[None]).any(axis=-1)] = np.inf
    return far


def _bodies(model: Model) -> list[int]:
    """Those of the player, without fingers, which are many."""
    return [
        body
        for body in model.descendants(model.joint_body(model.root))
        if not any(
            finger in model.body_names[body] for finger in ("thumb", "index", "middle", "ring", "pinky")
        )
    ]


def _seen(model: Model, graph: ControlGraph) -> tuple[np.ndarray, np.ndarray]:
    """Places (fragments, bodies, 3) [m] and velocities [m/s] of all bodies where fragments begin, from the
    ground below the root."""
    now = pose.forward(model, graph.start_q)[..., :3]
    soon = pose.forward(model, integrate(model, graph.start_q, INSTANT * graph.start_qd))[..., :3]
    way = planar(graph.start_q)
    now, speed = now - np.pad(way[:, None, :2], ((0, 0), (0, 0), (0, 1))), (soon - now) / INSTANT
    for x in (now, speed):
        for row, turn in zip(x, way[:, 2]):
            row[:, :2] = row[:, :2] @ rotation(turn)
    return now, speed


def alike(
    model: Model, a: ControlGraph, b: ControlGraph, count: int = BLEND
) -> tuple[np.ndarray, np.ndarray]:
    """For each fragment (a.count,) of a cycle the fragment of another to go on with, after a bridge of
    `count` fragments, and how far the two are apart on average while it lasts [m]."""
    far = apart(model, a, b)
    i, j = np.arange(a.count), np.arange(b.count)
    along = sum(far[np.ix_((i + 1 + t) % a.count, (j - count + t) % b.count)] for t in range(count + 1))
    best = np.argmin(along, axis=1)
    return best, np.asarray(along)[i, best] / (count + 1)


def find(
    model: Model, graphs: Sequence[ControlGraph], within: float = 0.3, most: int = 2, count: int = BLEND
) -> list[Link]:
    """The ways from each cycle to each other one: for every two the `most` at which they are most alike, at
    least a quarter of a cycle from each other, as far as they are nearer than `within` [m]."""
    links = []
    for s, a in enumerate(graphs):
        for g, b in enumerate(graphs):
            if s == g:
                continue
            enters, far = alike(model, a, b, count)
            chosen: list[int] = []
            for leaves in np.argsort(far, kind="stable"):
                gaps = [abs((leaves - other + a.count // 2) % a.count - a.count // 2) for other in chosen]
                if far[leaves] <= within and len(chosen) < most and min(gaps, default=a.count) >= a.count / 4:
                    chosen.append(int(leaves))
            links += [Link(s, i, g, int(enters[i]), float(far[i])) for i in chosen]
    return links


def linked(
    model: Model, graphs: Sequence[ControlGraph], links: Sequence[Link], count: int = BLEND
) -> ControlGraph:
    """Cycles and the bridges between them as one graph; bridges are its last spans."""
    bridges = [
        bridge(model, graphs[link.start], link.leaves, graphs[link.goal], link.enters, count)
        for link in links
    ]
    first = len(graphs)
    ways = [((link.start, link.leaves), (first + n, 0)) for n, link in enumerate(links)]
    ways += [((first + n, count - 1), (link.goal, link.enters)) for n, link in enumerate(links)]
    whole = joined([*graphs, *bridges], ways)
    itself = whole.edges[:, 0] == whole.edges[:, 1]  # where a bridge ended, before it led anywhere
    return replace(whole, edges=whole.edges[~itself])


def bridge(
    model: Model, a: ControlGraph, leaves: int, b: ControlGraph, enters: int, count: int = BLEND
) -> ControlGraph:
    """`count` fragments that begin where fragment `leaves` of a cycle ends and end where fragment `enters` of
    another begins, going over from the one's motion to the other's; the last follows itself. Hands have the
    ball as in the one's first half and the other's second. Feet go over like all else: those that stand
    apart slide."""
    ahead, lead = (leaves + 1) % a.count, (enters - count) % b.count
    one = unrolled(model, a, (ahead - AROUND) % a.count, AROUND + count)
    two = unrolled(model, b, lead, count + AROUND)
    begins, rows = AROUND * STEPS, count * STEPS
    middle = rows // 2
    two = moved(model, two, planar(two)[middle], planar(one)[begins + middle])
    share = smoothstep(np.arange(rows + 1) / rows)[:, None]
    between = one[begins:]
    between = integrate(model, between, share * difference(model, between, two[: rows + 1]))
    whole = Reference(np.concatenate([one[:begins], between, two[rows + 1 :]]), a.timestep)
    own = slice(begins, begins + rows + 1)
    speed = central_velocity(model, whole)[own]
    targets = leading_targets(model, whole, model.roles.both("feet"))[own]
    after = np.minimum(np.arange(count) + 1, count - 1)
    names = [graph.spans[0].name for graph in (a, b)]
    made = cut(between, speed, targets, a.timestep, after, f"{names[0]} > {names[1]}")
    if a.touch is None or b.touch is None:
        return made
    half = (rows + 1) // 2
    parts = [(a, ahead * STEPS, 0, half), (b, lead * STEPS, half, rows)]
    touch = np.zeros((rows, 2), bool)
    marks, heights = [], []
    for graph, first, start, end in parts:
        assert graph.touch is not None and graph.checkpoints is not None and graph.heights is not None
        row = np.arange(start, end)
        there = (first + row) % (graph.count * STEPS)
        touch[row] = graph.touch[there]
        for mark, height in zip(graph.checkpoints, graph.heights):
            marks += row[there == mark].tolist()
            heights += [float(height)] * int((there == mark).sum())
    return replace(made, touch=touch, checkpoints=np.array(marks, int), heights=np.array(heights, float))


def unrolled(model: Model, graph: ControlGraph, first: int, count: int) -> np.ndarray:
    """The reference (count * STEPS + 1, nq) through so many fragments of a cycle in a row, each where the one
    before has ended."""
    rows, k = graph.rows(model, first), first
    for _ in range(count - 1):
        k = (k + 1) % graph.count
        on = graph.rows(model, k)
        rows = np.concatenate([rows, moved(model, on, planar(on)[0], planar(rows)[-1])[1:]])
    return rows


def moved(model: Model, joint_q: np.ndarray, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Rows (n, nq) taken over the ground, so that who is at the planar pose `start` (3,) is at `goal`."""
    joint_q = joint_q.copy()
    turn = float(relative(start[None], goal[None])[0, 2])
    for joint in model.joints:
        if joint.kind == "free":
            joint_q[:, joint.q] = over_ground(joint_q[:, joint.q], start[:2], goal[:2], turn)
    return joint_q
