"""What passes between worlds: one becomes a copy of another."""

import warp as wp

from .lanes import *
from .tree import Tree, World

wp.set_module_options(
    {"enable_backward": False, "max_unroll": 3, "cpu_compiler_flags": "-march=native -ffp-contract=fast"}
)


def load(device) -> None:
    """Compile the kernels now; to be done before threads launch them."""
    wp.load_module(__name__, device=device)


@wp.struct
class Block:
    """An array `(groups, n, parts, LANES)` within a stretch of floats."""

    start: int
    n: int
    parts: int
    group_stride: int
    stride: int


@wp.kernel
def gather(
    tree: Tree,
    world: World,
    first: int,
    sources: wp.array2d(dtype=int),
    blocks: wp.array(dtype=Block),
    state: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    """out: the state that each world's source `(groups, LANES)` has, where that is another world."""
    g = first + wp.tid()
    for lane in range(LANES):
        source = sources[g, lane]
        if source != g * LANES + lane:
            for b in range(blocks.shape[0]):
                block = blocks[b]
                here = block.start + g * block.group_stride + lane
                there = block.start + (source / LANES) * block.group_stride + source % LANES
                for i in range(block.n):
                    for k in range(block.parts):
                        c = i * block.stride + k * LANES
                        out[here + c] = state[there + c]
