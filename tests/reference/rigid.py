"""A small rigid-body library in float64, the tests' oracle.

It reads MuJoCo's compiled model, works in link coordinates (the kernels work along the world's axes),
forms M by composite rigid bodies (RBDA table 6.2), the bias force by recursive Newton-Euler (table 5.1)
and solves the implicit drive step with a dense matrix (the kernels factor an articulated-body L^T D L).
"""

from dataclasses import dataclass, field

import numpy as np

from .spatial import (
    axis_matrix,
    crf,
    crm,
    mcI,
    quat_exp,
    quat_inv,
    quat_log,
    quat_matrix,
    quat_mul,
    rot,
    xlt,
)

FREE, BALL, HINGE, WELD = 0, 1, 3, 4
DOFS = {FREE: 6, BALL: 3, HINGE: 1, WELD: 0}


@dataclass
class Link:
    parent: int
    kind: int
    X_tree: np.ndarray
    q: int = 0
    v: int = 0
    joint: int = -1
    axis: np.ndarray | None = None
    zero: float = 0.0
    I: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))

    @property
    def dofs(self):
        return slice(self.v, self.v + DOFS[self.kind])


@dataclass
class Pose:
    """What kinematics gives, link by link, in the link's own coordinates."""

    X: list
    """from the parent"""
    X0: list
    """from the world"""
    S: list
    c: list
    """bias acceleration of the joint: cJ + v x vJ"""
    v: list


@dataclass
class Drives:
    """Per dof; `effort` per joint."""

    kp: np.ndarray
    kd: np.ndarray
    effort: np.ndarray


class Rigid:
    """A model's dynamics. q as MuJoCo's qpos, v as its qvel. mean (nv,): dofs of trees whose velocity-product
    forces are those of the mean of the velocities before and after a step; of others, of those before."""

    def __init__(self, m, mean=None):
        self.m = m
        self.mean = np.zeros(m.nv, bool) if mean is None else mean
        self.gravity = m.opt.gravity.copy()
        self.links, self.body_link, self.body_X = [], [-1], [np.eye(6)]
        for b in range(1, m.nbody):
            self._add_body(b)

    def _add_body(self, b):
        """A link per joint; a body without joints gets a link that does not move."""
        m = self.m
        parent = self.body_link[m.body_parentid[b]]
        place = rot(quat_matrix(m.body_quat[b]).T) @ xlt(m.body_pos[b])
        X = place @ self.body_X[m.body_parentid[b]]  # to this body's frame, joints at zero
        here = np.zeros(3)  # the link's origin in the body
        joints = range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
        for j in joints:
            kind = int(m.jnt_type[j])
            anchor = np.zeros(3) if kind == FREE else m.jnt_pos[j]
            q = int(m.jnt_qposadr[j])
            link = Link(parent, kind, xlt(anchor - here) @ X, q, int(m.jnt_dofadr[j]), j)
            if kind == HINGE:
                link.axis, link.zero = m.jnt_axis[j], m.qpos0[q]
            parent, here, X = len(self.links), anchor, np.eye(6)
            self.links.append(link)
        if not len(joints):
            self.links.append(Link(parent, WELD, X))
            parent = len(self.links) - 1
        self.body_link.append(parent)
        self.body_X.append(xlt(-here))
        R = quat_matrix(m.body_iquat[b])
        about_com = R @ np.diag(m.body_inertia[b]) @ R.T
        self.links[parent].I = mcI(m.body_mass[b], m.body_ipos[b] - here, about_com)

    def _joint(self, link, q, v):
        """XJ, S and cJ (RBDA table 4.1). A free joint's linear velocity is along the world's axes, so
        its S turns with the body."""
        if link.kind == HINGE:
            E = axis_matrix(link.axis, q[link.q] - link.zero).T
            return rot(E), np.r_[link.axis, 0, 0, 0][:, None], np.zeros(6)
        if link.kind == BALL:
            E = quat_matrix(q[link.q : link.q + 4]).T
            return rot(E), np.eye(6)[:, :3], np.zeros(6)
        if link.kind == FREE:
            E = quat_matrix(q[link.q + 3 : link.q + 7]).T
            S = np.zeros((6, 6))
            S[3:, :3], S[:3, 3:] = E, np.eye(3)
            linear, omega = v[link.v : link.v + 3], v[link.v + 3 : link.v + 6]
            return rot(E) @ xlt(q[link.q : link.q + 3]), S, np.r_[0, 0, 0, -np.cross(omega, E @ linear)]
        return np.eye(6), np.zeros((6, 0)), np.zeros(6)

    def pose(self, q, v=None):
        """Kinematics (RBDA 4-5)."""
        v = np.zeros(self.m.nv) if v is None else v
        p = Pose([], [], [], [], [])
        for link in self.links:
            XJ, S, cJ = self._joint(link, q, v)
            X = XJ if link.kind == FREE else XJ @ link.X_tree
            vJ = S @ v[link.dofs]
            above = np.zeros(6) if link.parent < 0 else p.v[link.parent]
            vi = X @ above + vJ
            p.X.append(X)
            p.X0.append(X if link.parent < 0 else X @ p.X0[link.parent])
            p.S.append(S)
            p.c.append(cJ + crm(vi) @ vJ)
            p.v.append(vi)
        return p

    def bodies(self, p):
        """Position and rotation matrix of every body, the world first."""
        x, R = [np.zeros(3)], [np.eye(3)]
        for b in range(1, self.m.nbody):
            X = self.body_X[b] @ p.X0[self.body_link[b]]
            E = X[:3, :3]
            r = -E.T @ X[3:, :3]  # skew(r), from X = [E 0; -E skew(r) E]
            x.append(np.array([r[2, 1], r[0, 2], r[1, 0]]))
            R.append(E.T)
        return np.array(x), np.array(R)

    def body_velocities(self, p):
        """Velocity of every body's centre of mass and its angular velocity, world axes."""
        out = [np.zeros(6)]
        _, R = self.bodies(p)
        for b in range(1, self.m.nbody):
            V = xlt(self.m.body_ipos[b]) @ self.body_X[b] @ p.v[self.body_link[b]]
            out.append(np.r_[R[b] @ V[3:], R[b] @ V[:3]])
        return np.array(out)

    def mass_matrix(self, p):
        """CRBA (RBDA table 6.2), without armature."""
        n = len(self.links)
        Ic = [link.I.copy() for link in self.links]
        M = np.zeros((self.m.nv, self.m.nv))
        for i in reversed(range(n)):
            link = self.links[i]
            if link.parent >= 0:
                Ic[link.parent] += p.X[i].T @ Ic[i] @ p.X[i]
            F = Ic[i] @ p.S[i]
            M[link.dofs, link.dofs] = p.S[i].T @ F
            j = i
            while self.links[j].parent >= 0:
                F = p.X[j].T @ F
                j = self.links[j].parent
                H = F.T @ p.S[j]
                M[link.dofs, self.links[j].dofs] = H
                M[self.links[j].dofs, link.dofs] = H.T
        return M

    def bias(self, p, gravity=True):
        """RNEA without joint accelerations (RBDA table 5.1): M vdot + bias = force."""
        a, f = [], []
        base = np.r_[0, 0, 0, -self.gravity] * gravity
        for i, link in enumerate(self.links):
            a.append(p.X[i] @ (base if link.parent < 0 else a[link.parent]) + p.c[i])
            f.append(link.I @ a[i] + crf(p.v[i]) @ link.I @ p.v[i])
        out = np.zeros(self.m.nv)
        for i in reversed(range(len(self.links))):
            link = self.links[i]
            out[link.dofs] = p.S[i].T @ f[i]
            if link.parent >= 0:
                f[link.parent] += p.X[i].T @ f[i]
        return out

    def external(self, p, force):
        """Generalised force of `force` (nbody, 3), world axes, at the bodies' centres of mass."""
        x, R = self.bodies(p)
        f = [np.zeros(6) for _ in self.links]
        for b in range(1, self.m.nbody):
            at = x[b] + R[b] @ self.m.body_ipos[b]
            wrench = np.r_[np.cross(at, force[b]), force[b]]  # about the world's origin
            f[self.body_link[b]] += np.linalg.inv(p.X0[self.body_link[b]]).T @ wrench
        out = np.zeros(self.m.nv)
        for i in reversed(range(len(self.links))):
            link = self.links[i]
            out[link.dofs] = p.S[i].T @ f[i]
            if link.parent >= 0:
                f[link.parent] += p.X[i].T @ f[i]
        return out

    # ------------------------------------------------------------------------------- conserved things

    def momentum(self, p):
        """[angular about the centre of mass; linear], world axes."""
        h = sum(X.T @ link.I @ v for X, link, v in zip(p.X0, self.links, p.v))
        return np.r_[h[:3] - np.cross(self.centre(p), h[3:]), h[3:]]

    def centre(self, p):
        """Centre of mass of everything."""
        x, R = self.bodies(p)
        at = x + np.einsum("bij,bj->bi", R, self.m.body_ipos)
        return self.m.body_mass @ at / self.m.body_mass.sum()

    def kinetic(self, p):
        return 0.5 * sum(v @ link.I @ v for link, v in zip(self.links, p.v))

    def potential(self, p):
        return -self.m.body_mass.sum() * self.gravity @ self.centre(p)

    # ------------------------------------------------------------------------------------ drives, step

    def drives(self):
        """From the model's position actuators."""
        m = self.m
        d = Drives(np.zeros(m.nv), np.zeros(m.nv), np.full(m.njnt, np.inf))
        for a in range(m.nu):
            j = m.actuator_trnid[a, 0]
            dof = m.jnt_dofadr[j] + (np.argmax(m.actuator_gear[a, :3]) if m.jnt_type[j] == BALL else 0)
            d.kp[dof], d.kd[dof] = m.actuator_gainprm[a, 0], -m.actuator_biasprm[a, 2]
            if m.actuator_forcelimited[a]:
                d.effort[j] = min(d.effort[j], m.actuator_forcerange[a, 1])
        return d

    def away(self, link, q, to):
        """From q to another position, in the coordinates of the joint's velocity."""
        k = link.q
        if link.kind == HINGE:
            return np.atleast_1d(to[k] - q[k])
        if link.kind == BALL:
            return quat_log(quat_mul(quat_inv(q[k : k + 4]), to[k : k + 4]))
        turn = quat_log(quat_mul(quat_inv(q[k + 3 : k + 7]), to[k + 3 : k + 7]))
        return np.r_[to[k : k + 3] - q[k : k + 3], turn]

    def pull(self, q, v, target, h, drives):
        """Torque of all drives at the end of the step, for the velocity v then: no effort limit."""
        f = np.zeros(self.m.nv)
        for link in self.links:
            if link.kind != WELD:
                f[link.dofs] = drives.kp[link.dofs] * self.away(link, q, target)
        return f - (drives.kd + h * drives.kp) * v

    def stiffness(self):
        """Of passive springs, per dof."""
        k = np.zeros(self.m.nv)
        for link in self.links:
            if link.kind in (BALL, HINGE):
                k[link.dofs] = self.m.jnt_stiffness[link.joint]
        return k

    def spring(self, q, v, h):
        """Passive springs' force at q + h v."""
        f = -h * self.stiffness() * v
        for link in self.links:
            if link.kind in (BALL, HINGE):
                f[link.dofs] += self.m.jnt_stiffness[link.joint] * self.away(link, q, self.m.qpos_spring)
        return f

    def passive(self, q, v, h, joint_f=0.0, force=None, after=None):
        """All but the drives at q, v: force, and the matrix that multiplies the change of v, which ends as
        `after`."""
        p = self.pose(q, v if after is None else np.where(self.mean, 0.5 * (v + after), v))
        damping = self.m.dof_damping
        f = joint_f - self.bias(p) - damping * v + self.spring(q, v, h)
        if force is not None:
            f = f + self.external(p, force)
        extra = self.m.dof_armature + h * damping + h * h * self.stiffness()
        return f, self.mass_matrix(p) + np.diag(extra)

    def system(self, q, v, target, h, drives, joint_f=0.0, force=None):
        """Mh = M + armature + h kd + h^2 kp + ..., and the free velocity v* = v + Mh^-1 h f of the
        implicit step. Effort limits do not count."""
        after, change = v, np.inf
        while change > 1e-9:
            f, M = self.passive(q, v, h, joint_f, force, after)
            Mh = M + np.diag(h * (drives.kd + h * drives.kp))
            before, after = after, v + np.linalg.solve(Mh, h * (f + self.pull(q, v, target, h, drives)))
            change = np.abs(after - before)[self.mean].max(initial=0.0)
        return Mh, after

    def exerted(self, q, v, after, h, joint_f=0.0, force=None):
        """Torque that the drives have exerted in a step that led from v to `after`, by inverse dynamics,
        and what a relative error of 1e-6 in the velocities makes of it."""
        f, M = self.passive(q, v, h, joint_f, force, after)
        return M @ (after - v) / h - f, 1e-6 * np.abs(M) @ (np.abs(after) + np.abs(v)) / h

    def obeys_effort_limits(self, q, v, after, target, h, drives, joint_f=0.0, force=None):
        """Per driven joint, whether a step kept the drives' law: the torque is what the drive's gains
        ask for at the end of the step, within the limit; or it is at the limit, where the gains ask
        for more, the same way to 0.01 rad. Returns that, and whether it is at the limit."""
        torque, error = self.exerted(q, v, after, h, joint_f, force)
        asked = self.pull(q, after, target, h, drives)
        good, full = [], []
        for link in self.links:
            J = link.dofs
            if link.kind not in (BALL, HINGE) or not drives.kp[J].any():
                continue
            limit, tolerance = drives.effort[link.joint], 10 * error[J].max() + 1e-4
            tolerance += 1e-4 * min(limit, np.linalg.norm(asked[J]))
            length = np.linalg.norm(torque[J])
            free = np.abs(torque[J] - asked[J]).max() <= tolerance and length <= limit + tolerance
            size = np.linalg.norm(asked[J])
            aside = np.linalg.norm(torque[J] - length / max(size, 1e-300) * asked[J])
            at_limit = abs(length - limit) <= tolerance and aside <= tolerance + 0.01 * limit
            at_limit = at_limit and size >= limit - tolerance
            good.append(free or at_limit)
            full.append(at_limit and not free)
        return np.array(good, bool), np.array(full, bool)

    def within_effort(self, q, v, target, h, drives):
        """v+ of the implicit step in which every drive gives what it asks for, cut to its limit's length.

        With b = h kp + kd and G = h M^-1, the torques t minimise t (G + 1 / b) t / 2 - t pull / b, pull being
        what is asked for at the velocity without drives, over the balls |t_joint| <= limit: accelerated
        projected gradients, in units of b^(1/2)."""
        f, M = self.passive(q, v, h)
        G, b = h * np.linalg.inv(M), drives.kd + h * drives.kp
        unit = np.sqrt(b)
        A = np.eye(self.m.nv) + unit[:, None] * G * unit
        pull = self.pull(q, v + G @ f, target, h, drives) / np.where(b > 0, unit, 1)
        most = np.linalg.eigvalsh(A)[-1]
        lead = (np.sqrt(most) - 1) / (np.sqrt(most) + 1)
        t, ahead, change = np.zeros(self.m.nv), np.zeros(self.m.nv), np.inf
        while change > 1e-11 * np.abs(pull).max():
            new = ahead + (pull - A @ ahead) / most
            for link in self.links:
                if link.kind in (BALL, HINGE):
                    size = np.linalg.norm(unit[link.dofs] * new[link.dofs])
                    new[link.dofs] *= min(1, drives.effort[link.joint] / max(size, 1e-300))
            t, ahead, change = new, new + lead * (new - t), np.abs(new - t).max()
        return v + G @ (f + unit * t)

    def step(self, q, v, target, h, drives, joint_f=0.0, force=None):
        """q+, v+ of one step without contacts, joint limits and effort limits."""
        v = self.system(q, v, target, h, drives, joint_f, force)[1]
        return self.integrate(q, v, h), v

    def integrate(self, q, v, h):
        q = q.copy()
        for link in self.links:
            k = link.q
            if link.kind == HINGE:
                q[k] += h * v[link.v]
            elif link.kind in (FREE, BALL):
                w = v[link.dofs][-3:]
                if link.kind == FREE:
                    q[k : k + 3] += h * v[link.v : link.v + 3]
                    k += 3
                turned = quat_mul(q[k : k + 4], quat_exp(h * w))
                q[k : k + 4] = turned / np.linalg.norm(turned)
        return q


def quaternion_starts(m):
    """Where quaternions start in qpos."""
    free, ball = m.jnt_qposadr[m.jnt_type == FREE] + 3, m.jnt_qposadr[m.jnt_type == BALL]
    return sorted([*free, *ball])


def same_signs(m, q, other):
    """qpos (n, nq) with each quaternion's sign that of another's: the same rotations."""
    q = np.array(q, float)
    for k in quaternion_starts(m):
        turned = np.sum(q[:, k : k + 4] * other[:, k : k + 4], axis=1) < 0
        q[turned, k : k + 4] *= -1
    return q


def to_mujoco(m, q):
    """joint_q (xyzw) as qpos (wxyz), float64, its quaternions normalised."""
    q = np.array(q, float)
    for k in quaternion_starts(m):
        turn = np.roll(q[..., k : k + 4], 1, axis=-1)
        q[..., k : k + 4] = turn / np.linalg.norm(turn, axis=-1, keepdims=True)
    return q


def from_mujoco(m, q):
    """qpos (wxyz) as joint_q (xyzw)."""
    q = np.array(q, float)
    for k in quaternion_starts(m):
        q[..., k : k + 4] = np.roll(q[..., k : k + 4], -1, axis=-1)
    return q


def random_state(m, rng, count, spread=1.0, speed=2.0):
    """qpos (count, nq) and qvel (count, nv): hinges normal about qpos0, orientations uniform for free
    joints, else within about `spread` rad."""
    q = np.tile(m.qpos0, (count, 1))
    for j in range(m.njnt):
        k = m.jnt_qposadr[j]
        if m.jnt_type[j] == HINGE:
            q[:, k] += spread * rng.standard_normal(count)
        elif m.jnt_type[j] == FREE:
            q[:, k : k + 3] += rng.standard_normal((count, 3))
            q[:, k + 3 : k + 7] = unit(rng.standard_normal((count, 4)))
        else:
            a = spread * rng.standard_normal((count, 3))
            q[:, k : k + 4] = [quat_exp(x) for x in a]
    return q, speed * rng.standard_normal((count, m.nv))


def unit(x):
    return x / np.linalg.norm(x, axis=-1, keepdims=True)
