"""Jacobians and drifts of frames and contacts: eqs. (4), (5).

All quantities are in the world frame. A drift is the acceleration at q̈ = 0, that is J̇ v.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from floatbase.control.tick.dynamics import Bodies, point_velocity
from floatbase.control.tick.jit import jit
from floatbase.control.tick.problem_arrays import POINT, USER_DEFINED
from floatbase.control.tick.vectors import (
    cross,
    minus,
    plus,
    rotate,
    rotation_in,
    row_part,
    times,
)
from floatbase.control.tick.workspace import clear


class ContactTable(NamedTuple):
    """C contacts with P points."""

    # (C, 7), joint, kind, first point, number of points, of motion rows, of entries of λ, and 1 if
    # the controller assumes that its forces have no effect
    table: Any
    frames: Any  # (C, 16), pose of the frame in the joint (12), normal in the world, radius
    points: Any  # (P, 3), centre of the ball, or corners, in the frame
    inputs: Any  # packed by `user_terms.UserTerms`
    # where the user-defined contacts' A, b and J start in it, one contact after another
    user_start: Any
    points_only: Any  # whether all are point contacts with an effect: their A and J are the same


@jit
def frame_pose(bodies: Bodies, joint, frames, i):
    """Return rotation and position, world, of a frame; its pose in the joint is `frames[i]`."""
    R = rotation_in(bodies.poses, joint)
    x, y, z = rotation_in(frames, i)
    return (rotate(R, x), rotate(R, y), rotate(R, z)), plus(
        row_part(bodies.poses, joint, 9), rotate(R, row_part(frames, i, 9))
    )


@jit
def body_jacobian(bodies: Bodies, joint, linear, p, out, row, factor=1.0):
    """Add a multiple of the Jacobian of a joint's body to rows row:row + 3 of out (·, nv).

    linear: True for the velocity of the body's point p, world; False for its angular velocity.
    """
    i = joint
    while i > 0:
        for c in range(bodies.tree[i, 1], bodies.tree[i, 1] + bodies.tree[i, 2]):
            J_c = row_part(bodies.J, c, 3)
            if linear:
                J_c = plus(row_part(bodies.J, c, 0), cross(J_c, p))
            for r in range(3):
                out[row + r, c] += factor * J_c[r]
        i = bodies.tree[i, 0]


@jit
def copy_rows(numbers, first, n_rows, n_columns, out, row):
    """Copy a table (n_rows, n_columns) from `numbers` into `out`, and return where it ends.

    first: index in `numbers` where the table starts. row: first row of `out` to fill.
    """
    for i in range(n_rows):
        for c in range(n_columns):
            out[row + i, c] = numbers[first + i * n_columns + c]
    return first + n_rows * n_columns


@jit
def contact_rows(bodies: Bodies, contacts: ContactTable, A, b, J):
    """Write A (m, nv), b (m,) of (5) and J (k, nv) of (4) for all contacts.

    A and J are the same array if `points_only`.
    """
    row, force, nv, inputs, start = 0, 0, A.shape[1], contacts.inputs, contacts.user_start
    clear(A)
    clear(J)
    for i in range(contacts.table.shape[0]):
        joint, kind, first = contacts.table[i, 0], contacts.table[i, 1], contacts.table[i, 2]
        count = contacts.table[i, 3]
        m, k = contacts.table[i, 4], contacts.table[i, 5]
        if kind == USER_DEFINED:
            start = copy_rows(inputs, start, m, nv, A, row)
            for r in range(m):
                b[row + r] = inputs[start + r]
            start = copy_rows(inputs, start + m, k, nv, J, force)
            row, force = row + m, force + k
            continue
        R, p = frame_pose(bodies, joint, contacts.frames, i)
        normal, radius = row_part(contacts.frames, i, 12), contacts.frames[i, 15]
        for j in range(first, first + count):
            point = minus(
                plus(p, rotate(R, row_part(contacts.points, j, 0))), times(radius, normal)
            )
            body_jacobian(bodies, joint, True, point, J, force + 3 * (j - first))
            if kind == POINT:
                p = point
        if not contacts.points_only:
            body_jacobian(bodies, joint, True, p, A, row)
        _, drift = point_velocity(bodies, joint, p)
        if kind == POINT:  # the ball rolls: its lowest point moves on the ball
            angular = row_part(bodies.velocity, joint, 3)
            drift = plus(drift, times(radius, cross(angular, cross(angular, normal))))
        else:
            body_jacobian(bodies, joint, False, p, A, row + 3)
            b[row + 3], b[row + 4], b[row + 5] = times(-1.0, row_part(bodies.drift, joint, 3))
        b[row], b[row + 1], b[row + 2] = times(-1.0, drift)
        row, force = row + m, force + k
    force = 0
    for i in range(contacts.table.shape[0]):
        if contacts.table[i, 6] == 1:
            clear(J[force : force + contacts.table[i, 5]])
        force += contacts.table[i, 5]
