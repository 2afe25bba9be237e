"""A step of models with links that tumble or swing on their own, apart so that others need not carry it."""

import warp as wp

from .aim import Course, aim
from .loading import compiled
from .mean import even_out
from .step import OPTIONS, finish, start
from .tree import Tree, World
from .tumble import tumble
from .watch import Watch, begin, look

wp.set_module_options(OPTIONS)


def load(device) -> None:
    """Compile the kernels now; to be done before threads launch them."""
    compiled(__name__, device)


@wp.kernel
def step(tree: Tree, world: World, first: int, count: int, course: Course, watch: Watch):
    g = first + wp.tid()
    begin(watch, g)
    for k in range(count):
        if course.table.shape[0] > 0:
            aim(tree, world, course, g, k)
        start(tree, world, g)
        if tree.loose != 0:
            even_out(tree, world, g)
        tumble(tree, world, g)
        finish(tree, world, g)
        if watch.kind.shape[0] > 0:
            look(tree, world, watch, course.row, g, k)
