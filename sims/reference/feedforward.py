"""Targets that make a drive follow a reference: damping paid in advance, and the torques that carry
the body.

A drive gives kp (target - q) - kd qd. For it to give the torque tau while q moves as the reference
does, the target has to be q + (kd qd + tau) / kp. The torques come from the bodies' weights and
accelerations as point masses, and from the ground's force on the feet, which is what moves the
centre of mass, where the zero moment point is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model, gaps, pose
from ..signals import low_pass
from .reference import Reference, integrate

SMOOTH = 8.0
"""[Hz] Motion above this gives no torque: it is noise, or too short to matter."""
STANDING = 0.04
"""[m] A foot this far up carries nothing."""
SHARE = 0.6
"""Of a joint's effort limit that targets may ask for in advance; the rest corrects errors."""
LEVER = 0.1
"""[m] farthest that the ground's force acts from the middle of a foot."""


def leading_targets(
    model: Model, reference: Reference, feet: Sequence[str] = (), root_lead: float = 0.0
) -> np.ndarray:
    """Targets (frames, nq) for a reference.

    feet: bodies that may stand on the ground; without them only the damping is paid. root_lead [s]:
    damping over stiffness of a virtual drive of the root.
    """
    kp, kd = np.zeros(model.nv), np.zeros(model.nv)
    for joint in model.joints:
        kp[joint.dof], kd[joint.dof] = joint.kp, joint.kd
    lead = np.divide(kd, kp, out=np.zeros_like(kd), where=kp > 0.0)
    lead[model.dof_slice(model.root)] = root_lead
    ahead = lead * reference.velocity(model)
    if feet:
        torque = holding_torques(model, reference, feet)
        ahead += np.divide(torque, kp, out=np.zeros_like(torque), where=kp > 0.0)
    for joint in model.joints:
        if joint.kind != "free":
            asked = np.linalg.norm(joint.kp * ahead[:, joint.dof], axis=1, keepdims=True)
            ahead[:, joint.dof] *= np.minimum(1.0, SHARE * joint.effort / np.maximum(asked, 1e-9))
    return integrate(model, reference.joint_q, ahead)


def holding_torques(model: Model, reference: Reference, feet: Sequence[str]) -> np.ndarray:
    """Joint torques (frames, nv) [N m] under which the reference carries itself; zero at free
    joints."""
    body_q = pose.forward(model, reference.joint_q)
    own = model.descendants(model.joint_body(model.root))
    turns = [Rotation.from_quat(body_q[:, b, 3:]) for b in range(model.nbody)]
    com, push = pushes(model, body_q, reference.timestep)
    ground = _ground_forces(model, body_q, com, push, [model.body(f) for f in feet])

    torque = np.zeros((reference.frame_count, model.nv))
    for joint in model.joints:
        if joint.kind == "free" or joint.body not in own:
            continue
        beyond = model.descendants(joint.body)
        at = body_q[:, joint.body, :3]
        part = [own.index(b) for b in beyond]
        needed = np.cross(com[:, part] - at[:, None], push[:, part]).sum(axis=1)
        for foot, (place, force) in ground.items():
            if foot in beyond:
                needed -= np.cross(place - at, force)
        local = turns[joint.body].inv().apply(needed)
        torque[:, joint.dof] = local @ joint.axis[:, None] if joint.kind == "hinge" else local
    return torque


def pushes(model: Model, body_q: np.ndarray, timestep: float) -> tuple[np.ndarray, np.ndarray]:
    """Of the root and what hangs on it, moving as body_q (frames, nbody, 7): centres of mass (frames, bodies,
    3) [m], and the forces (frames, bodies, 3) [N] that carry and accelerate them."""
    own, com = pose.centres_of_mass(model, body_q)
    return com, model.body_mass[own, None] * (_acceleration(com, timestep) - model.gravity)


def down(low: np.ndarray) -> np.ndarray:
    """[-] Of what may carry, from 0 to 1: how much its lowest point at height `low` [m] lets it."""
    return np.clip(1.5 - low / STANDING, 0.0, 1.0)


def _acceleration(places: np.ndarray, timestep: float) -> np.ndarray:
    """Second derivative (frames, n, 3) of smoothed places."""
    if len(places) < 32:
        return np.zeros_like(places)
    smooth = low_pass(places, 1.0 / timestep, SMOOTH)
    return np.gradient(np.gradient(smooth, timestep, axis=0), timestep, axis=0)


def _ground_forces(
    model: Model, body_q: np.ndarray, com: np.ndarray, push: np.ndarray, feet: list[int]
) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Where (frames, 3) [m] and how hard (frames, 3) [N] the ground pushes each foot.

    The whole force acts at the zero moment point; it is shared by the feet that are down, in the
    ratio that puts the point between them.
    """
    force = push.sum(axis=1)
    moment = np.cross(com, push).sum(axis=1)
    up = np.maximum(force[:, 2:], 1.0)
    point = np.concatenate([-moment[:, 1:2] / up, moment[:, :1] / up, 0.0 * up], axis=1)
    middles, standing = [], []
    for foot in feet:
        turn = Rotation.from_quat(body_q[:, foot, 3:])
        middle = body_q[:, foot, :3] + turn.apply(model.first_shape(foot).pos)
        middles.append(middle * [1.0, 1.0, 0.0])
        standing.append(down(gaps.lowest_point(model, body_q, model.descendants(foot))))
    carries = np.array(standing)
    if len(feet) == 2:
        across = middles[1] - middles[0]
        share = np.sum((point - middles[0]) * across, axis=1) / np.sum(across**2, axis=1)
        carries = carries * [np.clip(1.0 - share, 0.02, 1.0), np.clip(share, 0.02, 1.0)]
    share = carries / np.maximum(carries.sum(axis=0), 1e-9)
    off = point - sum(s[:, None] * m for s, m in zip(share, middles))
    off *= np.minimum(1.0, LEVER / np.maximum(np.linalg.norm(off, axis=1, keepdims=True), 1e-9))
    loaded = force * (force[:, 2:] > 0.0)
    return {foot: (middle + off, s[:, None] * loaded) for foot, middle, s in zip(feet, middles, share)}
