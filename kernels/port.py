"""The edge of the worlds: plain arrays `(worlds, n)` outside, lanes inside.

A port has a row per world, whatever the number of lanes, so NumPy and torch see one memory on every
device. The unused worlds of the last group read what the last world does, and write nothing.
"""

import warp as wp

from .lanes import *
from .loading import compiled
from .tree import Tree, World

wp.set_module_options(
    {"enable_backward": False, "max_unroll": 3, "cpu_compiler_flags": "-march=native -ffp-contract=fast"}
)


def load(device) -> None:
    """Compile the kernels now; to be done before threads launch them."""
    compiled(__name__, device)


def _each_lane(address: str, give: str) -> str:
    """C++ that does `give` for every lane's world w, with `at` the address of its number."""
    return (
        f"for (int lane_ = 0; lane_ < {LANES}; ++lane_)"
        f"{{ int w = g * {LANES} + lane_; float *at = (float *)({address}); {give} }}"
    )


_OUT = "" if LANES == 1 else f"wp::vec_t<{LANES}, wp::float32> out_;"
_INTO = "return *at;" if LANES == 1 else "((float *)&out_)[lane_] = *at;"
_DONE = "return 0.0f;" if LANES == 1 else "return out_;"
_LAST = "int last_ = {0}.shape[0] - 1;"
_CELL = "(char *)port.data + (size_t)(w < last_ ? w : last_) * port.strides[0] + column * port.strides[1]"
_ROW = (
    "(char *)table.data + (size_t)(row.data[w < last_ ? w : last_] + later) * table.strides[0]"
    " + column * table.strides[1]"
)


@wp.func_native(_LAST.format("port") + _OUT + _each_lane(_CELL, _INTO) + _DONE)
def take(port: wp.array2d(dtype=float), g: int, column: int) -> Real:
    """A number of a port for each world of the group."""
    ...


@wp.func_native(
    _LAST.format("port")
    + _each_lane(
        _CELL, f"if (w <= last_) *at = {'value' if LANES == 1 else '((const float *)&value)[lane_]'};"
    )
)
def give(port: wp.array2d(dtype=float), g: int, column: int, value: Real):
    """Set a number of a port for each world of the group."""
    ...


@wp.func_native(_LAST.format("row") + _OUT + _each_lane(_ROW, _INTO) + _DONE)
def choose(table: wp.array2d(dtype=float), row: wp.array(dtype=int), g: int, later: int, column: int) -> Real:
    """A number from a table that all worlds share, `later` rows after the one that each world has chosen.
    Native, as a lane at a time would go through memory."""
    ...


@wp.kernel
def show(tree: Tree, world: World, first: int, lanes: wp.array2d(dtype=Real), port: wp.array2d(dtype=float)):
    """A port becomes what the worlds have."""
    g = first + wp.tid()
    for column in range(port.shape[1]):
        give(port, g, column, lanes[g, column])


@wp.kernel
def read(tree: Tree, world: World, first: int, lanes: wp.array2d(dtype=Real), port: wp.array2d(dtype=float)):
    """The worlds take over what a port has."""
    g = first + wp.tid()
    for column in range(port.shape[1]):
        lanes[g, column] = take(port, g, column)
