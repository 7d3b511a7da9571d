"""Velocities, drifts and Jacobians of bodies and contacts: eqs. (1), (4), (5).

These quantities follow from Pinocchio's world Jacobian. All quantities are in the world frame. A
drift is the acceleration at q̈ = 0, that is J̇ v. Joint 0 is the world itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from floatbase.control.tick.jit import jit
from floatbase.control.tick.problem_arrays import POINT, USER_DEFINED
from floatbase.control.tick.vectors import (
    column_part,
    cross,
    minus,
    plus,
    rotate,
    rotation_in,
    row_part,
    times,
)
from floatbase.control.tick.workspace import clear


class Bodies(NamedTuple):
    """The tree of n joints in one state."""

    tree: Any  # (n, 5), parent, first index in v, count in v, first index in q, count in q
    links: Any  # (n, 4), mass of each link and its position in the joint
    poses: Any  # (n, 12), rotation column by column, then position
    # (6, nv), spatial velocity about the world's origin for each entry of v: linear, then angular
    J: Any
    # (6, nv), centroidal momentum matrix: mass × the Jacobian of the CoM in its first three rows
    Ag: Any
    velocity: Any  # (n, 6), J v of each joint
    drift: Any  # (n, 6), its derivative at q̈ = 0


class ContactTable(NamedTuple):
    """C contacts with P points."""

    # (C, 6), joint, kind, first point, number of points, of motion rows, of entries of λ
    table: Any
    frames: Any  # (C, 16), pose of the frame in the joint (12), normal in the world, radius
    points: Any  # (P, 3), centre of the ball, or corners, in the frame
    inputs: Any  # packed by `user_terms.UserTerms`
    # where the user-defined contacts' A, b and J start in it, one contact after another
    user_start: Any
    points_only: Any  # whether all are point contacts, whose A and J are the same


@jit
def forward_velocities(bodies: Bodies, v):
    """Fill velocity and drift of `bodies` from the root to the leaves, for v (nv,).

    A joint's columns of J move with it, so its drift is that of its parent + velocity × (J v of the
    joint alone).
    """
    tree, J, velocity, drift = bodies.tree, bodies.J, bodies.velocity, bodies.drift
    for r in range(6):
        velocity[0, r], drift[0, r] = 0.0, 0.0
    for i in range(1, tree.shape[0]):
        parent, first, count = tree[i, 0], tree[i, 1], tree[i, 2]
        joint_linear, joint_angular = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for c in range(first, first + count):
            joint_linear = plus(joint_linear, times(v[c], column_part(J, 0, c)))
            joint_angular = plus(joint_angular, times(v[c], column_part(J, 3, c)))
        linear = plus(row_part(velocity, parent, 0), joint_linear)
        angular = plus(row_part(velocity, parent, 3), joint_angular)
        a = plus(
            row_part(drift, parent, 0),
            plus(cross(angular, joint_linear), cross(linear, joint_angular)),
        )
        alpha = plus(row_part(drift, parent, 3), cross(angular, joint_angular))
        for r in range(3):
            velocity[i, r], velocity[i, 3 + r] = linear[r], angular[r]
            drift[i, r], drift[i, 3 + r] = a[r], alpha[r]


@jit
def point_velocity(bodies: Bodies, joint, p):
    """Return velocity and drift of the point p, world, of a joint's body."""
    angular = row_part(bodies.velocity, joint, 3)
    linear = plus(row_part(bodies.velocity, joint, 0), cross(angular, p))
    a = plus(row_part(bodies.drift, joint, 0), cross(row_part(bodies.drift, joint, 3), p))
    return linear, plus(a, cross(angular, linear))


@jit
def frame_pose(bodies: Bodies, joint, frames, i):
    """Return rotation and position, world, of a frame; its pose in the joint is `frames[i]`."""
    R = rotation_in(bodies.poses, joint)
    x, y, z = rotation_in(frames, i)
    return (rotate(R, x), rotate(R, y), rotate(R, z)), plus(
        row_part(bodies.poses, joint, 9), rotate(R, row_part(frames, i, 9))
    )


@jit
def body_jacobian(bodies: Bodies, joint, linear, p, out, row):
    """Write the Jacobian of a joint's body into rows row:row + 3 of out (·, nv), which hold zeros.

    linear: True for the velocity of the body's point p, world; False for its angular velocity.
    """
    i = joint
    while i > 0:
        for c in range(bodies.tree[i, 1], bodies.tree[i, 1] + bodies.tree[i, 2]):
            J_c = column_part(bodies.J, 3, c)
            if linear:
                J_c = plus(column_part(bodies.J, 0, c), cross(J_c, p))
            out[row, c], out[row + 1, c], out[row + 2, c] = J_c
        i = bodies.tree[i, 0]


@jit
def centre_of_mass(bodies: Bodies):
    """Return position, velocity and drift of the centre of mass, and the mass."""
    com, com_velocity, com_drift, mass = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    for i in range(1, bodies.links.shape[0]):
        link_mass = bodies.links[i, 0]
        p = plus(
            row_part(bodies.poses, i, 9),
            rotate(rotation_in(bodies.poses, i), row_part(bodies.links, i, 1)),
        )
        velocity, drift = point_velocity(bodies, i, p)
        com, mass = plus(com, times(link_mass, p)), mass + link_mass
        com_velocity = plus(com_velocity, times(link_mass, velocity))
        com_drift = plus(com_drift, times(link_mass, drift))
    scale = 1.0 / mass
    return times(scale, com), times(scale, com_velocity), times(scale, com_drift), mass


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
