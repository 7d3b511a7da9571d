"""Jacobians and drifts of frames and contacts: eqs. (4), (5).

All quantities are in the world frame. A drift is the acceleration at q̈ = 0, that is J̇ v.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from floatbase.control.tick.dynamics import Bodies, point_velocity
from floatbase.control.tick.jit import jit
from floatbase.control.tick.problem_arrays import CONNECTION, FLAT, POINT, USER_DEFINED, WHEEL
from floatbase.control.tick.vectors import (
    across,
    cross,
    dot,
    minus,
    plus,
    rotate,
    rotation_in,
    row_part,
    times,
    write_row,
)
from floatbase.control.tick.workspace import clear
from floatbase.dynamics._compiled import MIN_TILT


class ContactTable(NamedTuple):
    """C contacts with P points."""

    # (C, 9), joint, kind, first point, number of points, of motion rows, of entries of λ, 1 if the
    # controller assumes that its forces have no effect, 3 if `inputs` has an acceleration, and the
    # joint of the other frame of a connection
    table: Any
    # (C, 19), pose of the frame in the joint (12), normal in the world, radius, axle in the frame
    frames: Any
    # (P, 4), centre of the ball or wheel, or corners, in the frame; where in λ its force starts
    points: Any
    inputs: Any  # packed by `user_terms.UserTerms`
    # where the numbers of contacts start in it, one contact after another: A, b, J and positions of
    # user-defined ones, accelerations of others
    user_start: Any
    same_rows: Any  # whether A and J are the same
    positions: Any  # (P, 3), memory for the positions of the points, world


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
def frame_jacobian(bodies: Bodies, joint, p, n_rows, out, row, other):
    """Add the Jacobian of a frame at p relative to another joint's body to out (·, nv).

    It has linear rows, then angular rows if n_rows = 6.
    """
    for r in range(0, n_rows, 3):
        body_jacobian(bodies, joint, r == 0, p, out, row + r)
        body_jacobian(bodies, other, r == 0, p, out, row + r, -1.0)


@jit
def wheel_direction(R, axis, normal, omega):
    """Return u from the lowest point of a wheel to its centre, u̇, and False if it lies on its side.

    R, omega: rotation and angular velocity of the frame. axis: axle in the frame, a unit vector.
    """
    axle = rotate(R, axis)
    rate = cross(omega, axle)
    w, along = across(axle, normal), dot(normal, axle)
    length = np.sqrt(dot(w, w))
    u = times(1.0 / length, w)
    w_rate = times(-1.0, plus(times(dot(normal, rate), axle), times(along, rate)))
    return u, times(1.0 / length, across(u, w_rate)), length >= MIN_TILT


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
    """Write A (m, nv), b (m,) of (5), J (k, nv) of (4) and the positions of all contacts.

    A and J are the same array if `same_rows`. Returns False if a wheel lies flat on its side.
    """
    row, force, nv, inputs, start = 0, 0, A.shape[1], contacts.inputs, contacts.user_start
    clear(A)
    clear(J)
    for i in range(contacts.table.shape[0]):
        joint, kind, first = contacts.table[i, 0], contacts.table[i, 1], contacts.table[i, 2]
        count = contacts.table[i, 3]
        m, k, other = contacts.table[i, 4], contacts.table[i, 5], contacts.table[i, 8]
        if kind == USER_DEFINED:
            start = copy_rows(inputs, start, m, nv, A, row)
            for r in range(m):
                b[row + r] = inputs[start + r]
            start = copy_rows(inputs, start + m, k, nv, J, force)
            start = copy_rows(inputs, start, count, 3, contacts.positions, first)
            row, force = row + m, force + k
            continue
        R, p = frame_pose(bodies, joint, contacts.frames, i)
        up, up_rate = row_part(contacts.frames, i, 12), (0.0, 0.0, 0.0)
        radius, omega = contacts.frames[i, 15], row_part(bodies.velocity, joint, 3)
        if kind == WHEEL:
            axis = row_part(contacts.frames, i, 16)
            up, up_rate, has_lowest_point = wheel_direction(R, axis, up, omega)
            if not has_lowest_point:
                return False
        for j in range(first, first + count):
            point = minus(plus(p, rotate(R, row_part(contacts.points, j, 0))), times(radius, up))
            write_row(contacts.positions, j, 0, point)
            if kind == FLAT:
                body_jacobian(bodies, joint, True, point, J, force + 3 * (j - first))
            else:
                p = point
        if kind != FLAT:
            frame_jacobian(bodies, joint, p, k, J, force, other)
        if not contacts.same_rows:
            frame_jacobian(bodies, joint, p, m, A, row, other)
        v, drift = point_velocity(bodies, joint, p)
        angular_drift = row_part(bodies.drift, joint, 3)
        if kind in (POINT, WHEEL):  # it rolls: its lowest point moves on the body
            drift = plus(drift, times(radius, cross(omega, minus(cross(omega, up), up_rate))))
        if kind == CONNECTION:
            v_other, drift_other = point_velocity(bodies, other, p)
            omega_other = row_part(bodies.velocity, other, 3)
            drift = minus(drift, plus(drift_other, cross(omega_other, minus(v, v_other))))
            angular_drift = minus(angular_drift, row_part(bodies.drift, other, 3))
        if contacts.table[i, 7] == 3:
            drift = minus(drift, (inputs[start], inputs[start + 1], inputs[start + 2]))
            start += 3
        b[row], b[row + 1], b[row + 2] = times(-1.0, drift)
        if m == 6:
            b[row + 3], b[row + 4], b[row + 5] = times(-1.0, angular_drift)
        row, force = row + m, force + k
    force = 0
    for i in range(contacts.table.shape[0]):
        if contacts.table[i, 6] == 1:
            clear(J[force : force + contacts.table[i, 5]])
        force += contacts.table[i, 5]
    return True
