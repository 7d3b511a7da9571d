"""The inequalities of (27)(28), G β ≤ h, which are written out only for the rows that β violates.

Rows are numbered: F facets and the normal force of each of P points, then d upper torque limits, then d lower ones.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from floatbase.control.tick.elimination import Space
from floatbase.control.tick.jit import jit, jit_forced
from floatbase.control.tick.memory import clear
from floatbase.control.tick.vectors import dot, minus, row_part, times
from floatbase.qp import FEASIBILITY_TOLERANCE


class Inequalities(NamedTuple):
    """The inequalities on forces and torques."""

    cones: Any  # (P (F + 1), 3), rows of G for the force of each point: F facets, then -normal
    lengths: Any  # (P (F + 1),), of those rows
    facets: Any  # F
    torque_limits: Any  # (d,), N·m
    least_normal: Any  # N, least normal force of each point


@jit
def affine_value(V, beta, first, last, out):
    """out (last - first,) = rows first:last of V (·, nb + 1) times (β, 1)."""
    nb = beta.size
    for i in range(first, last):
        total = V[i, nb]
        for c in range(nb):
            total += V[i, c] * beta[c]
        out[i - first] = total


@jit_forced
def forces_of(space: Space, beta, forces):
    """forces (k,) at β; most of them are a β themselves."""
    first = space.V.shape[0] - forces.size
    for i in range(forces.size):
        if space.beta_of[first + i] >= 0:
            forces[i] = beta[space.beta_of[first + i]]
        else:
            affine_value(space.V, beta, first + i, first + i + 1, forces[i:])


@jit_forced
def worst_facet(limits: Inequalities, first, f):
    """(28) The row of a point's facets, of which `first` is the first, that the force f violates most, and by how much; or -1.

    Forces in the circle that the facets touch violate none.
    """
    normal = times(-1.0, row_part(limits.cones, first + limits.facets, 0))
    mu, along = -dot(row_part(limits.cones, first, 0), normal), dot(normal, f)
    across = minus(f, times(along, normal))
    if along >= 0.0 and dot(across, across) <= mu * mu * along * along:
        return -1, 0.0
    worst, found = 0.0, -1
    for row in range(first, first + limits.facets):
        excess = dot(row_part(limits.cones, row, 0), f)
        if excess > worst:
            worst, found = excess, row
    return found, worst


@jit
def violated_force_row(limits: Inequalities, forces):
    """The row on forces (k,) that they violate most, measured on rows of unit length; -1 where they violate none."""
    lengths, worst, found = limits.lengths, FEASIBILITY_TOLERANCE, -1
    for i in range(forces.size // 3):
        first, f = i * (limits.facets + 1), (forces[3 * i], forces[3 * i + 1], forces[3 * i + 2])
        row, excess = worst_facet(limits, first, f)
        if row >= 0 and excess > worst * lengths[row]:
            worst, found = excess / lengths[row], row
        row = first + limits.facets
        excess = dot(row_part(limits.cones, row, 0), f) + limits.least_normal
        if excess > worst * lengths[row]:
            worst, found = excess / lengths[row], row
    return found


@jit
def violated_row(limits: Inequalities, space: Space, beta, forces, tau):
    """The number of a row of (27)(28) that β (nb,) violates, -1 for none; forces (k,), tau (d,): memory.

    Torques are computed only where all forces are feasible, since they cost more.
    """
    forces_of(space, beta, forces)
    found = violated_force_row(limits, forces)
    if found >= 0:
        return found
    affine_value(space.T, beta, 0, tau.size, tau)
    worst, n_force_rows = FEASIBILITY_TOLERANCE, limits.lengths.size
    for j in range(tau.size):
        excess = abs(tau[j]) - limits.torque_limits[j]
        if excess > worst:
            worst, found = excess, n_force_rows + (j if tau[j] > 0.0 else tau.size + j)
    return found


@jit
def row_in_beta(number, limits: Inequalities, space: Space, out):
    """A row of (27)(28) by its number: out (nb,) = its row of G. Returns its bound in h."""
    V, T, cones = space.V, space.T, limits.cones
    nb, d, force_rows = V.shape[1] - 1, T.shape[0], cones.shape[0]
    clear(out)
    if number < force_rows:
        n_rows = limits.facets + 1
        first = V.shape[0] - 3 * (force_rows // n_rows) + 3 * (number // n_rows)
        bound = -limits.least_normal if number % n_rows == limits.facets else 0.0
        for r in range(3):
            for c in range(nb):
                out[c] += cones[number, r] * V[first + r, c]
            bound -= cones[number, r] * V[first + r, nb]
        return bound
    joint = (number - force_rows) % d
    sign = 1.0 if number - force_rows < d else -1.0
    for c in range(nb):
        out[c] = sign * T[joint, c]
    return limits.torque_limits[joint] - sign * T[joint, nb]
