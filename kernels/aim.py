"""What acts on the worlds while they step along a table: targets of the drives, some of them offset, and
forces."""

import warp as wp

from .kinematics import load4, store4
from .port import choose, take
from .spatial import *
from .tree import BALL, HINGE, Tree, World


@wp.struct
class Course:
    """What a batch is steered along; without rows, targets and forces stay as they are."""

    table: wp.array2d(dtype=float)
    """targets `(rows, q_count)`"""
    row: wp.array(dtype=int)
    """the first row that each world follows, `(worlds,)`"""
    offset: wp.array2d(dtype=float)
    """what targets are moved by `(worlds, columns)`: angles, and rotation vectors in the axes of the turned
    joint [rad]"""
    column: wp.array(dtype=int)
    """of `offset`, for each dof; or -1"""
    gain: wp.array(dtype=float)
    """of the dof on its column"""
    pushed: wp.array(dtype=int)
    """bodies that forces act on"""
    push: wp.array2d(dtype=float)
    """their forces `(worlds, 3 bodies)` [N, world axes]"""


@wp.func
def offset(course: Course, g: int, dof: int) -> Real:
    k = course.column[dof]
    if k < 0:
        return fill(0.0)
    return course.gain[dof] * take(course.offset, g, k)


@wp.func
def aim(tree: Tree, world: World, course: Course, g: int, later: int):
    for c in range(tree.q_count):
        world.target[g, c] = choose(course.table, course.row, g, later, c)
    for i in range(1, tree.link_count + 1):
        iv = tree.link_dof[i]
        iq = tree.link_q[i]
        if tree.link_joint[i] == HINGE:
            if course.column[iv] >= 0:
                world.target[g, iq] = world.target[g, iq] + offset(course, g, iv)
        elif tree.link_joint[i] == BALL:
            if wp.max(course.column[iv], wp.max(course.column[iv + 1], course.column[iv + 2])) >= 0:
                by = Vec3(offset(course, g, iv), offset(course, g, iv + 1), offset(course, g, iv + 2))
                store4(world.target, g, iq, load4(world.target, g, iq) * exponential(by))
    for k in range(course.pushed.shape[0]):
        world.force[g, course.pushed[k]] = Vec3(
            take(course.push, g, 3 * k), take(course.push, g, 3 * k + 1), take(course.push, g, 3 * k + 2)
        )
