"""How well a motion sits on a model: distance of joints from the scaled recording, sliding and sinking feet,
joints at their limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model, gaps, pose
from .mapping import Mapping
from .reach import joint_range
from .retarget import Retargeted
from .sole import Foot, find_foot

ON_GROUND = 0.005
"""[m] A point of the sole this low carries."""
MOVING = 0.3
"""[m/s] What is that low and faster than this skims the ground."""
LIMBS = ("trunk", "hips", "knees", "feet", "shoulders", "elbows", "hands")


@dataclass(frozen=True)
class Accuracy:
    """Errors of a retargeted motion. Lengths in metres."""

    limbs: dict[str, tuple[float, float]]
    """Limb -> mean and 95th percentile of its joints' distance from the recording."""
    mean: float
    """Over all joints and frames."""
    worst: tuple[str, float]
    """The body whose joint is farthest from the recording on average, and that distance."""
    sliding: float
    """[m/s], mean horizontal speed of standing feet: of the slowest of the sole's points that touch the
    ground, as a foot that rolls or pivots has one at rest."""
    sliding_all: float
    """[m/s], the same as a mean over all points that touch, rolling and pivoting included; the
    point under the toe joint is left out, as it is of no shape."""
    sliding_worst: float
    """[m/s], 99th percentile of the same."""
    penetration: float
    """Deepest that any point of the feet is under the ground."""
    body_penetration: float
    """Deepest that any point of the whole body is under the ground."""
    off_ground: float
    """Mean height of a standing foot's lowest point: feet that are said to stand and do not."""
    skimming: float
    """Share of frames in which a foot is on the ground and all of it that is moves, standing or not."""
    standing: float
    """Share of frames with a foot on the ground."""
    limits: float
    """[rad] farthest that any joint is beyond its range."""

    @property
    def summary(self) -> str:
        """Mean and worst joint in words."""
        body, far = self.worst
        return f"{100 * self.mean:.1f} cm from the recording, the worst {100 * far:.1f} cm ({body})"


def accuracy(model: Model, result: Retargeted) -> Accuracy:
    joint_q = result.reference.joint_q
    body_q = pose.forward(model, joint_q)
    errors = {
        body: np.linalg.norm(body_q[:, model.body(body), :3] - goal, axis=1)
        for body, goal in result.goals.items()
    }
    means = {body: float(error.mean()) for body, error in errors.items()}
    worst = max(means, key=means.__getitem__)
    limbs = {}
    for limb, bodies in _limbs(model, result.mapping).items():
        apart = [error for body, error in errors.items() if body in bodies]
        if apart:
            limbs[limb] = (float(np.mean(apart)), float(np.quantile(apart, 0.95)))
    slides, strict, lows = [], [], []
    deepest, stood, skims = 0.0, np.zeros(len(joint_q), bool), np.zeros(len(joint_q), bool)
    for name, stands in result.stands.items():
        foot = find_foot(model, name)
        points = sole_points(foot, body_q)
        deepest = max(deepest, -float(points[..., 2].min()))
        skims |= skimming(points[:, :-1], model.timestep)
        for stand in stands:
            part = points[stand.first : stand.last + 1]
            stood[stand.first : stand.last + 1] = True
            lows.append(np.maximum(part[..., 2].min(axis=1), 0.0))
            touch = (part[:-1, :, 2] < ON_GROUND) & (part[1:, :, 2] < ON_GROUND)
            speed = np.linalg.norm(np.diff(part[..., :2], axis=0), axis=2) / model.timestep
            strict.append(speed[:, :-1][touch[:, :-1]])
            speed = np.where(touch, speed, np.inf).min(axis=1)
            slides.append(speed[touch.any(axis=1)])
    slide = np.concatenate(slides) if slides else np.zeros(1)
    slide = slide if len(slide) else np.zeros(1)
    every = np.concatenate(strict) if strict else np.zeros(1)
    own = model.descendants(model.joint_body(model.root))
    return Accuracy(
        limbs=limbs,
        mean=float(np.mean(list(errors.values()))),
        worst=(worst, means[worst]),
        sliding=float(slide.mean()),
        sliding_all=float(every.mean()) if len(every) else 0.0,
        sliding_worst=float(np.quantile(slide, 0.99)),
        penetration=deepest,
        body_penetration=max(0.0, -float(gaps.lowest_point(model, body_q, own).min())),
        off_ground=float(np.concatenate(lows).mean()) if lows else 0.0,
        skimming=float(skims.mean()),
        standing=float(stood.mean()),
        limits=beyond_limits(model, joint_q),
    )


def _limbs(model: Model, mapping: Mapping) -> dict[str, set[str | None]]:
    """Limb -> the bodies whose origins are its joints."""
    ends = [
        [model.body_names[body] for body in bodies]
        for hinges in (mapping.legs, mapping.arms)
        for bodies in zip(*(pose.limb_bodies(model, hinge) for hinge in hinges))
    ]
    return {limb: set(bodies) for limb, bodies in zip(LIMBS, [[model.roles.trunk, model.roles.head], *ends])}


def sole_points(foot: Foot, body_q: np.ndarray) -> np.ndarray:
    """Points of the sole (frames, 7, 3) [m]: corners of the foot's box, lowest points of the toes' ends, and
    the point under the toe joint, about which a foot pivots."""
    turn = Rotation.from_quat(body_q[:, foot.body, 3:])
    points = [body_q[:, foot.body, :3] + turn.apply(corner) for corner in foot.corners]
    turn = Rotation.from_quat(body_q[:, foot.toes, 3:])
    down = np.array([0.0, 0.0, foot.drop])
    points += [body_q[:, foot.toes, :3] + turn.apply(tip) - down for tip in (*foot.tips, np.zeros(3))]
    return np.stack(points, axis=1)


def skimming(points: np.ndarray, timestep: float) -> np.ndarray:
    """Rows (frames,) bool in which points (frames, n, 3) [m] of a sole are on the ground and none of those is
    at rest."""
    if len(points) < 2:
        return np.zeros(len(points), bool)
    speed = np.linalg.norm(np.gradient(points[..., :2], timestep, axis=0), axis=2)
    slowest = np.where(points[..., 2] < ON_GROUND, speed, np.inf).min(axis=1)
    return np.isfinite(slowest) & (slowest > MOVING)


def beyond_limits(model: Model, joint_q: np.ndarray) -> float:
    """[rad] farthest that any joint of joint_q (frames, nq) is beyond its range."""
    worst = 0.0
    for joint in model.joints:
        low, high = joint_range(joint)
        q = joint_q[:, joint.q]
        if joint.kind == "hinge":
            worst = max(worst, float((q - high).max()), float((low - q).max()))
        elif joint.kind == "ball":
            worst = max(worst, float(Rotation.from_quat(q).magnitude().max() - high))
    return worst
