"""The inequalities G β ≤ h of eqs. (27), (28), assembled only for the rows that β violates.

Rows are numbered: F facets and the minimum normal force of each of P points, then their P maximum
normal forces, d upper torque limits, d lower ones, d largest joint accelerations, d least ones, and
the user-defined rows. The last three groups can be soft (`Inequalities.saturated`). Code that every
problem needs is inlined into the search (`jit_forceinline`); code that few problems need is not.
Without this choice the compiler inlines neither, and a tick with many active rows takes 6 % longer.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from floatbase import _geometry
from floatbase.control.tick.dynamics import Bodies, centre_of_mass
from floatbase.control.tick.elimination import Parametrisation, add_entry
from floatbase.control.tick.jit import jit, jit_forceinline
from floatbase.control.tick.problem_arrays import CAPTURE_POINT, FORCES, QDD, TAU
from floatbase.control.tick.vectors import dot, minus, row_part, times
from floatbase.control.tick.workspace import clear
from floatbase.qp import FEASIBILITY_TOLERANCE

first_corner, next_corner = jit(_geometry.first_corner), jit(_geometry.next_corner)


class Inequalities(NamedTuple):
    """The inequalities on accelerations, forces and torques."""

    # (P (F + 1), 5), F facets, then -normal of each point: row of G for its force, length, where in
    # λ its force starts
    cones: Any
    facets: Any  # F
    points: Any  # P
    torque_limits: Any  # (d,), N·m
    inputs: Any  # packed by `user_terms.UserTerms`
    bounds: Any  # where the P minimum and P maximum normal forces start in it, N
    # user-defined rows, one group after another: block, number m of rows, weight (0 if hard),
    # G (m, n), h (m,); see `group_size` and `capture_point_rows`
    groups: Any
    n_groups: Any  # their number
    com: Any  # (3, nb + 1 or more), horizontal acceleration of the CoM in (β, 1), then memory
    has_cones: Any  # whether the controller assumes friction and minimum normal forces
    has_optional: Any  # whether there are any of these, or a maximum normal force
    has_joint_limits: Any
    least: Any  # (d,), bounds of the joint accelerations, rad/s² or m/s²; -inf for none
    largest: Any  # (d,), and inf for none
    joint_weight: Any  # weight of joint limits if they are soft, 0 if they are hard
    # 1 for each row on joint accelerations, or user-defined row, that is soft and saturated: its
    # multiplier began at its weight and its violation is part of the cost. The row then acts with
    # the opposite sign: it is violated if its constraint holds with a margin. Empty if no row is
    # soft
    saturated: Any


@jit
def largest_acceleration(gap, v, speed, acceleration, brake, most, dt):
    """Return the largest joint acceleration towards a limit, as `JointLimits.bounds` does.

    gap: distance to the limit. v: velocity towards it. speed, acceleration: limits. brake, most:
    planned and largest deceleration. dt: control period, s.
    """
    bound = min(acceleration, (speed - v) / dt)
    if gap < np.inf:
        stop, position = -v / dt, 2.0 * (gap - v * dt) / dt**2
        if v > 0.0 and gap > 0.0 and position <= stop:
            position = min(stop, -(v**2) / (2.0 * gap))
        viable, square = stop, brake * (8.0 * gap - 4.0 * v * dt + brake * dt**2)
        if square >= 0.0:
            viable = max(stop, (np.sqrt(square) - 2.0 * v - brake * dt) / (2.0 * dt))
        bound = min(bound, position, viable)
    return max(bound, -most)


@jit
def joint_bounds(q, v, tree, table, dt, least, largest):
    """Write the bounds of the joint accelerations into least and largest, (d,).

    tree: as in `Model`. table: (6, d), lower and upper position limits, speeds, accelerations,
    planned and largest decelerations. dt: control period, s.
    """
    d = least.size
    for j in range(d):
        joint = tree.shape[0] - d + j
        x, speed = q[tree[joint, 3]], v[tree[joint, 1]]
        largest[j] = largest_acceleration(
            table[1, j] - x, speed, table[2, j], table[3, j], table[4, j], table[5, j], dt
        )
        least[j] = -largest_acceleration(
            x - table[0, j], -speed, table[2, j], table[3, j], table[4, j], table[5, j], dt
        )
        if least[j] > largest[j]:
            least[j] = largest[j] = 0.5 * (least[j] + largest[j])


@jit
def affine_value(V, beta, first, last, out):
    """Write rows first:last of V (·, nb + 1) times (β, 1) into out (last - first,)."""
    nb = beta.size
    for i in range(first, last):
        total = V[i, nb]
        for c in range(nb):
            total += V[i, c] * beta[c]
        out[i - first] = total


@jit_forceinline
def forces_of(space: Parametrisation, beta, forces):
    """Write forces (k,) at β; most of them are components of β."""
    first = space.V.shape[0] - forces.size
    for i in range(forces.size):
        if space.beta_index[first + i] >= 0:
            forces[i] = beta[space.beta_index[first + i]]
        else:
            affine_value(space.V, beta, first + i, first + i + 1, forces[i:])


@jit_forceinline
def worst_facet(limits: Inequalities, first, f):
    """Return the row of the facet that a point's force f violates most, or -1, and by how much.

    The facets are those of eq. (28). first: row of the point's first facet. Forces inside the
    circle that the facets touch violate none.
    """
    normal = times(-1.0, row_part(limits.cones, first + limits.facets, 0))
    mu, normal_force = -dot(row_part(limits.cones, first, 0), normal), dot(normal, f)
    tangential_force = minus(f, times(normal_force, normal))
    if (
        normal_force >= 0.0
        and dot(tangential_force, tangential_force) <= mu * mu * normal_force * normal_force
    ):
        return -1, 0.0
    worst, found = 0.0, -1
    for row in range(first, first + limits.facets):
        excess = dot(row_part(limits.cones, row, 0), f)
        if excess > worst:
            worst, found = excess, row
    return found, worst


@jit_forceinline
def violated_force_row(limits: Inequalities, forces):
    """Return the row on forces that forces (k,) violate most, or -1 if they satisfy all rows.

    Violations are measured on rows of unit length.
    """
    cones, worst, found = limits.cones, FEASIBILITY_TOLERANCE, -1
    n_rows = limits.facets + 1
    for i in range(limits.points if limits.has_cones else 0):
        first, at = i * n_rows, int(cones[i * n_rows, 4])
        f = forces[at], forces[at + 1], forces[at + 2]
        row, excess = worst_facet(limits, first, f)
        if row >= 0 and excess > worst * cones[row, 3]:
            worst, found = excess / cones[row, 3], row
        row = first + limits.facets
        excess = dot(row_part(cones, row, 0), f) + limits.inputs[limits.bounds + i]
        if excess > worst * cones[row, 3]:
            worst, found = excess / cones[row, 3], row
    return found


@jit
def group_size(block, nv, k, d):
    """Return how many unknowns a group of rows acts on: q̈, λ, τ, or the CoM's x and y."""
    return nv if block == QDD else (k if block == FORCES else (d if block == TAU else 2))


@jit
def capture_points(limits: Inequalities, bodies: Bodies, positions, space: Parametrisation):
    """Write the rows of all capture-point inequalities, and `limits.com`.

    positions: (P, 3), of the contact points. Returns False if one has no support polygon.
    """
    nv, d = bodies.v.size, space.T.shape[0]
    at, k = 0, space.V.shape[0] - nv
    for _ in range(limits.n_groups):
        block, m = int(limits.groups[at]), int(limits.groups[at + 1])
        if block == CAPTURE_POINT:
            if not capture_point_rows(bodies, positions, limits.groups[at + 3 :]):
                return False
            clear(limits.com)
            _, _, drift, mass = centre_of_mass(bodies)
            for r in range(2):
                limits.com[r, space.V.shape[1] - 1] = drift[r]
                for c in range(nv):
                    entry = bodies.Ag[c, r] / mass
                    add_entry(entry, space.V, space.beta_index, c, limits.com, r)
        at += 3 + m * (group_size(block, nv, k, d) + 1)
    return True


@jit
def capture_point_rows(bodies: Bodies, points, rows):
    """Write n · c̈ ≤ h for each edge of the support polygon, as `CapturePointRows` does.

    rows: margin, horizon and gravity; receives n for the edge that starts at each of the points,
    (P, 2), then h, (P,), and zeros for points that are not corners. Returns False if the polygon
    has no interior, or if the centre of mass is not above it.
    """
    margin, horizon, gravity = rows[0], rows[1], rows[2]
    n, height = points.shape[0], 0.0
    p, velocity, _, _ = centre_of_mass(bodies)
    for i in range(n):
        height += (p[2] - points[i, 2]) / n
    if not height > 0.0:
        return False
    omega = np.sqrt(gravity / height)
    gain, ahead = 0.5 * horizon**2 + horizon / omega, horizon + 1.0 / omega
    x, y = p[0] + ahead * velocity[0], p[1] + ahead * velocity[1]
    clear(rows[: 3 * n])
    corner, n_edges = first_corner(points), 0
    for _ in range(n):
        end, at = next_corner(points, corner), 2 * corner
        dx, dy = points[end, 0] - points[corner, 0], points[end, 1] - points[corner, 1]
        if end == corner or rows[at] != 0.0 or rows[at + 1] != 0.0:
            break
        length = np.sqrt(dx * dx + dy * dy)
        nx, ny = dy / length, -dx / length
        distance = nx * (points[corner, 0] - x) + ny * (points[corner, 1] - y)
        rows[at], rows[at + 1] = nx, ny
        rows[2 * n + corner] = (distance - margin) / gain
        corner, n_edges = end, n_edges + 1
    return n_edges >= 3


@jit_forceinline
def force_rows_of(limits: Inequalities):
    """Return the number of rows on forces."""
    return limits.cones.shape[0] + limits.points


@jit_forceinline
def soft_rows_start(limits: Inequalities):
    """Return the number of the first row that can be soft."""
    return force_rows_of(limits) + 2 * limits.torque_limits.size


@jit
def violated_joint_row(limits: Inequalities, space: Parametrisation, beta, qdd):
    """Return the row on joint accelerations that β (nb,) violates most, or -1. qdd: memory."""
    d = limits.least.size
    first, start = qdd.size - d, soft_rows_start(limits)
    affine_value(space.V, beta, first, qdd.size, qdd[first:])
    worst, found = FEASIBILITY_TOLERANCE, -1
    for j in range(d):
        above, below = qdd[first + j] - limits.largest[j], limits.least[j] - qdd[first + j]
        if limits.saturated.size > 0:
            above = -above if limits.saturated[j] > 0.0 else above
            below = -below if limits.saturated[d + j] > 0.0 else below
        if above > worst:
            worst, found = above, start + j
        if below > worst:
            worst, found = below, start + d + j
    return found


@jit
def violated_optional_row(limits: Inequalities, space: Parametrisation, beta, forces, tau, qdd):
    """Do the same as `violated_row` for maximum normal forces and user-defined rows.

    Violations are measured on rows of unit length. forces, tau: (k,), (d,), those at β. qdd: (nv,),
    memory.
    """
    worst, found, has_qdd, cones = FEASIBILITY_TOLERANCE, -1, False, limits.cones
    for i in range(limits.points):
        row = i * (limits.facets + 1) + limits.facets
        start = int(cones[row, 4])
        normal_force = -dot(
            row_part(cones, row, 0), (forces[start], forces[start + 1], forces[start + 2])
        )
        excess = normal_force - limits.inputs[limits.bounds + limits.points + i]
        if excess > worst * cones[row, 3]:
            worst, found = excess / cones[row, 3], cones.shape[0] + i
    start, groups = soft_rows_start(limits), limits.groups
    at, number = 0, start + 2 * tau.size
    for _ in range(limits.n_groups):
        block, m = int(groups[at]), int(groups[at + 1])
        if block == QDD and not has_qdd:
            affine_value(space.V, beta, 0, qdd.size, qdd)
            has_qdd = True
        x = qdd if block == QDD else (forces if block == FORCES else tau)
        if block == CAPTURE_POINT:
            x = limits.com[2, :2]
            affine_value(limits.com, beta, 0, 2, x)
        for i in range(m):
            excess, square = -groups[at + 3 + m * x.size + i], 0.0
            for c in range(x.size):
                entry = groups[at + 3 + i * x.size + c]
                excess += entry * x[c]
                square += entry * entry
            if limits.saturated.size > 0 and limits.saturated[number + i - start] > 0.0:
                excess = -excess
            length = np.sqrt(square) if square > 0.0 else 1.0
            if excess > worst * length:
                worst, found = excess / length, number + i
        at, number = at + 3 + m * (x.size + 1), number + m
    return found


@jit_forceinline
def violated_row(limits: Inequalities, space: Parametrisation, beta, forces, tau, qdd):
    """Return the number of a row of (27)(28) that β (nb,) violates, or -1.

    forces (k,), tau (d,), qdd (nv,): memory. Joint accelerations come first: while they are not
    feasible, forces and torques may violate rows that the optimum satisfies, and the search would
    add these rows and drop them again. Torques cost more than forces and are computed only if all
    forces are feasible. Rows that few problems have come last.
    """
    if limits.has_joint_limits:
        number = violated_joint_row(limits, space, beta, qdd)
        if number >= 0:
            return number
    forces_of(space, beta, forces)
    found = violated_force_row(limits, forces)
    if found >= 0:
        return found
    affine_value(space.T, beta, 0, tau.size, tau)
    worst, n_force_rows = FEASIBILITY_TOLERANCE, force_rows_of(limits)
    for j in range(tau.size):
        excess = abs(tau[j]) - limits.torque_limits[j]
        if excess > worst:
            worst, found = excess, n_force_rows + (j if tau[j] > 0.0 else tau.size + j)
    if found < 0 and limits.has_optional:
        return violated_optional_row(limits, space, beta, forces, tau, qdd)
    return found


@jit
def user_row_in_beta(number, limits: Inequalities, space: Parametrisation, nv, out):
    """Do the same as `row_in_beta` for a user-defined row, numbered from the first of them."""
    V, T, groups, at = space.V, space.T, limits.groups, 0
    k, nb = V.shape[0] - nv, V.shape[1] - 1
    clear(out)
    while True:
        block, m = int(groups[at]), int(groups[at + 1])
        size = group_size(block, nv, k, T.shape[0])
        if number < m:
            break
        at, number = at + 3 + m * (size + 1), number - m
    bound = groups[at + 3 + m * size + number]
    for i in range(size):
        entry = groups[at + 3 + number * size + i]
        if entry != 0.0:
            row = limits.com[i] if block == CAPTURE_POINT else (T[i] if block == TAU else V[i])
            if block == FORCES:
                row = V[nv + i]
            for c in range(nb):
                out[c] += entry * row[c]
            bound -= entry * row[nb]
    return bound


@jit
def joint_row_in_beta(number, limits: Inequalities, space: Parametrisation, nv, out):
    """Do the same as `row_in_beta` for joint accelerations, numbered from the first of them."""
    d, nb = limits.least.size, out.size
    joint = number % d
    sign = 1.0 if number < d else -1.0
    for c in range(nb):
        out[c] = sign * space.V[nv - d + joint, c]
    bound = limits.largest[joint] if number < d else -limits.least[joint]
    return bound - sign * space.V[nv - d + joint, nb]


@jit
def soft_row_in_beta(number, limits: Inequalities, space: Parametrisation, nv, out):
    """Do the same as `row_in_beta` for rows that can be soft, numbered from the first of them.

    A saturated row gets the opposite sign.
    """
    d = limits.least.size
    if number < 2 * d:
        bound = joint_row_in_beta(number, limits, space, nv, out)
    else:
        bound = user_row_in_beta(number - 2 * d, limits, space, nv, out)
    if limits.saturated.size > 0 and limits.saturated[number] > 0.0:
        for c in range(out.size):
            out[c] = -out[c]
        bound = -bound
    return bound


@jit
def weight_of_row(number, limits: Inequalities, nv, k):
    """Return the weight of a row by its number: the largest value of its multiplier, inf if hard.

    k: number of entries of λ.
    """
    number -= soft_rows_start(limits)
    if number < 0 or limits.saturated.size == 0:
        return np.inf
    d, groups, at = limits.least.size, limits.groups, 0
    weight = limits.joint_weight
    if number >= 2 * d:
        number -= 2 * d
        while number >= int(groups[at + 1]):
            block, m = int(groups[at]), int(groups[at + 1])
            at, number = at + 3 + m * (group_size(block, nv, k, d) + 1), number - m
        weight = groups[at + 2]
    return weight if weight > 0.0 else np.inf


@jit_forceinline
def row_in_beta(number, limits: Inequalities, space: Parametrisation, nv, out):
    """Write a row of G of (27)(28) by its number into out (nb,); return its bound in h."""
    V, T, cones = space.V, space.T, limits.cones
    nb, d, n_cone_rows = V.shape[1] - 1, T.shape[0], cones.shape[0]
    force_rows = force_rows_of(limits)
    if number >= force_rows + 2 * d:
        return soft_row_in_beta(number - force_rows - 2 * d, limits, space, nv, out)
    clear(out)
    if number < force_rows:
        n_rows, row, sign, bound = limits.facets + 1, number, 1.0, 0.0
        if number >= n_cone_rows:  # maximum normal force: the minimum's row with the opposite sign
            row, sign = (number - n_cone_rows) * n_rows + limits.facets, -1.0
            bound = limits.inputs[limits.bounds + limits.points + number - n_cone_rows]
        elif number % n_rows == limits.facets:
            bound = -limits.inputs[limits.bounds + number // n_rows]
        first = nv + int(cones[row, 4])
        for r in range(3):
            factor = sign * cones[row, r]
            for c in range(nb):
                out[c] += factor * V[first + r, c]
            bound -= factor * V[first + r, nb]
        return bound
    joint = (number - force_rows) % d
    sign = 1.0 if number - force_rows < d else -1.0
    for c in range(nb):
        out[c] = sign * T[joint, c]
    return limits.torque_limits[joint] - sign * T[joint, nb]
