"""Spatial algebra in float64, in the names of Featherstone's spatial_v2.

Spatial vectors are [angular; linear]. `X` from A to B turns motion vectors in A's coordinates into B's.
Quaternions here are wxyz, as MuJoCo's.
"""

import numpy as np


def skew(v):
    """skew(v) w = v x w."""
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0.0]])


def rot(E):
    """Transform to axes turned by E, E taking A's coordinates to B's (RBDA 2.24)."""
    return np.block([[E, np.zeros((3, 3))], [np.zeros((3, 3)), E]])


def xlt(r):
    """Transform to an origin at r (RBDA 2.24)."""
    return np.block([[np.eye(3), np.zeros((3, 3))], [-skew(r), np.eye(3)]])


def crm(v):
    """crm(v) m = v x m for motions (RBDA 2.31)."""
    return np.block([[skew(v[:3]), np.zeros((3, 3))], [skew(v[3:]), skew(v[:3])]])


def crf(v):
    """crf(v) f = v x* f for forces (RBDA 2.32)."""
    return -crm(v).T


def mcI(mass, c, I):
    """Spatial inertia from mass, centre of mass c and rotational inertia I about it (RBDA 2.63)."""
    C = skew(c)
    return np.block([[I + mass * C @ C.T, mass * C], [mass * C.T, mass * np.eye(3)]])


def quat_mul(a, b):
    w, x, y, z = a
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]]) @ b


def quat_inv(q):
    return q * [1, -1, -1, -1]


def quat_matrix(q):
    """R: coordinates in the turned axes to those outside."""
    w, v = q[0], q[1:]
    return np.eye(3) + 2 * w * skew(v) + 2 * skew(v) @ skew(v)


def quat_exp(a):
    """Quaternion of a rotation vector."""
    angle = np.linalg.norm(a)
    if angle < 1e-12:
        return np.array([1, *(0.5 * np.asarray(a))])
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) / angle * np.asarray(a))])


def quat_log(q):
    """Rotation vector, of length at most pi."""
    q = q if q[0] >= 0 else -q
    s = np.linalg.norm(q[1:])
    return 2 * q[1:] if s < 1e-12 else 2 * np.arctan2(s, q[0]) / s * q[1:]


def axis_matrix(axis, angle):
    """Rotation about a unit axis (Rodrigues)."""
    K = skew(axis)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
