"""The loops in which the contact solver spends its time, written in C++ so that they keep their pointers
and sums in registers: a slot's velocity y . w, the change y . x of w by an impulse, and the step of w along
the way that it has come.
"""

import warp as wp

from .lanes import LANES, Real
from .spatial import Vec3

Triple = wp.types.vector(length=3 * LANES, dtype=wp.float32)
"""A Vec3 in one piece, which a native function can return."""

_TYPES = (
    "typedef float V;"
    if LANES == 1
    else f"typedef float V __attribute__((vector_size({4 * LANES}), aligned(4), may_alias));"
)
_ROWS = """
    const char* y_ = (const char*)y.data + g * (size_t)y.strides[0] + at * (size_t)y.strides[1];
    char* w_ = (char*)w.data + g * (size_t)w.strides[0];
    const size_t dy = y.strides[1], dw = w.strides[1];
    const int* dof_ = dof.data + first;
"""

_VELOCITY = f"""
    {_TYPES} {_ROWS}
    V n0 = {{}}, t0 = {{}}, s0 = {{}}, n1 = {{}}, t1 = {{}}, s1 = {{}};
    int k = 0;
    for (; k + 1 < count; k += 2) {{  // two sums at a time hide the latency of the additions
        const V a = *(const V*)(w_ + dof_[k] * dw), b = *(const V*)(w_ + dof_[k + 1] * dw);
        const V* p = (const V*)y_;
        const V* q = (const V*)(y_ + dy);
        n0 += a * p[0]; t0 += a * p[1]; s0 += a * p[2];
        n1 += b * q[0]; t1 += b * q[1]; s1 += b * q[2];
        y_ += 2 * dy;
    }}
    if (k < count) {{
        const V a = *(const V*)(w_ + dof_[k] * dw);
        const V* p = (const V*)y_;
        n0 += a * p[0]; t0 += a * p[1]; s0 += a * p[2];
    }}
    wp::vec_t<{3 * LANES}, wp::float32> sum;
    V* out = (V*)&sum;
    out[0] = n0 + n1; out[1] = t0 + t1; out[2] = s0 + s1;
    return sum;
"""

_CHANGE = f"""
    {_TYPES} {_ROWS}
    V n_, t_, s_;
    memcpy(&n_, &n, sizeof(V)); memcpy(&t_, &t, sizeof(V)); memcpy(&s_, &s, sizeof(V));
    for (int k = 0; k < count; ++k) {{
        V* a = (V*)(w_ + dof_[k] * dw);
        const V* p = (const V*)y_;
        *a = *a + (n_ * p[0] + (t_ * p[1] + s_ * p[2]));
        y_ += dy;
    }}
"""

_AHEAD = f"""
    {_TYPES}
    V theta_;
    memcpy(&theta_, &theta, sizeof(V));
    char* w_ = (char*)w.data + g * (size_t)w.strides[0];
    char* old_ = (char*)old.data + g * (size_t)old.strides[0];
    const size_t dw = w.strides[1], dold = old.strides[1];
    for (int k = 0; k < count; ++k) {{
        V* a = (V*)(w_ + k * dw);
        V* b = (V*)(old_ + k * dold);
        const V now = *a;
        *a = now + theta_ * (now - *b);
        *b = now;
    }}
"""

_PART = (
    "return a[i];"
    if LANES == 1
    else f"wp::vec_t<{LANES}, wp::float32> r; __builtin_memcpy(&r, &a.c[{LANES} * i], sizeof(r)); return r;"
)


@wp.func_native(_VELOCITY)
def _velocity(
    y: wp.array2d(dtype=Vec3),
    w: wp.array2d(dtype=Real),
    dof: wp.array(dtype=int),
    g: int,
    at: int,
    first: int,
    count: int,
) -> Triple: ...


@wp.func_native(_CHANGE.replace("memcpy", "__builtin_memcpy") if LANES > 1 else _CHANGE)
def _change(
    y: wp.array2d(dtype=Vec3),
    w: wp.array2d(dtype=Real),
    dof: wp.array(dtype=int),
    g: int,
    at: int,
    first: int,
    count: int,
    n: Real,
    t: Real,
    s: Real,
): ...


@wp.func_native(_AHEAD.replace("memcpy", "__builtin_memcpy") if LANES > 1 else _AHEAD)
def row_ahead(w: wp.array2d(dtype=Real), old: wp.array2d(dtype=Real), g: int, count: int, theta: Real):
    """w += theta (w - old), old = w before, for the first `count` of each."""
    ...


@wp.func_native(_PART)
def _part(a: Triple, i: int) -> Real: ...


@wp.func
def rows_velocity(
    y: wp.array2d(dtype=Vec3),
    w: wp.array2d(dtype=Real),
    dof: wp.array(dtype=int),
    g: int,
    at: int,
    first: int,
    count: int,
) -> Vec3:
    """Sum of y[g, at + k] w[g, dof[first + k]] over k < count."""
    u = _velocity(y, w, dof, g, at, first, count)
    return Vec3(_part(u, 0), _part(u, 1), _part(u, 2))


@wp.func
def rows_change(
    y: wp.array2d(dtype=Vec3),
    w: wp.array2d(dtype=Real),
    dof: wp.array(dtype=int),
    g: int,
    at: int,
    first: int,
    count: int,
    x: Vec3,
):
    """w[g, dof[first + k]] += y[g, at + k] . x for all k < count."""
    _change(y, w, dof, g, at, first, count, x.x, x.y, x.z)
