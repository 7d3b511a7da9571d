"""The tasks as one quadratic cost in β: eqs. (18), (26)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from floatbase.control.tick.dynamics import Bodies, angular_momentum, centre_of_mass, point_velocity
from floatbase.control.tick.elimination import Parametrisation, add_entry, add_product
from floatbase.control.tick.inequalities import group_size
from floatbase.control.tick.jit import jit
from floatbase.control.tick.kinematics import ContactTable, body_jacobian, frame_pose
from floatbase.control.tick.problem_arrays import QDD, TAU
from floatbase.control.tick.targets import (
    ANGULAR_MOMENTUM,
    AXIS,
    CENTRE_OF_PRESSURE,
    COM,
    FORCE,
    FRAME,
    ORIENTATION,
    POSTURE,
    TORQUE,
)
from floatbase.control.tick.vectors import (
    across,
    column_part,
    cross,
    dot,
    minus,
    plus,
    rotate,
    row_part,
    times,
)
from floatbase.control.tick.workspace import clear, take_matrix, take_vector
from floatbase.robots import UNIT_NORM_TOLERANCE

_MAX_ROTATION_ERROR = 1e-9  # of entries of RᵀR: the reference backend corrects or refuses others
_SMALL_SINE = 1e-9  # as in `AxisTask`
_MIN_LENGTH = 1e-6  # of a direction: the reference backend decides about shorter ones


class TaskTable(NamedTuple):
    """N rows of tasks; most tasks have one."""

    # (N, 7), kind, joint, joint of the reference, then indices in targets: from one row of the
    # value to the next, of the value, of velocity and acceleration
    table: Any
    gains: Any  # (N, 3), weight, kp, kd
    # (2 N, 12), poses of the frame and of the reference in their joints: rotation column by column,
    # then position. The x axis of the frame is the one of an axis task
    frames: Any
    # of all tasks, one after another: position, rotation row by row or q, then velocity and
    # acceleration
    targets: Any
    # where user-defined tasks start among them, one after another: block, m, weight, A (m, n), b
    # (m,)
    user_start: Any
    n_user: Any  # number of user-defined tasks
    n_user_rows: Any  # the sum of their m


class Cost(NamedTuple):
    """½ ‖R (β, 1)‖² + ½ Σ diagonal β² - linearᵀ β."""

    R: Any  # (·, nb + 1), a multiple of four rows, of which the last may be zero
    diagonal: Any  # (nb,), from terms on single entries of (q̈, λ) that are components of β
    linear: Any  # (nb,), likewise


@jit
def rotation_error(R, target):
    """Return e = log(R targetᵀ) of two rotations, world, and False if the angle is too large."""
    e = times(
        0.5, plus(plus(cross(target[0], R[0]), cross(target[1], R[1])), cross(target[2], R[2]))
    )
    sine = np.sqrt(dot(e, e))
    cosine = 0.5 * (dot(target[0], R[0]) + dot(target[1], R[1]) + dot(target[2], R[2]) - 1.0)
    scale = 1.0 + sine * sine / 6.0 if sine < 1e-4 else np.arctan2(sine, cosine) / sine
    return times(scale, e), cosine > -0.9  # beyond, the sine does not determine the axis


@jit
def is_rotation(x, y, z):
    """Return whether three columns are a rotation matrix, to `_MAX_ROTATION_ERROR`."""
    normal = minus(cross(x, y), z)
    error = max(abs(dot(x, x) - 1.0), abs(dot(y, y) - 1.0), abs(dot(x, y)))
    return max(error, abs(normal[0]), abs(normal[1]), abs(normal[2])) < _MAX_ROTATION_ERROR


@jit
def strided(numbers, first, stride):
    """Return three numbers of an array, from index `first` on, one in `stride`."""
    return numbers[first], numbers[first + stride], numbers[first + 2 * stride]


@jit
def direction_rates(n, omega, alpha):
    """Return n × ṅ and n × n̈ of a direction with angular velocity ω and acceleration α."""
    return across(n, omega), plus(across(n, alpha), times(dot(n, omega), cross(n, omega)))


@jit
def axis_error(n, d):
    """Return e, the smallest rotation vector from d to n, and False if they are opposite."""
    along, cosine = cross(d, n), dot(d, n)
    sine = np.sqrt(dot(along, along))
    scale = np.arctan2(sine, cosine) / sine if sine > _SMALL_SINE else 1.0
    return times(scale, along), sine > _SMALL_SINE or cosine > 0.0


@jit
def motion_task(i, tasks: TaskTable, bodies: Bodies, rows):
    """Return e, ė and J̇ v - desired acceleration of row i of the tasks, and whether it is valid.

    Frames may be relative to a frame that moves; all vectors are in world axes nevertheless, which
    does not change the cost. It is invalid if an angle is too large or if the target is no rotation
    matrix or direction. rows: (3, nv), receives the Jacobian.
    """
    clear(rows)
    kind, joint, reference = tasks.table[i, 0], tasks.table[i, 1], tasks.table[i, 2]
    targets, stride, at = tasks.targets, tasks.table[i, 3], tasks.table[i, 4]
    x, velocity = strided(targets, at, stride), strided(targets, tasks.table[i, 5], 1)
    acceleration, e, valid = strided(targets, tasks.table[i, 6], 1), (0.0, 0.0, 0.0), True
    if kind <= ANGULAR_MOMENTUM:
        p, e_dot, drift, mass = centre_of_mass(bodies)
        first, scale = 0, 1.0 / mass
        if kind == COM:
            e = minus(p, x)
        else:
            e_dot, drift = angular_momentum(bodies)
            first, scale = 3, 1.0
        for r in range(3):
            for c in range(rows.shape[1]):
                rows[r, c] = scale * bodies.Ag[c, first + r]
        return e, minus(e_dot, velocity), minus(drift, acceleration), valid
    R, p = frame_pose(bodies, joint, tasks.frames, 2 * i)
    R_reference, origin = frame_pose(bodies, reference, tasks.frames, 2 * i + 1)
    body_jacobian(bodies, joint, kind == FRAME, p, rows, 0)
    body_jacobian(bodies, reference, kind == FRAME, p, rows, 0, -1.0)
    omega = row_part(bodies.velocity, reference, 3)
    if kind == FRAME:
        e = minus(p, plus(origin, rotate(R_reference, x)))
        (e_dot, drift), coriolis = point_velocity(bodies, joint, p), 2.0
        reference_velocity, reference_drift = point_velocity(bodies, reference, p)
    else:
        e_dot, drift = row_part(bodies.velocity, joint, 3), row_part(bodies.drift, joint, 3)
        coriolis = 1.0
        reference_velocity, reference_drift = omega, row_part(bodies.drift, reference, 3)
    if kind == ORIENTATION:
        y, z = strided(targets, at + 1, stride), strided(targets, at + 2, stride)
        target = rotate(R_reference, x), rotate(R_reference, y), rotate(R_reference, z)
        e, valid = rotation_error(R, target)
        valid = valid and is_rotation(x, y, z)
        if stride == 4:  # a homogeneous matrix; `e` does not depend on its last row
            u, one = strided(targets, at + 12, 1), targets[at + 15]
            valid = valid and max(dot(u, u), abs(one - 1.0)) < _MAX_ROTATION_ERROR
    elif kind == AXIS:  # the first column of R
        n, length = R[0], np.sqrt(dot(x, x))
        direction = times(1.0 / length, x)
        e, valid = axis_error(n, direction)
        valid = valid and length > _MIN_LENGTH
        e_dot, drift = direction_rates(n, e_dot, drift)
        velocity, acceleration = direction_rates(direction, velocity, acceleration)
        velocity, acceleration = across(n, velocity), across(n, acceleration)
        for c in range(rows.shape[1]):
            rows[0, c], rows[1, c], rows[2, c] = across(n, column_part(rows, 0, c))
    e_dot = minus(e_dot, reference_velocity)
    drift = minus(minus(drift, reference_drift), times(coriolis, cross(omega, e_dot)))
    return (
        e,
        minus(e_dot, rotate(R_reference, velocity)),
        minus(drift, rotate(R_reference, acceleration)),
        valid,
    )


@jit
def posture_error(tree, q, v, target, base, e, e_dot):
    """Write e and ė, (d,), of all joints; joints without limits are (cos, sin) in q.

    target: q (nq,), then velocities (d,). base: index of the first joint in v. Returns False if
    such a pair in the target does not have length 1.
    """
    for i in range(1, tree.shape[0]):
        row, at = tree[i, 1] - base, tree[i, 3]
        if row < 0:
            continue
        e_dot[row] = v[tree[i, 1]] - target[q.size + row]
        if tree[i, 4] == 1:
            e[row] = q[at] - target[at]
        else:
            sine = q[at + 1] * target[at] - q[at] * target[at + 1]
            e[row] = np.arctan2(sine, q[at] * target[at] + q[at + 1] * target[at + 1])
            length = np.sqrt(target[at] ** 2 + target[at + 1] ** 2)
            if abs(length - 1.0) > UNIT_NORM_TOLERANCE:
                return False
    return True


@jit
def contact_costs(A, b, weight, space: Parametrisation, R):
    """Write (weight / 2) ‖A q̈ - b‖² of soft contacts, eq. (5), into the first rows of R.

    Returns the number of these rows.
    """
    clear(R[: b.size])
    add_product(A, space.V, space.beta_index, R, 0)
    root, last = np.sqrt(weight), R.shape[1] - 1
    for i in range(b.size):
        R[i, last] -= b[i]
        for c in range(R.shape[1]):
            R[i, c] *= root
    return b.size


@jit
def moment_rows(contacts: ContactTable, target, factor, space: Parametrisation, nv, R, row):
    """Write the horizontal moment of all forces about a point, times a factor, to two rows of R."""
    V, beta_index = space.V, space.beta_index
    clear(R[row : row + 2])
    for i in range(contacts.points.shape[0]):
        x, y, z = times(factor, minus(row_part(contacts.positions, i, 0), target))
        force = nv + int(contacts.points[i, 3])
        add_entry(y, V, beta_index, force + 2, R, row)
        add_entry(-z, V, beta_index, force + 1, R, row)
        add_entry(z, V, beta_index, force, R, row + 1)
        add_entry(-x, V, beta_index, force + 2, R, row + 1)


@jit
def task_costs(
    q, v, bodies: Bodies, contacts: ContactTable, tasks: TaskTable, space: Parametrisation, base,
    workspace, cost: Cost, used,
):  # fmt: skip
    """Add Σ (weight / 2) ‖residual‖² of all tasks, eqs. (18), (26), to `cost`.

    Returns the number of rows of R, or -1 if an angle is too large. q: (nq,). v: (nv,). base:
    number of rows of (7) without a motor, 6 or 0. used: number of rows of R that are in use.
    """
    R, nv, d, nb = cost.R, v.size, space.T.shape[0], cost.linear.size
    k = space.V.shape[0] - nv
    rows = take_matrix(workspace, 3, nv)
    e_joint, e_dot_joint = take_vector(workspace, d), take_vector(workspace, d)
    # of the terms (weight / 2) (x - desired)² on single entries x of (q̈, λ, τ), and weight ×
    # desired
    weights, weighted = take_vector(workspace, nv + k + d), take_vector(workspace, nv + k + d)
    clear(weights)
    clear(weighted)
    for i in range(tasks.table.shape[0]):
        kind, at = tasks.table[i, 0], tasks.table[i, 4]
        w, kp, kd = tasks.gains[i, 0], tasks.gains[i, 1], tasks.gains[i, 2]
        if kind <= AXIS:
            e, e_dot, bias, valid = motion_task(i, tasks, bodies, rows)
            if not valid:
                return -1
            root = np.sqrt(w)
            clear(R[used : used + 3])
            for r in range(3):
                for c in range(nv):
                    rows[r, c] *= root
            add_product(rows, space.V, space.beta_index, R, used)
            constant = times(root, plus(bias, plus(times(kp, e), times(kd, e_dot))))
            R[used, nb], R[used + 1, nb], R[used + 2, nb] = plus(column_part(R, used, nb), constant)
            used += 3
        elif kind == CENTRE_OF_PRESSURE:
            target = strided(tasks.targets, at, 1)
            moment_rows(contacts, target, np.sqrt(w), space, nv, R, used)
            used += 2
        else:
            first = nv + k if kind == TORQUE else (nv if kind == FORCE else base)
            if kind == POSTURE:
                target = tasks.targets[at:]
                if not posture_error(bodies.tree, q, v, target, base, e_joint, e_dot_joint):
                    return -1
                at += q.size + d  # the accelerations
            for j in range(k if kind == FORCE else d):
                desired = tasks.targets[at + j]
                if kind == POSTURE:
                    desired -= kp * e_joint[j] + kd * e_dot_joint[j]
                weights[first + j] += w
                weighted[first + j] += w * desired
    used = user_task_costs(used, tasks, space, nv, R)
    used = single_entry_costs(used, weights, weighted, space, cost)
    multiple = 4 * ((used + 3) // 4)
    clear(R[used:multiple])
    return multiple


@jit
def count_user_rows(inputs, at, n_user, nv, k, d):
    """Return the number of rows of all user-defined tasks, and the index in `inputs` after them.

    at: index in `inputs` of the first of the `n_user` tasks.
    """
    rows = 0
    for _ in range(n_user):
        block, m = int(inputs[at]), int(inputs[at + 1])
        at = at + 3 + m * (1 + group_size(block, nv, k, d))
        rows += m
    return rows, at


@jit
def user_task_costs(used, tasks: TaskTable, space: Parametrisation, nv, R):
    """Add (weight / 2) ‖A x + b‖² of user-defined tasks to R; return the number of rows in use."""
    inputs, at, V, T = tasks.targets, tasks.user_start, space.V, space.T
    k, d, nb = V.shape[0] - nv, T.shape[0], V.shape[1] - 1
    clear(R[used : used + tasks.n_user_rows])
    for _ in range(tasks.n_user):
        block, m, root = int(inputs[at]), int(inputs[at + 1]), np.sqrt(inputs[at + 2])
        size, at = group_size(block, nv, k, d), at + 3
        for r in range(m):
            for i in range(size):
                entry = root * inputs[at + r * size + i]
                if entry != 0.0 and block != TAU:
                    add_entry(entry, V, space.beta_index, i if block == QDD else nv + i, R, used)
                elif entry != 0.0:
                    for c in range(nb + 1):
                        R[used, c] += entry * T[i, c]
            R[used, nb] += root * inputs[at + m * size + r]
            used += 1
        at += m * (size + 1)
    return used


@jit
def single_entry_costs(used, weights, weighted, space: Parametrisation, cost: Cost):
    """Add Σ (weight / 2) (x - desired)² over the entries x of (q̈, λ, τ) to a cost.

    Returns the number of rows of R in use. weights, weighted: (n + d,), weight and weight × desired
    of each entry. Components of β need no row of R.
    """
    V, beta_index, T = space
    R, diagonal, linear = cost
    n, nb = V.shape[0], V.shape[1] - 1
    clear(diagonal)
    clear(linear)
    for i in range(n + T.shape[0]):
        if i < n and beta_index[i] >= 0:
            diagonal[beta_index[i]], linear[beta_index[i]] = weights[i], weighted[i]
        elif weights[i] > 0.0:
            row = V[i] if i < n else T[i - n]
            root = np.sqrt(weights[i])
            for c in range(nb + 1):
                R[used, c] = root * row[c]
            R[used, nb] -= weighted[i] / root
            used += 1
    return used


@jit
def hessian(cost: Cost, H, grad):
    """Write the lower triangle of the Hessian and the gradient at β = 0.

    H: (nb + 1, nb + 1), receives the triangle in its first nb rows. grad: (nb,).
    """
    R, diagonal, linear = cost
    nb = diagonal.size
    clear(H)
    # four rows at a time: each sum is loaded and stored once for all of them
    for i in range(0, R.shape[0], 4):
        for r in range(nb + 1):
            a, b, c, d = R[i, r], R[i + 1, r], R[i + 2, r], R[i + 3, r]
            for s in range(r + 1):
                H[r, s] += a * R[i, s] + b * R[i + 1, s] + c * R[i + 2, s] + d * R[i + 3, s]
    for r in range(nb):
        H[r, r] += diagonal[r]
        grad[r] = H[nb, r] - linear[r]


@jit
def gradient(cost: Cost, beta, grad):
    """Write the gradient (nb,) at β, residual by residual.

    The sum of residuals has digits that the Hessian has lost.
    """
    R, diagonal, linear = cost
    nb = beta.size
    for c in range(nb):
        grad[c] = diagonal[c] * beta[c] - linear[c]
    for i in range(R.shape[0]):
        residual = R[i, nb]
        for c in range(nb):
            residual += R[i, c] * beta[c]
        for c in range(nb):
            grad[c] += residual * R[i, c]
