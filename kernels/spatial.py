"""Vectors, rotations and spatial quantities over `Real`, in Featherstone's letters.

Everything is expressed along the axes of the world. A spatial quantity of a link is taken about that
link's own origin, so that float32 tells it as well far from the world's (a place it does not, see
`Tree.far`); `shift_*` moves one from a link to its parent. Numbers in brackets are equations of
Featherstone, *Rigid Body Dynamics Algorithms* (2008).

| letter | type | meaning |
|---|---|---|
| R | Mat3 | rotation from the link's axes to the world's |
| r | Vec3 | from the parent's origin to the link's [m] |
| V | Motion | angular velocity [rad/s], velocity of the origin [m/s] |
| F, p | Force | moment about the origin [N m], force [N]; or impulses |
| I | Inertia | (articulated) inertia, [[A, B], [B^T, M]] [7.8] |
"""

import warp as wp

from .lanes import *


@wp.struct
class Vec3:
    x: Real
    y: Real
    z: Real


@wp.struct
class Quat:
    x: Real
    y: Real
    z: Real
    w: Real


@wp.struct
class Mat3:
    """Rows of a 3 x 3 matrix."""

    xx: Real
    xy: Real
    xz: Real
    yx: Real
    yy: Real
    yz: Real
    zx: Real
    zy: Real
    zz: Real


@wp.struct
class Sym3:
    """A symmetric 3 x 3 matrix."""

    xx: Real
    xy: Real
    xz: Real
    yy: Real
    yz: Real
    zz: Real


@wp.struct
class Motion:
    w: Vec3
    v: Vec3


@wp.struct
class Force:
    n: Vec3
    f: Vec3


@wp.struct
class Inertia:
    A: Sym3
    B: Mat3
    M: Sym3


# -------------------------------------------------------------------------------------- three vectors


@wp.func
def vec3(a: wp.vec3) -> Vec3:
    """The same plain vector in every lane."""
    return Vec3(fill(a[0]), fill(a[1]), fill(a[2]))


@wp.func
def zero3() -> Vec3:
    return Vec3(fill(0.0), fill(0.0), fill(0.0))


@wp.func
def unit3(i: int) -> Vec3:
    """Axis i."""
    if i == 0:
        return Vec3(fill(1.0), fill(0.0), fill(0.0))
    if i == 1:
        return Vec3(fill(0.0), fill(1.0), fill(0.0))
    return Vec3(fill(0.0), fill(0.0), fill(1.0))


@wp.func
def add(a: Vec3, b: Vec3) -> Vec3:
    return Vec3(a.x + b.x, a.y + b.y, a.z + b.z)


@wp.func
def sub(a: Vec3, b: Vec3) -> Vec3:
    return Vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@wp.func
def mul(k: Real, a: Vec3) -> Vec3:
    return Vec3(k * a.x, k * a.y, k * a.z)


if LANES > 1:

    @wp.func
    def mul(k: float, a: Vec3) -> Vec3:
        return Vec3(k * a.x, k * a.y, k * a.z)


@wp.func
def neg(a: Vec3) -> Vec3:
    return Vec3(neg(a.x), neg(a.y), neg(a.z))


@wp.func
def dot(a: Vec3, b: Vec3) -> Real:
    return a.x * b.x + a.y * b.y + a.z * b.z


@wp.func
def cross(a: Vec3, b: Vec3) -> Vec3:
    return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@wp.func
def norm(a: Vec3) -> Real:
    return sqrt(dot(a, a))


@wp.func
def where_lt(a: Real, b: Real, x: Vec3, y: Vec3) -> Vec3:
    return Vec3(where_lt(a, b, x.x, y.x), where_lt(a, b, x.y, y.y), where_lt(a, b, x.z, y.z))


# ------------------------------------------------------------------------------------------ rotations


@wp.func
def mul(a: Quat, b: Quat) -> Quat:
    return Quat(
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y + a.y * b.w + a.z * b.x - a.x * b.z,
        a.w * b.z + a.z * b.w + a.x * b.y - a.y * b.x,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    )


@wp.func
def quat(q: wp.quat) -> Quat:
    """The same plain quaternion in every lane."""
    return Quat(fill(q[0]), fill(q[1]), fill(q[2]), fill(q[3]))


@wp.func
def conjugate(q: Quat) -> Quat:
    return Quat(neg(q.x), neg(q.y), neg(q.z), q.w)


@wp.func
def normalize(q: Quat) -> Quat:
    k = fill(1.0) / sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
    return Quat(k * q.x, k * q.y, k * q.z, k * q.w)


@wp.func
def rotation(q: Quat) -> Mat3:
    """Matrix of a unit quaternion."""
    x2 = q.x + q.x
    y2 = q.y + q.y
    z2 = q.z + q.z
    xx = q.x * x2
    yy = q.y * y2
    zz = q.z * z2
    xy = q.x * y2
    xz = q.x * z2
    yz = q.y * z2
    wx = q.w * x2
    wy = q.w * y2
    wz = q.w * z2
    return Mat3(
        1.0 - (yy + zz),
        xy - wz,
        xz + wy,
        xy + wz,
        1.0 - (xx + zz),
        yz - wx,
        xz - wy,
        yz + wx,
        1.0 - (xx + yy),
    )


@wp.func
def about(axis: wp.vec3, angle: Real) -> Quat:
    """Rotation by `angle` [rad] about a plain unit axis."""
    h = sin_cos(0.5 * angle)
    return Quat(axis[0] * h.sin, axis[1] * h.sin, axis[2] * h.sin, h.cos)


@wp.func
def exponential(a: Vec3) -> Quat:
    """Quaternion of a rotation vector [rad]."""
    angle = norm(a)
    h = sin_cos(0.5 * angle)
    k = where_lt(angle, fill(1.0e-3), 0.5 - 0.0208333333 * (angle * angle), h.sin / max(angle, fill(1.0e-6)))
    return Quat(k * a.x, k * a.y, k * a.z, h.cos)


@wp.func
def logarithm(q: Quat) -> Vec3:
    """Rotation vector [rad] of the shorter of the two rotations that a unit quaternion stands for."""
    s = sqrt(q.x * q.x + q.y * q.y + q.z * q.z)
    c = abs(q.w)
    k = where_lt(s, fill(1.0e-4), fill(2.0), 2.0 * arc_tangent(s, c) / max(s, fill(1.0e-6)))
    k = where_lt(q.w, fill(0.0), neg(k), k)
    return Vec3(k * q.x, k * q.y, k * q.z)


@wp.func
def mul(R: Mat3, a: Vec3) -> Vec3:
    return Vec3(
        R.xx * a.x + R.xy * a.y + R.xz * a.z,
        R.yx * a.x + R.yy * a.y + R.yz * a.z,
        R.zx * a.x + R.zy * a.y + R.zz * a.z,
    )


@wp.func
def mul_t(R: Mat3, a: Vec3) -> Vec3:
    """R^T a."""
    return Vec3(
        R.xx * a.x + R.yx * a.y + R.zx * a.z,
        R.xy * a.x + R.yy * a.y + R.zy * a.z,
        R.xz * a.x + R.yz * a.y + R.zz * a.z,
    )


@wp.func
def mul(S: Sym3, a: Vec3) -> Vec3:
    return Vec3(
        S.xx * a.x + S.xy * a.y + S.xz * a.z,
        S.xy * a.x + S.yy * a.y + S.yz * a.z,
        S.xz * a.x + S.yz * a.y + S.zz * a.z,
    )


@wp.func
def rotate(R: Mat3, a: wp.vec3) -> Vec3:
    """A plain vector of the link, along the world's axes."""
    return Vec3(
        R.xx * a[0] + R.xy * a[1] + R.xz * a[2],
        R.yx * a[0] + R.yy * a[1] + R.yz * a[2],
        R.zx * a[0] + R.zy * a[1] + R.zz * a[2],
    )


@wp.func
def column(R: Mat3, i: int) -> Vec3:
    if i == 0:
        return Vec3(R.xx, R.yx, R.zx)
    if i == 1:
        return Vec3(R.xy, R.yy, R.zy)
    return Vec3(R.xz, R.yz, R.zz)


@wp.func
def row(R: Mat3, i: int) -> Vec3:
    if i == 0:
        return Vec3(R.xx, R.xy, R.xz)
    if i == 1:
        return Vec3(R.yx, R.yy, R.yz)
    return Vec3(R.zx, R.zy, R.zz)


@wp.func
def frame(n: Vec3) -> Mat3:
    """Rows: the unit vector n and two more, orthogonal (Duff et al. 2017)."""
    sign = where_lt(n.z, fill(0.0), fill(-1.0), fill(1.0))
    a = -1.0 / (sign + n.z)
    b = n.x * n.y * a
    sx = sign * n.x
    return Mat3(n.x, n.y, n.z, 1.0 + sx * n.x * a, sign * b, neg(sx), b, sign + n.y * n.y * a, neg(n.y))


# -------------------------------------------------------------------------------- spatial quantities


@wp.func
def add(a: Force, b: Force) -> Force:
    return Force(a.n + b.n, a.f + b.f)


@wp.func
def sub(a: Force, b: Force) -> Force:
    return Force(a.n - b.n, a.f - b.f)


@wp.func
def mul(k: Real, a: Force) -> Force:
    return Force(k * a.n, k * a.f)


@wp.func
def dot(V: Motion, F: Force) -> Real:
    return dot(V.w, F.n) + dot(V.v, F.f)


@wp.func
def add(a: Sym3, b: Sym3) -> Sym3:
    return Sym3(a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz)


@wp.func
def add(a: Mat3, b: Mat3) -> Mat3:
    return Mat3(
        a.xx + b.xx,
        a.xy + b.xy,
        a.xz + b.xz,
        a.yx + b.yx,
        a.yy + b.yy,
        a.yz + b.yz,
        a.zx + b.zx,
        a.zy + b.zy,
        a.zz + b.zz,
    )


@wp.func
def add(a: Inertia, b: Inertia) -> Inertia:
    return Inertia(a.A + b.A, a.B + b.B, a.M + b.M)


@wp.func
def mul(I: Inertia, V: Motion) -> Force:
    """n = A w + B v, f = B^T w + M v."""
    return Force(I.A * V.w + I.B * V.v, mul_t(I.B, V.w) + I.M * V.v)


@wp.func
def turn(I: Inertia, s: Vec3) -> Force:
    """I times a pure rotation about s."""
    return Force(I.A * s, mul_t(I.B, s))


@wp.func
def slide(I: Inertia, s: Vec3) -> Force:
    """I times a pure translation along s."""
    return Force(I.B * s, I.M * s)


@wp.func
def downdate(I: Inertia, U: Force) -> Inertia:
    """I - U U^T [7.41]."""
    n = U.n
    f = U.f
    return Inertia(
        Sym3(
            I.A.xx - n.x * n.x,
            I.A.xy - n.x * n.y,
            I.A.xz - n.x * n.z,
            I.A.yy - n.y * n.y,
            I.A.yz - n.y * n.z,
            I.A.zz - n.z * n.z,
        ),
        Mat3(
            I.B.xx - n.x * f.x,
            I.B.xy - n.x * f.y,
            I.B.xz - n.x * f.z,
            I.B.yx - n.y * f.x,
            I.B.yy - n.y * f.y,
            I.B.yz - n.y * f.z,
            I.B.zx - n.z * f.x,
            I.B.zy - n.z * f.y,
            I.B.zz - n.z * f.z,
        ),
        Sym3(
            I.M.xx - f.x * f.x,
            I.M.xy - f.x * f.y,
            I.M.xz - f.x * f.z,
            I.M.yy - f.y * f.y,
            I.M.yz - f.y * f.z,
            I.M.zz - f.z * f.z,
        ),
    )


@wp.func
def shift_motion(V: Motion, r: Vec3) -> Motion:
    """Velocity at the point r from where V is taken."""
    return Motion(V.w, V.v + cross(V.w, r))


@wp.func
def shift_force(F: Force, r: Vec3) -> Force:
    """A force about a point r away, about the nearer point."""
    return Force(F.n + cross(r, F.f), F.f)


@wp.func
def shift_inertia(I: Inertia, r: Vec3) -> Inertia:
    """I about a point r away, about the nearer point (parallel axes, [2.66])."""
    B = I.B
    M = I.M
    # C = B + [r] M
    C = Mat3(
        B.xx + r.y * M.xz - r.z * M.xy,
        B.xy + r.y * M.yz - r.z * M.yy,
        B.xz + r.y * M.zz - r.z * M.yz,
        B.yx + r.z * M.xx - r.x * M.xz,
        B.yy + r.z * M.xy - r.x * M.yz,
        B.yz + r.z * M.xz - r.x * M.zz,
        B.zx + r.x * M.xy - r.y * M.xx,
        B.zy + r.x * M.yy - r.y * M.xy,
        B.zz + r.x * M.yz - r.y * M.xz,
    )
    # A - B [r] + [r] C^T; (B [r])_i = B_i x r and ([r] C^T)_ij = (r x C_j)_i over rows B_i, C_j
    A = Sym3(
        I.A.xx - (B.xy * r.z - B.xz * r.y) + (r.y * C.xz - r.z * C.xy),
        I.A.xy - (B.xz * r.x - B.xx * r.z) + (r.y * C.yz - r.z * C.yy),
        I.A.xz - (B.xx * r.y - B.xy * r.x) + (r.y * C.zz - r.z * C.zy),
        I.A.yy - (B.yz * r.x - B.yx * r.z) + (r.z * C.yx - r.x * C.yz),
        I.A.yz - (B.yx * r.y - B.yy * r.x) + (r.z * C.zx - r.x * C.zz),
        I.A.zz - (B.zx * r.y - B.zy * r.x) + (r.x * C.zy - r.y * C.zx),
    )
    return Inertia(A, C, M)


@wp.func
def rigid(R: Mat3, mass: Real, com: Vec3, J: Sym3) -> Inertia:
    """Inertia of a link about its origin from its mass [kg], centre of mass [m] (world axes) and
    moments J about the origin [kg m^2] (link axes) [2.63]."""
    # T = R J, then A = T R^T
    tx = J * Vec3(R.xx, R.xy, R.xz)
    ty = J * Vec3(R.yx, R.yy, R.yz)
    tz = J * Vec3(R.zx, R.zy, R.zz)
    rx = Vec3(R.xx, R.xy, R.xz)
    ry = Vec3(R.yx, R.yy, R.yz)
    rz = Vec3(R.zx, R.zy, R.zz)
    o = fill(0.0)
    c = mass * com
    return Inertia(
        Sym3(dot(tx, rx), dot(tx, ry), dot(tx, rz), dot(ty, ry), dot(ty, rz), dot(tz, rz)),
        Mat3(o, neg(c.z), c.y, c.z, o, neg(c.x), neg(c.y), c.x, o),
        Sym3(mass, o, o, mass, o, mass),
    )
