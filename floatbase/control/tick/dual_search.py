"""The optimum of the QP (27) by the dual active-set method of Goldfarb and Idnani.

Source: [GoldfarbIdnani1983]_. The search starts at the optimum without inequalities, and brings one
violated inequality after another to its bound. An inequality that is never violated is only
evaluated. The multiplier of a soft inequality is at most its weight. At its weight, the inequality
leaves the active set, and its penalty becomes part of the cost. Newton's method recovers the last
digits. Functions that run for every inequality are inlined, since a call passes a hundred numbers
that describe arrays. Symbols: nb entries of β, H the Hessian, q the number of active inequalities,
mu their multipliers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from floatbase.control.tick.costs import Cost, gradient, hessian
from floatbase.control.tick.elimination import Parametrisation
from floatbase.control.tick.inequalities import (
    Inequalities,
    row_in_beta,
    soft_rows_start,
    violated_row,
    weight_of_row,
)
from floatbase.control.tick.jit import jit, jit_forceinline
from floatbase.control.tick.workspace import clear, largest, take_matrix, take_vector
from floatbase.qp import FEASIBILITY_TOLERANCE

# why there is no answer: it is inaccurate, or there seems to be none
INACCURATE, INFEASIBLE = -2, -3
# least pivot of the Cholesky factor, squared, relative to the Hessian's diagonal: less is rounding
PIVOT_TOLERANCE = 1e-13
# fraction of a row, squared, outside the active rows: with less, it depends on them
DEPENDENCE_TOLERANCE = 1e-12
# a contradiction counts only if it cannot be resolved by a β with such entries, m/s² or N
MAX_FEASIBLE = 1e4
NEWTON_STEPS = 3  # at most; one or two are enough unless weights are far apart
STEP_TOLERANCE = 1e-6  # fraction of β: after a step this small, only rounding remains
MAX_FINAL_STEP = 1e-4  # fraction of β that the last step may still change
# fraction of the largest multiplier by which one may be negative due to rounding
SIGN_TOLERANCE = 1e-9


class ActiveSet(NamedTuple):
    """The active inequalities and their factors; the first q entries of each array are in use."""

    indices: Any  # (nb,), number of each row
    mu: Any  # (nb,), its multiplier
    bounds: Any  # (nb,), its bound in h
    rows: Any  # (nb, nb), its row of G
    W: Any  # (nb, nb), with W H Wᵀ = 1
    U: Any  # (nb, nb), W rowsᵀ = U, upper triangular in its first q columns
    weights: Any  # (nb,), largest value of its multiplier, inf if it is hard


@jit
def cholesky(L):
    """Replace H in the lower triangle of L (nb, ·) by the L with L Lᵀ = H.

    Returns False if the cost is flat along a direction.
    """
    n = L.shape[0]
    for j in range(n):
        for i in range(j, n):
            total = L[i, j]
            for c in range(j):
                total -= L[i, c] * L[j, c]
            if i > j:
                L[i, j] = total / L[j, j]
            elif total <= PIVOT_TOLERANCE * L[j, j]:
                return False
            else:
                L[j, j] = np.sqrt(total)
    return True


@jit
def solve_cholesky(L, grad, x):
    """Write x (nb,) = -(L Lᵀ)⁻¹ grad."""
    n = grad.size
    for i in range(n):
        total = -grad[i]
        for c in range(i):
            total -= L[i, c] * x[c]
        x[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        x[i] /= L[i, i]
        for c in range(i):
            x[c] -= L[i, c] * x[i]


@jit
def invert_lower(L, W):
    """Write W (nb, nb) = L⁻¹, lower triangular."""
    n = L.shape[0]
    clear(W)
    for i in range(n):
        for j in range(i):
            for c in range(j + 1):
                W[i, c] -= L[i, j] * W[j, c]
        W[i, i] = 1.0
        for c in range(i + 1):
            W[i, c] /= L[i, i]


@jit_forceinline
def add_row(W, U, d, z, q):
    """Reflect rows q: of W so that d = W row is zero after entry q, and make d column q of U.

    d, z: as from `step_directions`.
    """
    n, length = d.size, 0.0
    for j in range(q, n):
        length += d[j] * d[j]
    length = np.sqrt(length) if d[q] >= 0.0 else -np.sqrt(length)
    scale = 1.0 / (length * (length + d[q]))
    for c in range(n):
        z[c] = length * W[q, c] - z[c]
    for j in range(q, n):
        factor = scale * (d[j] + length if j == q else d[j])
        for c in range(n):
            W[j, c] -= factor * z[c]
    d[q] = -length
    for i in range(q + 1):
        U[i, q] = d[i]


@jit
def drop_row(active: ActiveSet, at, q):
    """Remove row `at` from the q active ones, and rotate W so that U stays upper triangular."""
    indices, mu, bounds, rows, W, U, weights = active
    for j in range(at, q - 1):
        indices[j], mu[j], bounds[j] = indices[j + 1], mu[j + 1], bounds[j + 1]
        weights[j] = weights[j + 1]
        for c in range(rows.shape[1]):
            rows[j, c] = rows[j + 1, c]
        for i in range(j + 2):
            U[i, j] = U[i, j + 1]
    for j in range(at, q - 1):
        length = np.sqrt(U[j, j] * U[j, j] + U[j + 1, j] * U[j + 1, j])
        if length == 0.0:
            continue
        c, s = U[j, j] / length, U[j + 1, j] / length
        for i in range(j, q - 1):
            a, b = U[j, i], U[j + 1, i]
            U[j, i], U[j + 1, i] = c * a + s * b, c * b - s * a
        for i in range(W.shape[1]):
            a, b = W[j, i], W[j + 1, i]
            W[j, i], W[j + 1, i] = c * a + s * b, c * b - s * a


@jit_forceinline
def multiply_by_row(W, row, d):
    """Write d (nb,) = W row.

    Most rows have at most three entries: those of one force whose components are β.
    """
    n, count, i, j, k = row.size, 0, 0, 0, 0
    for c in range(n):
        if row[c] != 0.0:
            i, j, k = j, k, c
            count += 1
    if count > 3:
        for r in range(n):
            d[r] = 0.0
            for c in range(n):
                d[r] += W[r, c] * row[c]
        return
    a, b = row[i] if count > 2 else 0.0, row[j] if count > 1 else 0.0
    for r in range(n):
        d[r] = a * W[r, i] + b * W[r, j] + row[k] * W[r, k]


@jit_forceinline
def step_directions(W, U, d, q, z, r):
    """Write how β and the multipliers change as the multiplier of a new row grows by 1.

    d: (nb,), W times that row. z, r: (nb,), receive the step of β and the decrease of the q
    multipliers.
    """
    n, j = d.size, q
    clear(z)
    while j + 4 <= n:  # four rows at a time: each sum is loaded and stored once for all of them
        a, b, c, e = d[j], d[j + 1], d[j + 2], d[j + 3]
        for i in range(n):
            z[i] -= a * W[j, i] + b * W[j + 1, i] + c * W[j + 2, i] + e * W[j + 3, i]
        j += 4
    for rest in range(j, n):
        for i in range(n):
            z[i] -= d[rest] * W[rest, i]
    for i in range(q - 1, -1, -1):
        total = d[i]
        for j in range(i + 1, q):
            total -= U[i, j] * r[j]
        r[i] = total / U[i, i]


@jit
def saturate(number, limits: Inequalities):
    """Make the penalty of a soft inequality, whose multiplier equals its weight, part of the cost.

    If its penalty already is part of the cost, its row has the opposite sign, and the penalty
    leaves the cost.
    """
    at = number - soft_rows_start(limits)
    limits.saturated[at] = 1.0 - limits.saturated[at]


@jit
def add_penalties(limits: Inequalities, space: Parametrisation, nv, row, grad):
    """Add the gradient of the penalties of all saturated inequalities to grad. row: (nb,), memory.

    A sum over the rows has no rounding errors of penalties that have left the cost.
    """
    start, k = soft_rows_start(limits), space.V.shape[0] - nv
    for at in range(limits.saturated.size):
        if limits.saturated[at] > 0.0:
            row_in_beta(start + at, limits, space, nv, row)  # with the opposite sign
            weight = weight_of_row(start + at, limits, nv, k)
            for c in range(row.size):
                grad[c] -= weight * row[c]


@jit
def contradicts(row, bound, q, r, rest, active: ActiveSet):
    """Return whether no β of realistic size satisfies row β ≤ bound and the q active inequalities.

    By the lemma of Farkas: the row is Σ r rows with r ≤ 0, which is at least Σ r bounds. Rounding,
    or little curvature, may leave a rest of the row. r: (nb,). rest: (nb,), memory.
    """
    gap, length = -bound, 0.0
    for c in range(row.size):
        rest[c] = row[c]
    for j in range(q):
        gap += r[j] * active.bounds[j]
        for c in range(row.size):
            rest[c] -= r[j] * active.rows[j, c]
    for c in range(row.size):
        length += abs(rest[c])
    return gap > MAX_FEASIBLE * length


@jit_forceinline
def enforce(number, row, bound, weight, q, d, z, r, active: ActiveSet, limits: Inequalities, beta):
    """Bring one violated inequality to its bound; drop those whose multiplier would turn negative.

    A soft inequality whose multiplier reaches its weight is saturated instead. Updates `active` and
    `beta`. Returns the new q, or an error code. number, row, bound, weight: of that inequality, as
    in `ActiveSet`. d, z, r: (nb,), memory for `step_directions`.
    """
    n, multiplier, mu, W, U = beta.size, 0.0, active.mu, active.W, active.U
    weights, has_soft = active.weights, limits.saturated.size > 0
    for _ in range(2 * n + 2 + limits.saturated.size):
        multiply_by_row(W, row, d)
        step_directions(W, U, d, q, z, r)
        curvature, size, excess = 0.0, 0.0, -bound
        for j in range(n):
            size += d[j] * d[j]
            if j >= q:
                curvature += d[j] * d[j]
            excess += row[j] * beta[j]
        partial_step, blocking = np.inf, -1
        for j in range(q):
            if r[j] > 0.0 and mu[j] < partial_step * r[j]:
                partial_step, blocking = mu[j] / r[j], j
        saturates = False
        if has_soft:
            for j in range(q):
                if r[j] < 0.0 and weights[j] - mu[j] < -partial_step * r[j]:
                    partial_step, blocking, saturates = (weights[j] - mu[j]) / -r[j], j, True
        full_step = (
            excess / curvature if q < n and curvature > DEPENDENCE_TOLERANCE * size else np.inf
        )
        step = min(partial_step, full_step, weight - multiplier)
        if step == np.inf:
            return INFEASIBLE if contradicts(row, bound, q, r, z, active) else INACCURATE
        for j in range(q):
            mu[j] -= step * r[j]
        multiplier += step
        if full_step < np.inf:
            for j in range(n):
                beta[j] += step * z[j]
        if has_soft and multiplier >= weight:
            saturate(number, limits)
            return q
        if full_step <= partial_step:
            add_row(W, U, d, z, q)
            active.indices[q], mu[q], active.bounds[q] = number, multiplier, bound
            weights[q] = weight
            for j in range(n):
                active.rows[q, j] = row[j]
            return q + 1
        if saturates:
            saturate(active.indices[blocking], limits)
        drop_row(active, blocking, q)
        q -= 1
    return INACCURATE


@jit
def newton_step(q, grad, L, step, delta_beta, y, active: ActiveSet, beta):
    """Take one Newton step on the optimality conditions.

    The step starts from (β, mu), which are correct up to rounding, and updates both. Returns the
    largest change of an entry of β. grad: (nb,), gradient of the cost at β; overwritten. L:
    Cholesky factor of the Hessian. step, delta_beta, y: (nb,), memory.
    """
    nb, mu, rows, W, U = beta.size, active.mu, active.rows, active.W, active.U
    if q == 0:
        solve_cholesky(L, grad, delta_beta)
        for i in range(nb):
            beta[i] += delta_beta[i]
        return largest(delta_beta)
    for a in range(q):
        for c in range(nb):
            grad[c] += mu[a] * rows[a, c]
    clear(step)
    clear(delta_beta)
    for j in range(nb):
        for i in range(nb):
            step[j] -= W[j, i] * grad[i]
    for a in range(q):  # back to the bounds: Uᵀ y = h - G β
        y[a] = active.bounds[a]
        for c in range(nb):
            y[a] -= rows[a, c] * beta[c]
        for j in range(a):
            y[a] -= U[j, a] * y[j]
        y[a] /= U[a, a]
    for j in range(nb):
        along = y[j] if j < q else step[j]
        for i in range(nb):
            delta_beta[i] += along * W[j, i]
    for i in range(nb):
        beta[i] += delta_beta[i]
    # the multipliers balance the gradient that remains after the step to the bounds
    for a in range(q - 1, -1, -1):
        step[a] -= y[a]
        for j in range(a + 1, q):
            step[a] -= U[a, j] * step[j]
        step[a] /= U[a, a]
        mu[a] += step[a]
    return largest(delta_beta)


@jit
def wrong_signed_row(mu, q):
    """Return the index of the most negative of q multipliers, or -1 if none is.

    Values that are negative by rounding only do not count.
    """
    least, size, found = 0.0, 0.0, -1
    for a in range(q):
        size = max(size, abs(mu[a]))
        if mu[a] < least:
            least, found = mu[a], a
    return found if least < -SIGN_TOLERANCE * size - 1e-13 else -1


@jit
def saturated_row(active: ActiveSet, q):
    """Return the index of an active inequality whose multiplier exceeds its weight, or -1."""
    for a in range(q):
        if active.mu[a] > active.weights[a] * (1.0 + SIGN_TOLERANCE):
            return a
    return -1


@jit
def dual_search(
    cost: Cost, limits: Inequalities, space: Parametrisation, nv, workspace, indices, mu, beta
):
    """Find the β of minimum cost that satisfies all inequalities of (27).

    Returns the number of active inequalities, or an error code. indices, mu, beta: (nb,), receive
    the numbers and multipliers of the active inequalities, and the optimum.

    Newton's method refines the end of the search. The search continues if the refined point is not
    the optimum: a multiplier has the wrong sign, or an inequality is violated.
    """
    nb, d, k = beta.size, limits.torque_limits.size, space.V.shape[0] - nv
    H, grad = take_matrix(workspace, nb + 1, nb + 1), take_vector(workspace, nb)
    L = H[:nb]
    W, U = take_matrix(workspace, nb, nb), take_matrix(workspace, nb, nb)
    rows, weights = take_matrix(workspace, nb, nb), take_vector(workspace, nb)
    bounds, row = take_vector(workspace, nb), take_vector(workspace, nb)
    step, z, r = take_vector(workspace, nb), take_vector(workspace, nb), take_vector(workspace, nb)
    forces, tau, qdd = (
        take_vector(workspace, k),
        take_vector(workspace, d),
        take_vector(workspace, nv),
    )
    active = ActiveSet(indices, mu, bounds, rows, W, U, weights)
    has_soft = limits.saturated.size > 0
    clear(limits.saturated)
    hessian(cost, H, grad)
    if not cholesky(L):
        return INACCURATE
    solve_cholesky(L, grad, beta)
    q, refined, moved, number, has_factors = 0, 0, 0.0, 0, False
    for _ in range(100 + 10 * nb + 4 * limits.saturated.size):
        number = violated_row(limits, space, beta, forces, tau, qdd)
        if number < 0:
            if refined == NEWTON_STEPS:
                break
            gradient(cost, beta, grad)
            if has_soft:
                add_penalties(limits, space, nv, row, grad)
            moved = newton_step(q, grad, L, step, z, r, active, beta)
            refined = (
                refined + 1 if moved > STEP_TOLERANCE * (1.0 + largest(beta)) else NEWTON_STEPS
            )
            wrong = wrong_signed_row(mu, q)
            if wrong < 0 and has_soft:
                wrong = saturated_row(active, q)
                if wrong >= 0:
                    saturate(indices[wrong], limits)
            if wrong >= 0:
                drop_row(active, wrong, q)
                q, refined = q - 1, 0
            elif moved <= FEASIBILITY_TOLERANCE:
                break
            continue
        refined = 0
        if not has_factors:
            invert_lower(L, W)
            clear(U)
            has_factors = True
        bound = row_in_beta(number, limits, space, nv, row)
        weight = weight_of_row(number, limits, nv, k)
        q = enforce(number, row, bound, weight, q, step, z, r, active, limits, beta)
        if q < 0:
            return q
    if number >= 0 or refined == 0 or not moved <= MAX_FINAL_STEP * (1.0 + largest(beta)):
        return INACCURATE
    return q
