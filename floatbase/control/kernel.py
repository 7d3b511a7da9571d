"""The tick, compiled: (26)(27) written out over plain arrays, for `compiled.py` to fill and call.

The same problem as `controller.build_qp`, solved on another way that costs a fraction: where the readable path takes an
SVD for the space of motions (13), this one eliminates variables one by one, and where that one hands every row to a
solver, this one looks at a row only when it is violated.

    sweep         velocities and drifts of all joints from Pinocchio's world Jacobian        (1)
    contact_rows  A, b, J of the contacts                                                     (4)(5)
    motions       q̈ and λ as maps of β: Gauss-Jordan on the equalities                        (13)(17)
    torques       τ as a map of β, from the joint rows of (7)                                 (16)
    objective     R, r with Σ (weight / 2) ‖residual‖² = ½ ‖R β + r‖² + the unit rows         (18)(26)
    dual_search   the optimum without rows, then one violated row after the other             (27)(28), App. C

Symbols: n joints of the tree (0 is the world), nv, d, k as everywhere, P points with 3 forces each, β of length nb, of
which each entry *is* one entry of (q̈, λ) that the elimination left free. V maps β to (q̈, λ), shape (nv + k, nb + 1); its
last column is the point at β = 0. T is the same for τ, shape (d, nb + 1).

A tick answers SOLVED, or says that it is not the one to answer: REFUSED (a value is not finite, a quaternion or rotation is
none), DOUBTFUL (the numbers do not carry to the last digits), INFEASIBLE. Then the readable path decides.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

SOLVED, REFUSED, DOUBTFUL, INFEASIBLE = 0, 1, 2, 3
POINT, FLAT = 0, 1  # kinds of contact
COM, ORIENTATION, FRAME, POSTURE, FORCE, TORQUE = 0, 1, 2, 3, 4, 5  # kinds of task

_DEPENDENT = 2e-2  # a row of which elimination leaves less than this part may nearly depend on the others
_RANK = 1e-10  # as RANK_TOLERANCE of the readable path
_MOTION = 1e-4  # as MOTION_TOLERANCE of the readable path
_NOISE = 100.0  # as MOTION_NOISE of the readable path
_CURVED = 1e-13  # least pivot of the objective's Cholesky factor, squared, relative to its diagonal
_VIOLATED = 1e-9  # as FEASIBILITY_TOLERANCE of the readable path, on rows of unit length
_PARALLEL = 1e-12  # a row's part outside the active rows, squared, below which it depends on them


def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile at the first call; kept on disk where a folder can be written to, and in memory alone elsewhere."""
    options: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "reassoc", "nsz", "arcp"}}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba found no folder for its cache
        return numba.njit(**options)(function)


@_compiled
def _cross(a, b, out):
    """out = a × b, shapes (3,)."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@_compiled
def finite(values):
    """Whether all entries are finite, shape (n,)."""
    for i in range(values.size):
        if not np.isfinite(values[i]):
            return False
    return True


# dynamics ----------------------------------------------------------------------------------------------------------------


@_compiled
def sweep(tree, J, v):
    """Spatial velocities and drifts (q̈ = 0) of all joints about the world's origin, shapes (n, 6): linear, then angular.

    tree: (n, 5) parent, first index in v, length there, first index in q, length there. J: (6, nv) columns in the world.
    A joint's columns turn with it, so the drift is that of the parent + velocity × (J v of the joint).
    """
    n = tree.shape[0]
    velocity, drift = np.zeros((n, 6)), np.zeros((n, 6))
    own, turned = np.empty(6), np.empty(3)
    for i in range(1, n):
        parent, first, count = tree[i, 0], tree[i, 1], tree[i, 2]
        for r in range(6):
            own[r] = 0.0
            for c in range(first, first + count):
                own[r] += J[r, c] * v[c]
            velocity[i, r] = velocity[parent, r] + own[r]
            drift[i, r] = drift[parent, r]
        _cross(velocity[i, 3:], own[:3], turned)
        drift[i, :3] += turned
        _cross(velocity[i, :3], own[3:], turned)
        drift[i, :3] += turned
        _cross(velocity[i, 3:], own[3:], turned)
        drift[i, 3:] += turned
    return velocity, drift


@_compiled
def material(motion, acceleration, at, v_out, a_out):
    """Velocity and J̇ v of the body's point at `at` (3,), world: from its spatial velocity and drift, shapes (6,)."""
    turned = np.empty(3)
    _cross(motion[3:], at, turned)
    for i in range(3):
        v_out[i] = motion[i] + turned[i]
    _cross(motion[3:], v_out, a_out)
    _cross(acceleration[3:], at, turned)
    for i in range(3):
        a_out[i] += acceleration[i] + turned[i]


@_compiled
def place(oMi, joint, frame, R, p):
    """R (3, 3) and p (3,) of a frame in the world; oMi: (n, 12), frame: (12,) pose in its joint, by columns."""
    for i in range(3):
        p[i] = oMi[joint, 9 + i]
        for j in range(3):
            p[i] += oMi[joint, 3 * j + i] * frame[9 + j]
            R[i, j] = 0.0
            for c in range(3):
                R[i, j] += oMi[joint, 3 * c + i] * frame[3 * j + c]


@_compiled
def point_rows(tree, J, joint, at, rows):
    """Jacobian of a body's point at `at` (3,), world, into rows (3, nv), which are zero elsewhere."""
    i = joint
    while i > 0:
        for c in range(tree[i, 1], tree[i, 1] + tree[i, 2]):
            rows[0, c] = J[0, c] + J[4, c] * at[2] - J[5, c] * at[1]
            rows[1, c] = J[1, c] + J[5, c] * at[0] - J[3, c] * at[2]
            rows[2, c] = J[2, c] + J[3, c] * at[1] - J[4, c] * at[0]
        i = tree[i, 0]


@_compiled
def turning_rows(tree, J, joint, rows):
    """Jacobian of a body's angular velocity, world, into rows (3, nv), which are zero elsewhere."""
    i = joint
    while i > 0:
        for c in range(tree[i, 1], tree[i, 1] + tree[i, 2]):
            for r in range(3):
                rows[r, c] = J[3 + r, c]
        i = tree[i, 0]


@_compiled
def contact_rows(tree, oMi, J, velocity, drift, contacts, frames, points):
    """(4)(5) A (m, nv), b (m,), and J of the points (k, nv).

    contacts: (C, 4) joint, kind, first point, number of points. frames: (C, 16) pose in the joint, normal, radius.
    points: (P, 3) ball centres or corners in the frame.
    """
    nv, m = J.shape[1], 0
    for i in range(contacts.shape[0]):
        m += 3 if contacts[i, 1] == POINT else 6
    A, b, Jp = np.zeros((m, nv)), np.empty(m), np.zeros((3 * points.shape[0], nv))
    R, p, at, v_at, a_at, spin, twice = (
        np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3),
    )  # fmt: skip
    row = 0
    for i in range(contacts.shape[0]):
        joint, kind, first, count = contacts[i, 0], contacts[i, 1], contacts[i, 2], contacts[i, 3]
        place(oMi, joint, frames[i], R, p)
        normal, radius = frames[i, 12:15], frames[i, 15]
        for j in range(first, first + count):
            for r in range(3):
                at[r] = p[r] - radius * normal[r]
                for c in range(3):
                    at[r] += R[r, c] * points[j, c]
            point_rows(tree, J, joint, at, Jp[3 * j :])
        if kind == FLAT:
            at[:] = p
        point_rows(tree, J, joint, at, A[row:])
        material(velocity[joint], drift[joint], at, v_at, a_at)
        if kind == POINT:  # the ball rolls: its lowest point moves on it
            _cross(velocity[joint, 3:], normal, spin)
            _cross(velocity[joint, 3:], spin, twice)
            for r in range(3):
                b[row + r] = -a_at[r] - radius * twice[r]
            row += 3
        else:
            turning_rows(tree, J, joint, A[row + 3 :])
            for r in range(3):
                b[row + r] = -a_at[r]
                b[row + 3 + r] = -drift[joint, 3 + r]
            row += 6
    return A, b, Jp


# elimination -------------------------------------------------------------------------------------------------------------


@_compiled
def gauss_jordan(B, first, last, weights, pivots, sizes):
    """Reduce rows first:last of B (m, n + 1) in place, columns chosen by weight (n,) × size, all other rows cleared.

    pivots: (m,) receives the column that each row is solved for. sizes: (m,) largest entry of each row before.
    Returns the least part of a row that was left when its turn came.
    """
    n, least = B.shape[1] - 1, 1.0
    for row in range(first, last):
        best, column = 0.0, -1
        for c in range(n):
            size = weights[c] * abs(B[row, c])
            if size > best:
                best, column = size, c
        if column < 0 or abs(B[row, column]) <= 1e-14 * sizes[row]:
            return 0.0
        least = min(least, abs(B[row, column]) / sizes[row])
        pivots[row] = column
        scale = 1.0 / B[row, column]
        for c in range(n + 1):
            B[row, c] *= scale
        for other in range(B.shape[0]):
            factor = B[other, column]
            if other != row and factor != 0.0:
                for c in range(n + 1):
                    B[other, c] -= factor * B[row, c]
                B[other, column] = 0.0
    return least


@_compiled
def row_sizes(B):
    """Largest entry of each row of B (m, n + 1), the last column left out."""
    sizes = np.zeros(B.shape[0])
    for row in range(B.shape[0]):
        for c in range(B.shape[1] - 1):
            sizes[row] = max(sizes[row], abs(B[row, c]))
    return sizes


@_compiled
def equalities(A, b, M, h, Jp, base):
    """(7) without its joint rows: [A 0 | b] above [M_b -J_bᵀ | -h_b], shape (m + base, nv + k + 1)."""
    m, nv, k = A.shape[0], A.shape[1], Jp.shape[0]
    B = np.zeros((m + base, nv + k + 1))
    for i in range(m):
        for c in range(nv):
            B[i, c] = A[i, c]
        B[i, nv + k] = b[i]
    for i in range(base):
        for c in range(nv):
            B[m + i, c] = M[i, c]
        for c in range(k):
            B[m + i, nv + c] = -Jp[c, i]
        B[m + i, nv + k] = -h[i]
    return B


@_compiled
def contradict(A, v, U, s, b):
    """Whether rows of A q̈ = b contradict each other by more than the contacts' own motion A v explains; U, s: of A's SVD."""
    gap, motion = b.copy(), 0.0
    for i in range(s.size):
        if s[i] > _MOTION * s[0]:
            along = 0.0
            for j in range(b.size):
                along += U[j, i] * b[j]
            for j in range(b.size):
                gap[j] -= along * U[j, i]
    for j in range(b.size):
        moved = 0.0
        for c in range(v.size):
            moved += A[j, c] * v[c]
        motion = max(motion, abs(moved))
    return np.max(np.abs(gap)) > 1e-6 + _NOISE * motion


@_compiled
def independent_rows(A, b, v):
    """(5) Orthonormal rows (r, nv) and right-hand sides (r,) that say what A q̈ = b says along the directions A resolves.

    Along those that it hardly resolves b is measurement noise, and zero stands in its place, as in `build_qp`. The last
    answer is False where it is more than that, v (nv,) being the velocity.
    """
    U, s, Vt = np.linalg.svd(A, False)
    r = 0
    while r < s.size and s[r] > _RANK * s[0]:
        r += 1
    right = np.zeros(r)
    for i in range(r):
        if s[i] > _MOTION * s[0]:
            for j in range(b.size):
                right[i] += U[j, i] * b[j] / s[i]
    return np.ascontiguousarray(Vt[:r]), right, not contradict(A, v, U, s, b)


@_compiled
def motions(A, b, v, M, h, Jp, base):
    """(13)(17) β -> (q̈, λ) as V (nv + k, nb + 1), the free column of each β (nb,), and how well it went.

    Motion rows are solved for joints where that is possible, so that straight knees fall back to the base; the base rows
    for the base, and for λ where contacts already hold it.
    """
    nv, k = A.shape[1], Jp.shape[0]
    n = nv + k
    by_motion, by_base = np.zeros(n), np.empty(n)
    for c in range(n):
        if c < nv:
            by_motion[c] = 0.05 if c < base else 1.0
        by_base[c] = 1.0 if c < base else (0.1 if c < nv else 0.01)
    for attempt in range(2):
        m = A.shape[0]
        B = equalities(A, b, M, h, Jp, base)
        pivots = np.empty(m + base, np.int64)
        sizes = row_sizes(B)
        least = gauss_jordan(B, 0, m, by_motion, pivots, sizes) if m else 1.0
        if least > _DEPENDENT or attempt == 1:
            break
        A, b, agree = independent_rows(A, b, v)
        if not agree:
            return np.zeros((n, 1)), np.zeros(0, np.int64), False
    if least > 1e-11:
        least = min(least, gauss_jordan(B, m, m + base, by_base, pivots, sizes)) if base else least
    if least <= 1e-11:
        return np.zeros((n, 1)), np.zeros(0, np.int64), False
    return parametrised(B, pivots, n)


@_compiled
def parametrised(B, pivots, n):
    """V (n, nb + 1) from reduced rows B (m, n + 1), each solved for its pivot; and the free columns (nb,)."""
    dependent = np.zeros(n, np.bool_)
    for row in range(pivots.size):
        dependent[pivots[row]] = True
    nb = n - pivots.size
    free = np.empty(nb, np.int64)
    V = np.zeros((n, nb + 1))
    j = 0
    for c in range(n):
        if not dependent[c]:
            free[j] = c
            V[c, j] = 1.0
            j += 1
    for row in range(pivots.size):
        for j in range(nb):
            V[pivots[row], j] = -B[row, free[j]]
        V[pivots[row], nb] = B[row, n]
    return V, free, True


@_compiled
def product(left, right, n):
    """left (m, n) times the first n rows of right (·, p), shape (m, p); the left's many zeros are skipped."""
    out = np.zeros((left.shape[0], right.shape[1]))
    for i in range(left.shape[0]):
        for j in range(n):
            factor = left[i, j]
            if factor != 0.0:
                for c in range(right.shape[1]):
                    out[i, c] += factor * right[j, c]
    return out


@_compiled
def torques(V, M, h, Jp, base):
    """(16) β -> τ = M_j q̈ + h_j - J_jᵀ λ as T (d, nb + 1), V as from `motions`."""
    nv, k, width = M.shape[0], Jp.shape[0], V.shape[1]
    T = product(M[base:], V, nv)
    for c in range(k):
        for j in range(nv - base):
            factor = Jp[c, base + j]
            if factor != 0.0:
                for i in range(width):
                    T[j, i] -= factor * V[nv + c, i]
    for j in range(nv - base):
        T[j, width - 1] += h[base + j]
    return T


# tasks -------------------------------------------------------------------------------------------------------------------


@_compiled
def rotation_error(R, wanted, e):
    """e = log(R wantedᵀ) into (3,); False where `wanted` (9,), row by row, is no rotation or the turn is near half a turn."""
    E = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            E[i, j] = 0.0
            gram = 0.0
            for c in range(3):
                E[i, j] += R[i, c] * wanted[3 * j + c]
                gram += wanted[3 * i + c] * wanted[3 * j + c]
            if abs(gram - (1.0 if i == j else 0.0)) > 1e-10:
                return False
    e[0], e[1], e[2] = 0.5 * (E[2, 1] - E[1, 2]), 0.5 * (E[0, 2] - E[2, 0]), 0.5 * (E[1, 0] - E[0, 1])
    sine = np.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    cosine = 0.5 * (E[0, 0] + E[1, 1] + E[2, 2] - 1.0)
    if cosine < -0.9:  # a reflection, or a turn whose axis the sine no longer tells
        return False
    scale = 1.0 + sine * sine / 6.0 if sine < 1e-4 else np.arctan2(sine, cosine) / sine
    for i in range(3):
        e[i] *= scale
    return True


@_compiled
def centre_of_mass(oMi, links, velocity, drift):
    """Position, velocity and J̇ v of the centre of mass, each (3,), world. links: (n, 4) mass and its place in the joint."""
    com, com_v, com_a, mass = np.zeros(3), np.zeros(3), np.zeros(3), 0.0
    at, v_at, a_at = np.empty(3), np.empty(3), np.empty(3)
    for i in range(1, links.shape[0]):
        for r in range(3):
            at[r] = oMi[i, 9 + r]
            for c in range(3):
                at[r] += oMi[i, 3 * c + r] * links[i, 1 + c]
        material(velocity[i], drift[i], at, v_at, a_at)
        mass += links[i, 0]
        for r in range(3):
            com[r] += links[i, 0] * at[r]
            com_v[r] += links[i, 0] * v_at[r]
            com_a[r] += links[i, 0] * a_at[r]
    return com / mass, com_v / mass, com_a / mass, mass


@_compiled
def motion_task(kind, joint, frame, target, tree, oMi, J, Ag, links, velocity, drift, rows, e, e_dot, bias):
    """Rows (3, nv), e, ė and J̇ v - a_ff, each (3,), of a task on the CoM, an orientation or a frame; False if it has none.

    target: position or rotation, velocity, acceleration, one after the other.
    """
    rows[:] = 0.0
    size = 9 if kind == ORIENTATION else 3
    if kind == COM:
        com, com_v, com_a, mass = centre_of_mass(oMi, links, velocity, drift)
        for r in range(3):
            e[r], e_dot[r], bias[r] = com[r] - target[r], com_v[r], com_a[r]
            for c in range(J.shape[1]):
                rows[r, c] = Ag[r, c] / mass
    else:
        R, p = np.empty((3, 3)), np.empty(3)
        place(oMi, joint, frame, R, p)
        if kind == ORIENTATION:
            turning_rows(tree, J, joint, rows)
            for r in range(3):
                e_dot[r], bias[r] = velocity[joint, 3 + r], drift[joint, 3 + r]
            if not rotation_error(R, target, e):
                return False
        else:
            point_rows(tree, J, joint, p, rows)
            material(velocity[joint], drift[joint], p, e_dot, bias)
            for r in range(3):
                e[r] = p[r] - target[r]
    for r in range(3):
        e_dot[r] -= target[size + r]
        bias[r] -= target[size + 3 + r]
    return True


@_compiled
def posture_task(tree, q, v, target, base, e, e_dot):
    """e and ė of the joints, each (d,); joints without limits are (cos, sin) in q. target: (nq,)."""
    for i in range(1, tree.shape[0]):
        row, at = tree[i, 1] - base, tree[i, 3]
        if row < 0:
            continue
        e_dot[row] = v[tree[i, 1]]
        if tree[i, 4] == 1:
            e[row] = q[at] - target[at]
        else:
            sine = q[at + 1] * target[at] - q[at] * target[at + 1]
            e[row] = np.arctan2(sine, q[at] * target[at] + q[at + 1] * target[at + 1])


@_compiled
def objective(q, v, oMi, J, Ag, tree, links, tasks, gains, frames, targets, velocity, drift, V, free, T, base):
    """(18)(26) ½ Σ weight ‖residual‖² in β as R (rows, nb + 1), diagonal (nb,), aim (nb,), and whether all tasks could be read.

    It is ½ ‖R (β, 1)‖² + ½ Σ diagonal β² - aimᵀ β.

    tasks: (N, 3) kind, joint, first target. gains: (N, 3) weight, kp, kd. frames: (N, 12). V, T: β -> (q̈, λ), τ.
    Rows of V that are rows of the unit matrix only touch the diagonal.
    """
    nv, d, nb = J.shape[1], T.shape[0], V.shape[1] - 1
    k = V.shape[0] - nv
    R = np.zeros((3 * tasks.shape[0] + 2 * d + k, nb + 1))
    used, rows = 0, np.empty((3, nv))
    e, e_dot, bias, ej, ej_dot = np.empty(3), np.empty(3), np.empty(3), np.empty(d), np.empty(d)
    weight, wanted = np.zeros(nv + k + d), np.zeros(nv + k + d)  # of the terms w/2 (x_i - wanted_i)² on single entries
    for i in range(tasks.shape[0]):
        kind, at, w, kp, kd = tasks[i, 0], tasks[i, 2], gains[i, 0], gains[i, 1], gains[i, 2]
        if kind <= FRAME:
            if not motion_task(
                kind, tasks[i, 1], frames[i], targets[at:], tree, oMi, J, Ag, links, velocity, drift, rows, e, e_dot, bias
            ):
                return R, weight, wanted, False
            root, part = np.sqrt(w), product(rows, V, nv)
            for r in range(3):
                for c in range(nb + 1):
                    R[used + r, c] = root * part[r, c]
                R[used + r, nb] += root * (bias[r] + kp * e[r] + kd * e_dot[r])
            used += 3
        else:
            first = nv + k if kind == TORQUE else (nv if kind == FORCE else base)
            if kind == POSTURE:
                posture_task(tree, q, v, targets[at:], base, ej, ej_dot)
            for j in range(k if kind == FORCE else d):
                goal = -kp * ej[j] - kd * ej_dot[j] if kind == POSTURE else targets[at + j]
                weight[first + j] += w
                wanted[first + j] += w * goal
    diagonal, aim, used = single_entries(R, used, V, free, T, weight, wanted)
    return R[:used], diagonal, aim, True


@_compiled
def single_entries(R, used, V, free, T, weight, wanted):
    """Add Σ (weight / 2) (x - wanted / weight)² over single entries x of (q̈, λ, τ) to R, or to the diagonal where x is a β.

    Returns the diagonal and the aim, each (nb,), and the number of rows of R in use.
    """
    nb, n = V.shape[1] - 1, V.shape[0]
    diagonal, aim = np.zeros(nb), np.zeros(nb)
    column = 0
    for i in range(n + T.shape[0]):
        if column < nb and free[column] == i:
            diagonal[column], aim[column] = weight[i], wanted[i]
            column += 1
        elif weight[i] > 0.0:
            row = V[i] if i < n else T[i - n]
            root = np.sqrt(weight[i])
            for c in range(nb + 1):
                R[used, c] = root * row[c]
            R[used, nb] -= wanted[i] / root
            used += 1
    return diagonal, aim, used


@_compiled
def normal_equations(R, diagonal, aim):
    """Hessian (nb, nb) and slope (nb,) at β = 0 of an objective as `objective` gives it."""
    nb = diagonal.size
    both = np.dot(R.T, R)
    slope = -aim
    for c in range(nb):
        slope[c] += both[c, nb]
        both[c, c] += diagonal[c]
    return both[:nb, :nb], slope


@_compiled
def gradient(R, diagonal, aim, beta):
    """Slope (nb,) at β, residual by residual, which keeps the digits that the Hessian lost."""
    nb = beta.size
    slope = np.empty(nb)
    for c in range(nb):
        slope[c] = diagonal[c] * beta[c] - aim[c]
    for i in range(R.shape[0]):
        residual = R[i, nb]
        for c in range(nb):
            residual += R[i, c] * beta[c]
        for c in range(nb):
            slope[c] += residual * R[i, c]
    return slope


# rows and optimum --------------------------------------------------------------------------------------------------------


@_compiled
def cholesky(H):
    """L (nb, nb) with L Lᵀ = H, and whether every direction is curved."""
    n = H.shape[0]
    L = np.zeros((n, n))
    for j in range(n):
        for i in range(j, n):
            total = H[i, j]
            for c in range(j):
                total -= L[i, c] * L[j, c]
            if i > j:
                L[i, j] = total / L[j, j]
            elif total <= _CURVED * H[j, j]:
                return L, False
            else:
                L[j, j] = np.sqrt(total)
    return L, True


@_compiled
def minimum(L, slope):
    """β = -(L Lᵀ)⁻¹ slope, shape (nb,)."""
    n = slope.size
    x = np.empty(n)
    for i in range(n):
        total = -slope[i]
        for c in range(i):
            total -= L[i, c] * x[c]
        x[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        x[i] /= L[i, i]
        for c in range(i):
            x[c] -= L[i, c] * x[i]
    return x


@_compiled
def inverse(L):
    """L⁻¹ (nb, nb), lower triangular."""
    n = L.shape[0]
    W = np.zeros((n, n))
    for i in range(n):
        for j in range(i):
            for c in range(j + 1):
                W[i, c] -= L[i, j] * W[j, c]
        W[i, i] = 1.0
        for c in range(i + 1):
            W[i, c] /= L[i, i]
    return W


@_compiled
def image(V, beta, out):
    """out = V (β, 1), for V (n, nb + 1)."""
    nb = beta.size
    for i in range(V.shape[0]):
        total = V[i, nb]
        for c in range(nb):
            total += V[i, c] * beta[c]
        out[i] = total


@_compiled
def worst_facet(cone, f):
    """(28) The facet that a force f (3,) is furthest beyond, or -1 where it is beyond none; cone: (F + 1, 3), last -normal.

    Facets look along evenly turned tangents, the first along t1, so the tangential force itself points at the worst one.
    """
    facets = cone.shape[0] - 1
    nx, ny, nz = -cone[facets, 0], -cone[facets, 1], -cone[facets, 2]
    mu = -(cone[0, 0] * nx + cone[0, 1] * ny + cone[0, 2] * nz)
    x, y, z = cone[0, 0] + mu * nx, cone[0, 1] + mu * ny, cone[0, 2] + mu * nz
    along = x * f[0] + y * f[1] + z * f[2]
    across = (ny * z - nz * y) * f[0] + (nz * x - nx * z) * f[1] + (nx * y - ny * x) * f[2]
    room = mu * (nx * f[0] + ny * f[1] + nz * f[2])
    if room >= 0.0 and along * along + across * across <= room * room:
        return -1
    return int(np.rint(np.arctan2(across, along) * facets / (2.0 * np.pi))) % facets


@_compiled
def most_violated(forces, tau, cones, lengths, least_normal, limits):
    """The row of (27)(28) that is furthest beyond its bound, in unit length; -1 where none is.

    cones: (P, F + 1, 3) rows of G for one point's force, the last -normal. lengths: (P, F + 1) of those rows.
    Rows are counted as P (F + 1) force rows, then d upper and d lower torque limits.
    """
    worst, found = _VIOLATED, -1
    per_point = cones.shape[1]
    for i in range(cones.shape[0]):
        f = forces[3 * i : 3 * i + 3]
        for j in (worst_facet(cones[i], f), per_point - 1):
            if j < 0:
                continue
            excess = cones[i, j, 0] * f[0] + cones[i, j, 1] * f[1] + cones[i, j, 2] * f[2]
            if j == per_point - 1:
                excess += least_normal
            if excess > worst * lengths[i, j]:
                worst, found = excess / lengths[i, j], i * per_point + j
    first = cones.shape[0] * per_point
    for j in range(tau.size):
        if tau[j] - limits[j] > worst:
            worst, found = tau[j] - limits[j], first + j
        if -tau[j] - limits[j] > worst:
            worst, found = -tau[j] - limits[j], first + tau.size + j
    return found


@_compiled
def row_in_beta(row, V, T, cones, least_normal, limits, out):
    """One row of (27)(28) on β: out (nb,) = G_row, and returns its bound h_row, as in G β ≤ h."""
    nb, d, force_rows = V.shape[1] - 1, T.shape[0], cones.shape[0] * cones.shape[1]
    out[:] = 0.0
    if row < force_rows:
        point, facet = row // cones.shape[1], row % cones.shape[1]
        first = V.shape[0] - 3 * cones.shape[0] + 3 * point
        bound = -least_normal if facet == cones.shape[1] - 1 else 0.0
        for r in range(3):
            for c in range(nb):
                out[c] += cones[point, facet, r] * V[first + r, c]
            bound -= cones[point, facet, r] * V[first + r, nb]
        return bound
    joint = (row - force_rows) % d
    sign = 1.0 if row - force_rows < d else -1.0
    for c in range(nb):
        out[c] = sign * T[joint, c]
    return limits[joint] - sign * T[joint, nb]


@_compiled
def add_row(W, U, d, z, q):
    """Goldfarb-Idnani: mirror rows q: of W (nb, nb) so that d (nb,) = W row ends at q, and make d column q of U.

    z: (nb,) = -Σ d_j W_j over those rows.
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


@_compiled
def drop_row(W, U, active, mu, at, q):
    """Goldfarb-Idnani: take row `at` of q active ones out of U (upper triangular), active and mu; W follows."""
    for j in range(at, q - 1):
        active[j], mu[j] = active[j + 1], mu[j + 1]
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


@_compiled
def directions(W, U, row, q, d, z, r):
    """Goldfarb-Idnani: d = W row, the step z in β and r in the q multipliers, as the new row's multiplier grows by 1."""
    n = row.size
    for i in range(n):
        z[i] = 0.0
    for j in range(n):
        total = 0.0
        for i in range(n):
            total += W[j, i] * row[i]
        d[j] = total
        if j >= q:
            for i in range(n):
                z[i] -= total * W[j, i]
    for i in range(q - 1, -1, -1):
        total = d[i]
        for j in range(i + 1, q):
            total -= U[i, j] * r[j]
        r[i] = total / U[i, i]


@_compiled
def enforce(row, bound, beta, W, U, active, mu, q, number):
    """Bring one violated row (nb,) of G β ≤ h to its bound, dropping active rows that pull; returns q and a status."""
    n = beta.size
    d, z, r, push = np.empty(n), np.empty(n), np.empty(n), 0.0
    for _ in range(2 * n + 2):
        directions(W, U, row, q, d, z, r)
        curve, size, over = 0.0, 0.0, -bound
        for j in range(n):
            size += d[j] * d[j]
            if j >= q:
                curve += d[j] * d[j]
            over += row[j] * beta[j]
        longest, drop = np.inf, -1
        for j in range(q):
            if r[j] > 0.0 and mu[j] < longest * r[j]:
                longest, drop = mu[j] / r[j], j
        full = over / curve if q < n and curve > _PARALLEL * size else np.inf
        step = min(longest, full)
        if step == np.inf:
            return q, INFEASIBLE
        for j in range(q):
            mu[j] -= step * r[j]
        push += step
        if full < np.inf:
            for j in range(n):
                beta[j] += step * z[j]
        if full <= longest:
            add_row(W, U, d, z, q)
            active[q], mu[q] = number, push
            return q + 1, SOLVED
        drop_row(W, U, active, mu, drop, q)
        q -= 1
    return q, DOUBTFUL


@_compiled
def polish(beta, mu, active, q, slope, L, W, U, rows, bounds):
    """One step of Newton's method from (β, mu) that are right but for rounding; slope: the gradient there, shape (nb,).

    rows: (q, nb), bounds: (q,) of the active rows. W, U: the factors of Goldfarb and Idnani: rows @ Wᵀ = [Uᵀ 0] and W H Wᵀ = 1.
    """
    nb = beta.size
    if q == 0:
        beta += minimum(L, slope)
        return
    for a in range(q):
        for c in range(nb):
            slope[c] += mu[a] * rows[a, c]
    d, y = np.zeros(nb), np.empty(q)
    for j in range(nb):
        for i in range(nb):
            d[j] -= W[j, i] * slope[i]
    for a in range(q):  # back to the bounds: Uᵀ y = h - G β
        y[a] = bounds[a]
        for c in range(nb):
            y[a] -= rows[a, c] * beta[c]
        for j in range(a):
            y[a] -= U[j, a] * y[j]
        y[a] /= U[a, a]
    for j in range(nb):
        step = y[j] if j < q else d[j]
        for i in range(nb):
            beta[i] += step * W[j, i]
    for a in range(q - 1, -1, -1):
        for j in range(a + 1, q):
            d[a] -= U[a, j] * d[j]
        d[a] /= U[a, a]
        mu[a] += d[a]


@_compiled
def dual_search(R, diagonal, aim, V, T, cones, lengths, least_normal, limits):
    """(27) β (nb,) with the least objective that keeps all rows; the active rows, their multipliers, and a status.

    The dual active-set method of Goldfarb and Idnani (Math. Programming 27, 1983): start at the optimum without rows,
    bring the most violated one to its bound, again and again. Rows that are never violated are only looked at.
    """
    H, slope = normal_equations(R, diagonal, aim)
    nb, k, q = slope.size, 3 * cones.shape[0], 0
    active, mu, bounds, rows = np.empty(nb, np.int64), np.empty(nb), np.empty(nb), np.empty((nb, nb))
    L, curved = cholesky(H)
    if not curved:
        return slope, active[:0], mu[:0], DOUBTFUL
    beta = minimum(L, slope)
    forces, tau = np.empty(k), np.empty(T.shape[0])
    W, U = L, L  # made when the first row is violated
    polish(beta, mu, active, q, gradient(R, diagonal, aim, beta), L, W, U, rows, bounds)
    for count in range(100 + 10 * nb):
        image(V[V.shape[0] - k :], beta, forces)
        image(T, beta, tau)
        number = most_violated(forces, tau, cones, lengths, least_normal, limits)
        if number < 0:
            break
        if count == 0:
            W, U = inverse(L), np.zeros((nb, nb))
        bound = row_in_beta(number, V, T, cones, least_normal, limits, rows[nb - 1])
        q, status = enforce(rows[nb - 1].copy(), bound, beta, W, U, active, mu, q, number)
        if status != SOLVED:
            return beta, active[:0], mu[:0], status
    if number >= 0:
        return beta, active[:0], mu[:0], DOUBTFUL
    if q > 0:
        for a in range(q):
            bounds[a] = row_in_beta(active[a], V, T, cones, least_normal, limits, rows[a])
        polish(beta, mu, active, q, gradient(R, diagonal, aim, beta), L, W, U, rows, bounds)
    return beta, active[:q], mu[:q], SOLVED


@_compiled
def tick(
    q, v, targets, M, h, J, Ag, oMi, tree, links, contacts, contact_frames, points, cones, lengths, tasks, gains, frames,
    limits, least_normal,
):  # fmt: skip
    """(26)(27) x = (q̈, τ, λ) of shape (nv + d + k,), the active rows (a,), their multipliers (a,), and a status.

    q: (nq,). v: (nv,). targets: those of all tasks, one after the other. M, h, J, Ag, oMi: Pinocchio's results for q and v.
    The rest describes robot, contacts and tasks as the functions above take them.
    """
    nv, d, k = v.size, limits.size, 3 * points.shape[0]
    base = nv - d
    x, none = np.empty(nv + d + k), np.zeros(0, np.int64)
    if not (finite(q) and finite(v) and finite(targets)):
        return x, none, x[:0], REFUSED
    if base and abs(np.sqrt(q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6]) - 1.0) > 1e-6:
        return x, none, x[:0], REFUSED
    velocity, drift = sweep(tree, J, v)
    A, b, Jp = contact_rows(tree, oMi, J, velocity, drift, contacts, contact_frames, points)
    Mc = np.ascontiguousarray(M.T)  # symmetric; Pinocchio's is stored by columns
    V, free, regular = motions(A, b, v, Mc, h, Jp, base)
    if not regular:
        return x, none, x[:0], DOUBTFUL
    T = torques(V, Mc, h, Jp, base)
    R, diagonal, aim, readable = objective(
        q, v, oMi, J, Ag, tree, links, tasks, gains, frames, targets, velocity, drift, V, free, T, base
    )
    if not readable:
        return x, none, x[:0], REFUSED
    beta, active, mu, status = dual_search(R, diagonal, aim, V, T, cones, lengths, least_normal, limits)
    if status == SOLVED:
        image(V[:nv], beta, x[:nv])
        image(T, beta, x[nv : nv + d])
        image(V[nv:], beta, x[nv + d :])
        if not finite(x):
            status = DOUBTFUL
    return x, active, mu, status
