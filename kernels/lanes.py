"""`Real`, the number every kernel computes with, and its operators.

On CUDA `Real` is a `float32` and one thread steps one world. A CPU runs a Warp launch as a plain loop,
which LLVM does not vectorise across worlds by itself, so there `Real` is a vector of `LANES` worlds
(16 with AVX-512, 8 with AVX2, 4 with SSE or NEON) and one pass of a kernel steps that many at once.

Warp looks for `add`, `sub`, `mul` and `div` in a kernel's own module before its built-ins: a module that
imports them (`from .spatial import *` brings all operators) writes `a * b + c` for lanes, and for the
vectors of lanes in `spatial`.

A lane that takes no part must compute the same bits as if it were alone, so there are no branches on
values, only selections: `where_lt(a, b, x, y)` is x in the lanes where a < b, else y.
"""

import sys

import warp as wp

LANES = getattr(sys.modules[__package__], "LANES", 1)
"""Worlds in one `Real`; set by the package this module was imported through (see `kernels.program`)."""

Real = wp.float32 if LANES == 1 else wp.types.vector(length=LANES, dtype=wp.float32)


def _native(expression: str, arguments: str = "ab") -> str:
    """C++ for `expression` over the Real arguments, on a machine vector where there is one."""
    if LANES == 1:
        names = "; ".join(f"const float {n}_ = {n}" for n in arguments)
        return f"{names}; return {expression};"
    vector = (
        f"typedef float V __attribute__((vector_size({4 * LANES}), aligned(4), may_alias));"
        f"typedef int I __attribute__((vector_size({4 * LANES}), aligned(4), may_alias));"
    )
    load = "".join(f"V {n}_; __builtin_memcpy(&{n}_, &{n}, sizeof(V));" for n in arguments)
    return (
        f"{vector}{load} V r_ = {expression};"
        f"wp::vec_t<{LANES}, wp::float32> out_; __builtin_memcpy(&out_, &r_, sizeof(V)); return out_;"
    )


@wp.func_native(_native("a_ + b_"))
def add(a: Real, b: Real) -> Real: ...


@wp.func_native(_native("a_ - b_"))
def sub(a: Real, b: Real) -> Real: ...


@wp.func_native(_native("a_ * b_"))
def mul(a: Real, b: Real) -> Real: ...


@wp.func_native(_native("a_ / b_"))
def div(a: Real, b: Real) -> Real: ...


@wp.func_native("return a + b;")
def add(a: int, b: int) -> int: ...


@wp.func_native("return a - b;")
def sub(a: int, b: int) -> int: ...


@wp.func_native("return a * b;")
def mul(a: int, b: int) -> int: ...


if LANES > 1:  # a Real with a plain number

    @wp.func_native(_native("a_ + b", "a"))
    def add(a: Real, b: float) -> Real: ...

    @wp.func_native(_native("a + b_", "b"))
    def add(a: float, b: Real) -> Real: ...

    @wp.func_native(_native("a_ - b", "a"))
    def sub(a: Real, b: float) -> Real: ...

    @wp.func_native(_native("a - b_", "b"))
    def sub(a: float, b: Real) -> Real: ...

    @wp.func_native(_native("a_ * b", "a"))
    def mul(a: Real, b: float) -> Real: ...

    @wp.func_native(_native("a * b_", "b"))
    def mul(a: float, b: Real) -> Real: ...

    @wp.func_native(_native("a_ / b", "a"))
    def div(a: Real, b: float) -> Real: ...

    @wp.func_native(_native("a / b_", "b"))
    def div(a: float, b: Real) -> Real: ...

    @wp.func_native("return a + b;")
    def add(a: float, b: float) -> float: ...

    @wp.func_native("return a - b;")
    def sub(a: float, b: float) -> float: ...

    @wp.func_native("return a * b;")
    def mul(a: float, b: float) -> float: ...

    @wp.func_native("return a / b;")
    def div(a: float, b: float) -> float: ...


@wp.func_native("return a;" if LANES == 1 else _native("V{} + a", ""))
def fill(a: float) -> Real:
    """The same number in every lane."""
    ...


@wp.func_native(_native("-a_", "a"))
def neg(a: Real) -> Real: ...


def _compare(expression: str) -> str:
    return _native(expression, "abxy")


@wp.func_native(_compare("a_ < b_ ? x_ : y_"))
def where_lt(a: Real, b: Real, x: Real, y: Real) -> Real:
    """x in the lanes where a < b, else y (so y where a or b is not a number)."""
    ...


@wp.func_native(_native("a_ < b_ ? a_ : b_", "ab"))
def min(a: Real, b: Real) -> Real: ...


@wp.func_native(_native("a_ < b_ ? b_ : a_", "ab"))
def max(a: Real, b: Real) -> Real: ...


_ANY = (
    "return a < b;"
    if LANES == 1
    else f"typedef float V __attribute__((vector_size({4 * LANES}), aligned(4), may_alias));"
    f"typedef int I __attribute__((vector_size({4 * LANES})));"
    "V a_, b_; __builtin_memcpy(&a_, &a, sizeof(V)); __builtin_memcpy(&b_, &b, sizeof(V));"
    "I m = a_ < b_; return __builtin_reduce_or(m) != 0;"
)


@wp.func_native(_ANY)
def any_lt(a: Real, b: Real) -> bool:
    """Whether a < b in at least one lane."""
    ...


_SQRT = "sqrtf(a_)" if LANES == 1 else "__builtin_elementwise_sqrt(a_)"
_ROUND = "rintf(a_)" if LANES == 1 else "__builtin_elementwise_rint(a_)"
_ABS = "fabsf(a_)" if LANES == 1 else "__builtin_elementwise_abs(a_)"


@wp.func_native(_native(_SQRT, "a"))
def sqrt(a: Real) -> Real:
    """Square root."""
    ...


@wp.func_native(_native(_ABS, "a"))
def abs(a: Real) -> Real:
    """Absolute value."""
    ...


@wp.func_native(_native(_ROUND, "a"))
def nearest(a: Real) -> Real:
    """The nearest integer."""
    ...


# The functions below are polynomials on Reals, so that they give the same bits on any lane count.

# pi / 2 in three parts, for an exact argument reduction (Cody and Waite)
_HALF_PI_1 = wp.constant(1.5703125)
_HALF_PI_2 = wp.constant(4.837512969970703125e-4)
_HALF_PI_3 = wp.constant(7.549789948768648e-8)


@wp.struct
class SinCos:
    sin: Real
    cos: Real


@wp.func
def sin_cos(a: Real) -> SinCos:
    """Sine and cosine of an angle [rad], to 2e-7 for |a| < 1e4."""
    k = nearest(0.6366197723675814 * a)
    r = ((a - _HALF_PI_1 * k) - _HALF_PI_2 * k) - _HALF_PI_3 * k
    z = r * r
    s = r + r * z * (((-1.9515295891e-4 * z + 8.3321608736e-3) * z) - 1.6666654611e-1)
    c = (1.0 - 0.5 * z) + z * z * (
        (2.443315711809948e-5 * z - 1.388731625493765e-3) * z + 4.166664568298827e-2
    )
    turn = k - 4.0 * nearest(0.25 * k)  # the quadrant, -2 .. 2
    odd = abs(abs(turn) - 1.0)  # 0 in the quadrants where sine and cosine change places
    half = fill(0.5)
    sine = where_lt(odd, half, c, s)
    cosine = where_lt(odd, half, s, c)
    far = fill(1.5)
    sine = where_lt(turn, neg(half), neg(sine), where_lt(far, turn, neg(sine), sine))
    cosine = where_lt(half, turn, neg(cosine), where_lt(turn, neg(far), neg(cosine), cosine))
    return SinCos(sine, cosine)


@wp.func
def arc_tangent(y: Real, x: Real) -> Real:
    """Angle [rad] in [0, pi / 2] of the point (x, y) with x, y >= 0; 0 at the origin."""
    low = min(x, y)
    high = max(max(x, y), fill(1.0e-30))
    t = low / high
    bend = fill(0.4142135623730950)
    z = where_lt(bend, t, (t - 1.0) / (t + 1.0), t)
    base = where_lt(bend, t, fill(0.7853981633974483), fill(0.0))
    q = z * z
    p = ((8.05374449538e-2 * q - 1.38776856032e-1) * q + 1.99777106478e-1) * q - 3.33329491539e-1
    a = base + z + z * q * p
    return where_lt(x, y, 1.5707963267948966 - a, a)
