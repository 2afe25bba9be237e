"""What is felt of a player in float64: places that `sims.model.pose` gives, and their differences in time."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from warpdribble.sims.model import Model, pose
from warpdribble.sims.reference.reference import integrate
from warpdribble.sims.worlds.places import Place


def poses(model, random, count, spread=0.5):
    """(count, nq) about the start pose, in any place, facing anywhere and leaning a little."""
    q = integrate(
        model, np.tile(model.start_q, (count, 1)), spread * random.standard_normal((count, model.nv))
    )
    q[:, :3] = random.uniform([-6, -6, 0.3], [6, 6, 2.0], (count, 3))
    lean = Rotation.from_rotvec(random.uniform(-0.5, 0.5, (count, 3)))
    q[:, 3:7] = (Rotation.from_euler("z", random.uniform(-np.pi, np.pi, (count, 1))) * lean).as_quat()
    return q.astype(np.float32)


def unit(model, q):
    """joint_q with quaternions of unit length, as exactly as its numbers are."""
    q = q.copy()
    for k in model.quaternions():
        q[:, k : k + 4] /= np.linalg.norm(q[:, k : k + 4], axis=1, keepdims=True)
    return q


def moved(model, q, qd, turn, shift):
    """All turned about the origin by headings `turn` (worlds,) [rad], then shifted by (worlds, 3) [m]."""
    q, qd, turn = q.astype(float), qd.astype(float), Rotation.from_euler("z", np.reshape(turn, (-1, 1)))
    for joint in (joint for joint in model.joints if joint.kind == "free"):
        a, b, v = joint.q.start, joint.q.start + 3, joint.dof.start
        q[:, a:b] = turn.apply(q[:, a:b]) + shift
        q[:, b : b + 4] = (turn * Rotation.from_quat(q[:, b : b + 4])).as_quat()
        qd[:, v : v + 3] = turn.apply(qd[:, v : v + 3])
    return q, qd


@dataclass
class Bodies:
    """Frames and velocities of all bodies, along the world's axes."""

    model: Model
    body_q: np.ndarray
    """(worlds, nbody, 7) [m, -]"""
    velocity: np.ndarray
    """(worlds, nbody, 3) of their centres of mass [m/s]"""
    spin: np.ndarray
    """(worlds, nbody, 3) [rad/s]"""
    scale: np.ndarray | float = 1.0
    """(worlds, nbody) of masses and inertias"""

    @property
    def R(self):
        """(worlds, nbody, 3, 3)"""
        return turns(self.body_q).as_matrix().reshape(*self.body_q.shape[:2], 3, 3)

    @property
    def centres(self):
        """(worlds, nbody, 3) of mass [m]"""
        return centres(self.model, self.body_q)

    def at(self, where):
        """(worlds, 3) a place [m]"""
        return spot(self.model, self.body_q, where)

    @property
    def own(self):
        """Bodies that are the player's, its root first."""
        return self.model.descendants(self.model.joint_body(self.model.joint_names[0]))

    def facing(self, v):
        """A vector (worlds, 3) of the world in the facing frame."""
        R = self.R[:, self.own[0]]
        return Rotation.from_euler("z", -np.arctan2(R[:, 1, 0], R[:, 0, 0])[:, None]).apply(v)

    @property
    def ground(self):
        """(worlds, 3) below the root [m]"""
        return self.body_q[:, self.own[0], :3] * [1, 1, 0]

    def whole(self):
        """Centre of mass [m], its velocity [m/s], and the angular momentum about it [kg m^2/s]."""
        own, R = self.own, self.R
        mass = np.broadcast_to(self.scale * self.model.body_mass, self.body_q.shape[:2])[:, own, None]
        scale = np.broadcast_to(self.scale, self.body_q.shape[:2])[:, own, None, None]
        centre, velocity, spin = self.centres[:, own], self.velocity[:, own], self.spin[:, own]
        com = (mass * centre).sum(axis=1) / mass.sum(axis=1)
        com_velocity = (mass * velocity).sum(axis=1) / mass.sum(axis=1)
        inertia = scale * (R @ self.model.body_inertia @ R.swapaxes(-1, -2))[:, own]
        L = np.cross(centre - com[:, None], mass * velocity).sum(axis=1)
        return com, com_velocity, L + np.einsum("wbij,wbj->wi", inertia, spin)


def turns(body_q):
    return Rotation.from_quat(body_q[..., 3:].reshape(-1, 4))


def centres(model, body_q):
    off = turns(body_q).apply(np.tile(model.body_com, (len(body_q), 1)))
    return body_q[..., :3] + off.reshape(len(body_q), -1, 3)


def spot(model, body_q, where):
    """(worlds, 3) of a place [m]: a `Place`, a site, or the middle of a body's first shape."""
    if isinstance(where, Place):
        body, at = model.body(where.body), where.at
    elif where in model.sites:
        body, at, _ = model.sites[where]
    else:
        body = model.body(where)
        at = next(s.pos for s in model.shapes if s.body == body)
    frame = body_q[:, body]
    return frame[:, :3] + Rotation.from_quat(frame[:, 3:]).apply(np.asarray(at))


STEP = 1e-5
"""[s] of a difference in time: in float64 it leaves errors of about 1e-9."""


def around(model, q, qd):
    """Body frames now, and a moment before and after."""
    q = unit(model, q.astype(float))
    return (pose.forward(model, integrate(model, q, t * STEP * qd.astype(float))) for t in (0, -1, 1))


def moving(model, q, qd):
    """The `Bodies` of joint_q, joint_qd."""
    now, before, after = around(model, q, qd)
    velocity = (centres(model, after) - centres(model, before)) / (2 * STEP)
    spin = (turns(after) * turns(before).inv()).as_rotvec() / (2 * STEP)
    return Bodies(model, now, velocity, spin.reshape(velocity.shape))


def speed(model, q, qd, where):
    """(worlds, 3) velocity of a place [m/s]."""
    _, before, after = around(model, q, qd)
    return (spot(model, after, where) - spot(model, before, where)) / (2 * STEP)


def apart(model, q, qd, goal_q, goal_qd, joints):
    """(worlds, 2) mean angle [rad] and mean rate [rad/s] between joints and their goals."""
    angle, rate = [], []
    for name in joints:
        place = model.q_slice(name)
        if model.joint_type(name) == "hinge":
            angle.append(np.abs(q[:, place] - goal_q[:, place])[:, 0])
        else:
            now, goal = (Rotation.from_quat(x[:, place]) for x in (q, goal_q))
            angle.append((now * goal.inv()).magnitude())
        dofs = model.dof_slice(name)
        rate.append(np.linalg.norm(qd[:, dofs] - goal_qd[:, dofs], axis=1))
    return np.stack([np.mean(angle, axis=0), np.mean(rate, axis=0)], axis=1)
