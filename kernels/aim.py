"""Targets of the drives from a table that all worlds share, each following rows of its own."""

import warp as wp

from .kinematics import load3, load4, store4
from .spatial import *
from .tree import BALL, HINGE, Tree, World


@wp.struct
class Course:
    """What a batch is steered along; without rows, targets stay as they are."""

    table: wp.array2d(dtype=float)
    """targets `(n, q_count)`"""
    row: wp.array2d(dtype=int)
    """the first row that each world follows, `(groups, LANES)`"""
    offset: wp.array2d(dtype=Real)
    """for some joints, what their targets are moved by: an angle, or a rotation vector in the axes of the
    turned joint [rad]"""
    column: wp.array(dtype=int)
    """of `offset`, for each dof; or -1"""


_ROW = (
    "const float *row_ = (const float *)"
    "((const char *)table.data + (size_t)(row.data[g * row.shape[1] + lane_] + later) * table.strides[0]);"
)
_CHOOSE = (
    f"const int lane_ = 0; {_ROW} return row_[column];"
    if LANES == 1
    else f"wp::vec_t<{LANES}, wp::float32> out_; for (int lane_ = 0; lane_ < {LANES}; ++lane_)"
    f"{{ {_ROW} ((float *)&out_)[lane_] = row_[column]; }} return out_;"
)


@wp.func_native(_CHOOSE)
def choose(
    table: wp.array2d(dtype=float), row: wp.array2d(dtype=int), g: int, later: int, column: int
) -> Real:
    """A number from a row of a table, `later` rows after the one that each world has chosen. Native,
    as a lane at a time would go through memory."""
    ...


@wp.func
def aim(tree: Tree, world: World, course: Course, g: int, later: int):
    for c in range(tree.q_count):
        world.target[g, c] = choose(course.table, course.row, g, later, c)
    for i in range(1, tree.link_count + 1):
        k = course.column[tree.link_dof[i]]
        iq = tree.link_q[i]
        if k >= 0:
            if tree.link_joint[i] == HINGE:
                world.target[g, iq] = world.target[g, iq] + course.offset[g, k]
            elif tree.link_joint[i] == BALL:
                q = load4(world.target, g, iq) * exponential(load3(course.offset, g, k))
                store4(world.target, g, iq, q)
