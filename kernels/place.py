"""Worlds are put into states of a pool: of the same worlds, a copy of them, or any other."""

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


@wp.struct
class Block:
    """A quantity of n numbers, each of `parts` floats, within a stretch of floats: part k of number i of
    state s stands at start + s / lanes * group_stride + i * stride + k * lanes + s % lanes."""

    start: int
    n: int
    """0: the states do not have it, so it is zero"""
    parts: int
    lanes: int
    group_stride: int
    stride: int


@wp.func_native(f"""
int moved[{LANES}], base[{LANES}], count = 0;
for (int lane = 0; lane < {LANES}; ++lane) {{
    int w = g * {LANES} + lane, last = rows.shape[0] - 1, row = rows.data[w < last ? w : last];
    if (row >= 0) {{
        base[count] = source.start + row / source.lanes * source.group_stride + row % source.lanes;
        moved[count++] = lane;
    }}
}}
for (int i = 0; count && i < to.n; ++i)
    for (int k = 0; k < to.parts; ++k) {{
        float *here = state.data + to.start + g * to.group_stride + i * to.stride + k * {LANES};
        const float *there = pool.data + i * source.stride + k * source.lanes;
        for (int c = 0; c < count; ++c)
            here[moved[c]] = source.n > 0 ? there[base[c]] : 0.0f;
    }}
""")
def move(
    rows: wp.array(dtype=int),
    g: int,
    pool: wp.array(dtype=float),
    source: Block,
    state: wp.array(dtype=float),
    to: Block,
):
    """One quantity of a group's worlds, lane by lane in the innermost loop, which keeps to its cache
    lines."""
    ...


@wp.kernel
def place(
    tree: Tree,
    world: World,
    first: int,
    rows: wp.array(dtype=int),
    pool: wp.array(dtype=float),
    from_blocks: wp.array(dtype=Block),
    state: wp.array(dtype=float),
    to_blocks: wp.array(dtype=Block),
):
    """state: each world gets the state of its row of the pool; -1: it keeps its own. The unused worlds of
    the last group go with the last world."""
    g = first + wp.tid()
    for b in range(to_blocks.shape[0]):
        move(rows, g, pool, from_blocks[b], state, to_blocks[b])
