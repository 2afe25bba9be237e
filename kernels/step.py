"""One step of the simulation, and the kernels that launch it or a part of it.

`program(lanes)` gives this module for a number of lanes; a launch covers `dim` groups from `first` on.
"""

import warp as wp

from .aim import Course, aim
from .articulated import factorize, judge_drives, velocities
from .contact import HEAD, drop_impulses, find  # noqa: F401
from .drive import TRIALS
from .integrate import integrate
from .kinematics import inertias, kinematics
from .loading import compiled
from .settle import residual
from .solve import keep, solve
from .spatial import *
from .strike import strike
from .tree import CARRIED, COLUMNS, Tree, World  # noqa: F401
from .watch import Watch, begin, look

OPTIONS = {
    "enable_backward": False,
    "max_unroll": 3,
    "cpu_compiler_flags": "-march=native -ffp-contract=fast -mprefer-vector-width=512"
    " -mllvm=-inline-threshold=9000",
}
wp.set_module_options(OPTIONS)


def load(device) -> None:
    """Compile the kernels now; to be done before threads launch them."""
    compiled(__name__, device)


@wp.func
def start(tree: Tree, world: World, g: int):
    """From the state to w, the velocity that all but contacts lead to."""
    kinematics(tree, world, g)
    trial = int(0)
    while trial < TRIALS:
        trial = trial + 1
        inertias(tree, world, g, world.V)
        factorize(tree, world, g)
        if not judge_drives(tree, world, g, True):
            trial = TRIALS


@wp.func
def finish(tree: Tree, world: World, g: int):
    """From w to the end of the step: contacts, velocities, places."""
    find(tree, world, g)
    strike(tree, world, g)
    solve(tree, world, g)
    velocities(tree, world, g)
    integrate(tree, world, g)
    if keep(tree, world, g):
        velocities(tree, world, g)


@wp.func
def advance(tree: Tree, world: World, g: int):
    start(tree, world, g)
    finish(tree, world, g)


@wp.kernel
def step(tree: Tree, world: World, first: int, count: int, course: Course, watch: Watch):
    g = first + wp.tid()
    begin(watch, g)
    for k in range(count):
        if course.table.shape[0] > 0:
            aim(tree, world, course, g, k)
        advance(tree, world, g)
        if watch.kind.shape[0] > 0:
            look(tree, world, watch, course.row, g, k)


@wp.kernel
def run_kinematics(tree: Tree, world: World, first: int, count: int):
    g = first + wp.tid()
    for _k in range(count):
        kinematics(tree, world, g)


@wp.kernel
def run_inertias(tree: Tree, world: World, first: int, count: int):
    g = first + wp.tid()
    for _k in range(count):
        inertias(tree, world, g, world.V)


@wp.kernel
def run_factorize(tree: Tree, world: World, first: int, count: int):
    g = first + wp.tid()
    for _k in range(count):
        factorize(tree, world, g)


@wp.kernel
def run_judge_drives(tree: Tree, world: World, first: int, count: int):
    g = first + wp.tid()
    for _k in range(count):
        judge_drives(tree, world, g, True)


@wp.kernel
def run_velocities(tree: Tree, world: World, first: int, count: int):
    g = first + wp.tid()
    for _k in range(count):
        velocities(tree, world, g)


@wp.kernel
def run_find(tree: Tree, world: World, first: int, count: int):
    g = first + wp.tid()
    for _k in range(count):
        find(tree, world, g)


@wp.kernel
def run_solve(tree: Tree, world: World, first: int, count: int):
    g = first + wp.tid()
    for _k in range(count):
        drop_impulses(tree, world, g)  # or the next one would be done at once
        solve(tree, world, g)


@wp.kernel
def run_residual(tree: Tree, world: World, first: int, out: wp.array2d(dtype=Real)):
    g = first + wp.tid()
    out[g, 0] = residual(tree, world, g)
