"""A ball put into hands, where trajectory optimisation begins (P1 5.1): palm and fingers touch it; and balls
put out of the body, where optimisation is to lead."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from ...sims.model import Model
from ...sims.worlds import Signal, Simulation
from ...sims.worlds.places import find_place
from ..tasks.fingers import FINGERS, READY, SHARES, SIGNALS, finger_signals

CLEAR = 0.004
"""[m] that the rest of the body stays away from the ball."""
FIRM = 30.0
"""[-] how much more an overlap counts than a gap."""
FEW = 0.1
"""[-] how much less closing a hand counts than a gap, in m."""
REACH = 0.1
"""[m] as far as the ball is moved."""
STEP = 1e-3
"""[m, -] of differences."""
TRIES = 30
BAD = 2
"""Of the model's slots in which the ball touches more than a hand."""
NEAR = 0.3
"""[-] how much less it counts how far a ball is put out of the body than that it is off the palm."""
ROUNDS = 20
"""of steps that put balls out of the body"""
DAMPING = 0.03
"""of these steps, at first"""


def in_hand(model: Model, joint_q: np.ndarray, hands: np.ndarray) -> np.ndarray:
    """joint_q (nq,) with the ball against the palms and the finger tips of `hands` (2,) bool, as nearly as
    its place and the three signals of each hand's fingers allow, and clear of the rest of the body. Raises
    ValueError where no hand is to hold it."""
    if not np.any(hands):
        raise ValueError("no hand is said to hold the ball where the cycle begins")
    sides = [side for side, does in zip("lr", hands) if does]
    count = 3 + len(SIGNALS) * len(sides)
    sim = Simulation(model, 2 * count)
    places = [f"{side}_{finger}_tip" for side in sides for finger in FINGERS]
    palms = [palm for palm, does in zip(model.roles.both("palms"), hands) if does]
    ends = [find_place(model, name) for name in (*places, *palms)]
    bodies, at = [model.body(end.body) for end in ends], np.array([end.at for end in ends])
    ball = model.q_slice(model.roles.one("ball_joint")).start
    mine, away = _slots(sim)

    signals = finger_signals(model)

    def posed(rows: np.ndarray) -> np.ndarray:
        q = closed(model, signals, joint_q, hands, rows[:, 3:].reshape(len(rows), -1, len(SIGNALS)))
        q[:, ball : ball + 3] += rows[:, :3]
        return q

    def misses(rows: np.ndarray) -> np.ndarray:
        sim.reset(joint_q=posed(rows))
        body_q = sim.body_q[:, bodies].astype(float)
        turned = Rotation.from_quat(body_q[..., 3:].reshape(-1, 4)).apply(np.tile(at, (len(rows), 1)))
        where = body_q[..., :3] + turned.reshape(len(rows), -1, 3)
        gaps = np.linalg.norm(where - sim.joint_q[:, None, ball : ball + 3], axis=2) - model.ball_radius
        overlap = np.minimum(sim.contacts().gap[:, mine] - away, 0.0)
        return np.concatenate([gaps, FIRM * overlap, FEW * rows[:, 3:]], axis=1)

    steps = STEP * np.concatenate([np.eye(count), -np.eye(count)])

    def slope(x: np.ndarray) -> np.ndarray:
        ahead, behind = np.split(misses(x + steps), 2)
        return (ahead - behind).T / (2.0 * STEP)

    def miss(x: np.ndarray) -> np.ndarray:
        return np.asarray(misses(np.tile(x, (2 * count, 1)))[0])

    reach = np.repeat([REACH, 1.0 - READY], [3, count - 3]), np.repeat([REACH, READY], [3, count - 3])
    x = least_squares(
        miss,
        np.zeros(count),
        slope,
        (-reach[1], reach[0]),
        max_nfev=TRIES,
    ).x
    return posed(x[None])[0]


def put_out(model: Model, joint_q: np.ndarray, hands: np.ndarray) -> np.ndarray:
    """joint_q (n, nq) with each ball out of the body, and of the hands, as near as may be to where it was and
    to the palms of `hands` (n, 2) bool that have it: what is inferred from hands alone may lie in a thigh."""
    count, joint_q = len(joint_q), np.array(joint_q, float)
    ball = model.q_slice(model.roles.one("ball_joint")).start
    sim = Simulation(model, 4 * count)
    mine, away = _slots(sim)
    palms = [find_place(model, palm) for palm in model.roles.both("palms")]
    bodies, at = [model.body(palm.body) for palm in palms], np.array([palm.at for palm in palms])
    held = np.repeat(hands, 4, axis=0)

    def misses(x: np.ndarray) -> np.ndarray:
        q = np.repeat(joint_q, 4, axis=0)
        q[:, ball : ball + 3] += x
        sim.reset(joint_q=q)
        body_q = sim.body_q[:, bodies].astype(float)
        turned = Rotation.from_quat(body_q[..., 3:].reshape(-1, 4)).apply(np.tile(at, (len(q), 1)))
        off = body_q[..., :3] + turned.reshape(len(q), -1, 3) - q[:, None, ball : ball + 3]
        gaps = (np.linalg.norm(off, axis=2) - model.ball_radius) * held
        overlap = np.minimum(sim.contacts().gap[:, mine] - away, 0.0)
        return np.concatenate([gaps, FIRM * overlap, NEAR * x], axis=1)

    best, damping = np.zeros((count, 3)), np.full(count, DAMPING)
    x, least, errors, slope = best, np.full(count, np.inf), np.zeros(0), np.zeros(0)
    ahead = np.concatenate([np.zeros((1, 3)), STEP * np.eye(3)])
    for _ in range(ROUNDS):  # Levenberg 1944, all at once
        seen = misses((x[:, None] + ahead).reshape(-1, 3)).reshape(count, 4, -1)
        cost = np.sum(seen[:, 0] ** 2, axis=1)
        better = cost < least
        if not len(errors):
            errors, slope = seen[:, 0], (seen[:, 1:] - seen[:, :1]) / STEP
        best, least = np.where(better[:, None], x, best), np.minimum(cost, least)
        errors = np.where(better[:, None], seen[:, 0], errors)
        slope = np.where(better[:, None, None], (seen[:, 1:] - seen[:, :1]) / STEP, slope)
        damping *= np.where(better, 0.3, 4.0)
        square = np.einsum("nie,nje->nij", slope, slope) + damping[:, None, None] * np.eye(3)
        x = best - np.linalg.solve(square, np.einsum("nie,ne->ni", slope, errors)[..., None])[..., 0]
    joint_q[:, ball : ball + 3] += best
    return joint_q


def _slots(sim: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Which of the model's slots are the ball's, a mask, and how far [m] it stays away from what is there."""
    mine = np.array(["ball" in shapes for shapes in sim.contacts().shapes])
    return mine, np.where(sim.model.tables["slot_flag"] == BAD, CLEAR, 0.0)[mine]


def closed(
    model: Model, signals: Sequence[Signal], joint_q: np.ndarray, hands: np.ndarray, by: np.ndarray
) -> np.ndarray:
    """joint_q (nq,) with the fingers of `hands` (2,) bool moved along `finger_signals`, as the drives'
    targets are by offsets; by: (rows, hands that are, 3). Gives (rows, nq)."""
    q = np.tile(np.asarray(joint_q, float), (len(by), 1))
    for i, hand in enumerate(np.flatnonzero(hands)):
        for finger, shares in enumerate(SHARES):
            for name, way in signals[int(hand) * len(FINGERS) + finger].items():
                own, turn = model.q_slice(name), np.outer(by[:, i] @ shares, way)
                if model.joint_type(name) == "hinge":
                    q[:, own] += turn
                else:
                    q[:, own] = (Rotation.from_quat(q[:, own]) * Rotation.from_rotvec(turn)).as_quat()
    return q
