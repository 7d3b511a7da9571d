"""The tick, compiled: (26)(27) written out over plain arrays, which `compiled.py` fills, and calls it.

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

A tick that is not the one to answer says why: REFUSED (a value is not finite, a quaternion or rotation is none), DOUBTFUL
(the numbers do not carry to the last digits), INFEASIBLE. Then the readable path decides.

A tick takes its memory from a room that was made once: the arrays a function fills are its last arguments.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numba
import numpy as np

SOLVED, REFUSED, DOUBTFUL, INFEASIBLE, UNFINISHED = 0, -1, -2, -3, -4
PARTS = 4  # of a tick: rows, elimination, objective, optimum
POINT, FLAT = 0, 1  # kinds of contact
COM, ORIENTATION, FRAME, POSTURE, FORCE, TORQUE = 0, 1, 2, 3, 4, 5  # kinds of task

_DEPENDENT = 2e-2  # a row of which elimination leaves less than this part may nearly depend on the others
_MOTION = 1e-4  # as MOTION_TOLERANCE of `floatbase.dynamics`
_NOISE = 100.0  # as MOTION_NOISE there
_CURVED = 1e-13  # least pivot of the objective's Cholesky factor, squared, relative to its diagonal
_VIOLATED = 1e-9  # as FEASIBILITY_TOLERANCE of the readable path, on rows of unit length
_PARALLEL = 1e-12  # a row's part outside the active rows, squared, below which it depends on them
_POLISHED = 3  # steps of Newton's method at most
_SETTLED = 1e-6  # part of β: what is left after a step so small is rounding
_UNSETTLED = 1e-4  # part of β that the last of them may still move
_PULLING = 1e-9  # part of the largest multiplier by which one may be negative
_FAR = 1e8  # m/s², N·m or N, beyond which an entry of the answer has lost its digits: next to nothing chooses it


kept = True  # whether what is compiled is kept for the next process


def _compiled(function: Callable[..., Any], **more: Any) -> Callable[..., Any]:
    """Compile at the first call; kept on disk where a folder can be written to, and in memory alone elsewhere.

    Without numba's run time, which counts the references to every array that is made, cut or handed on: that took a quarter of
    the tick. What is compiled so can neither make an array nor return one.
    """
    options: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "reassoc", "nsz", "arcp"}, "_nrt": False}
    try:
        return numba.njit(cache=True, **options | more)(function)
    except RuntimeError:  # numba found no folder for its cache
        global kept
        kept = False
        return numba.njit(**options | more)(function)


_allocating = partial(_compiled, _nrt=True)
_written_out = partial(_compiled, inline="always")  # put into the caller, so that it may return arrays


def compile_anew() -> None:
    """Forget what was compiled, on disk too, where a power cut may have left half a file; the next tick compiles again."""
    for function in list(globals().values()):
        if isinstance(function, numba.core.dispatcher.Dispatcher):
            function.recompile()


# the room: its first number counts what is in use ------------------------------------------------------------------------


@_written_out
def line(room, n):
    """The next free n numbers of the room, whatever stands there."""
    first = int(room[0])
    last = first + n
    if last > room.size:
        raise MemoryError("the room of the controller's tick is too small")
    room[0] = last
    return room[first:last]


@_written_out
def table(room, rows, columns):
    """The next free piece of the room as an array (rows, columns), whatever stands there."""
    return line(room, rows * columns).reshape(rows, columns)


@_compiled
def clear(array):
    """Set every number of a C-contiguous array to zero."""
    flat = array.reshape(array.size)
    for i in range(flat.size):
        flat[i] = 0.0


@_compiled
def finite(values):
    """Whether all entries are finite, shape (n,)."""
    for i in range(values.size):
        if not np.isfinite(values[i]):
            return False
    return True


# vectors in space, as three numbers: they need no memory -----------------------------------------------------------------


@_compiled
def xyz(array, i, first):
    """Three numbers of row i of an array (n, m), from column `first` on."""
    return array[i, first], array[i, first + 1], array[i, first + 2]


@_compiled
def column(array, first, c):
    """Three numbers of column c of an array (n, m), from row `first` on."""
    return array[first, c], array[first + 1, c], array[first + 2, c]


@_compiled
def plus(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@_compiled
def minus(a, b):
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@_compiled
def times(s, a):
    """s a."""
    return s * a[0], s * a[1], s * a[2]


@_compiled
def dot(a, b):
    """aᵀ b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_compiled
def cross(a, b):
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@_compiled
def turned(R, a):
    """R a, for the three columns of R."""
    return plus(plus(times(a[0], R[0]), times(a[1], R[1])), times(a[2], R[2]))


# dynamics ----------------------------------------------------------------------------------------------------------------


@_compiled
def sweep(tree, J, v, velocity, drift):
    """Spatial velocities and drifts (q̈ = 0) of all joints about the world's origin, (n, 6): linear, then angular.

    tree: (n, 5) parent, first index in v, length there, first index in q, length there. J: (6, nv) columns in the world.
    A joint's columns turn with it, so the drift is that of the parent + velocity × (J v of the joint).
    """
    for r in range(6):
        velocity[0, r], drift[0, r] = 0.0, 0.0
    for i in range(1, tree.shape[0]):
        parent, first, count = tree[i, 0], tree[i, 1], tree[i, 2]
        linear, angular = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for c in range(first, first + count):
            linear = plus(linear, times(v[c], column(J, 0, c)))
            angular = plus(angular, times(v[c], column(J, 3, c)))
        moving, turning = plus(xyz(velocity, parent, 0), linear), plus(xyz(velocity, parent, 3), angular)
        lift = plus(xyz(drift, parent, 0), plus(cross(turning, linear), cross(moving, angular)))
        twist = plus(xyz(drift, parent, 3), cross(turning, angular))
        for r in range(3):
            velocity[i, r], velocity[i, 3 + r], drift[i, r], drift[i, 3 + r] = moving[r], turning[r], lift[r], twist[r]
    return velocity, drift


@_compiled
def material(velocity, drift, joint, at):
    """Velocity and J̇ v of the point at `at`, world, of a joint's body; velocity, drift: (n, 6) as from `sweep`."""
    turning = xyz(velocity, joint, 3)
    moving = plus(xyz(velocity, joint, 0), cross(turning, at))
    own = plus(xyz(drift, joint, 0), cross(xyz(drift, joint, 3), at))
    return moving, plus(own, cross(turning, moving))


@_compiled
def rotation_of(oMi, joint):
    """The three columns of a joint's rotation; oMi: (n, 12), by columns, then the place."""
    return xyz(oMi, joint, 0), xyz(oMi, joint, 3), xyz(oMi, joint, 6)


@_compiled
def place(oMi, joint, frames, i):
    """The columns of the rotation and the place, world, of frame i: (·, 12 or more), its pose in the joint as in oMi."""
    R = rotation_of(oMi, joint)
    columns = turned(R, xyz(frames, i, 0)), turned(R, xyz(frames, i, 3)), turned(R, xyz(frames, i, 6))
    return columns, plus(xyz(oMi, joint, 9), turned(R, xyz(frames, i, 9)))


@_compiled
def point_rows(tree, J, joint, at, out, row):
    """Jacobian of a body's point at `at`, world, into rows row:row + 3 of out (·, nv), which are zero elsewhere."""
    i = joint
    while i > 0:
        for c in range(tree[i, 1], tree[i, 1] + tree[i, 2]):
            moved = plus(column(J, 0, c), cross(column(J, 3, c), at))
            out[row, c], out[row + 1, c], out[row + 2, c] = moved
        i = tree[i, 0]


@_compiled
def turning_rows(tree, J, joint, out, row):
    """Jacobian of a body's angular velocity, world, into rows row:row + 3 of out (·, nv), which are zero elsewhere."""
    i = joint
    while i > 0:
        for c in range(tree[i, 1], tree[i, 1] + tree[i, 2]):
            out[row, c], out[row + 1, c], out[row + 2, c] = column(J, 3, c)
        i = tree[i, 0]


@_compiled
def motion_rows(contacts):
    """The number of motion rows of all contacts; contacts: (C, 4) joint, kind, ..."""
    m = 0
    for i in range(contacts.shape[0]):
        m += 3 if contacts[i, 1] == POINT else 6
    return m


@_compiled
def contact_rows(tree, oMi, J, velocity, drift, contacts, frames, points, A, b, Jp):
    """(4)(5) A (m, nv), b (m,), and J of the points Jp (k, nv), which is the same array as A where all contacts are points.

    contacts: (C, 4) joint, kind, first point, number of points. frames: (C, 16) pose in the joint, normal, radius.
    points: (P, 3) ball centres or corners in the frame.
    """
    all_points, row = contacts.shape[0] == points.shape[0] and b.size == Jp.shape[0], 0
    clear(A)
    clear(Jp)
    for i in range(contacts.shape[0]):
        joint, kind, first, count = contacts[i, 0], contacts[i, 1], contacts[i, 2], contacts[i, 3]
        R, at = place(oMi, joint, frames, i)
        normal, radius = xyz(frames, i, 12), frames[i, 15]
        for j in range(first, first + count):
            point = minus(plus(at, turned(R, xyz(points, j, 0))), times(radius, normal))
            point_rows(tree, J, joint, point, Jp, 3 * j)
            if kind == POINT:
                at = point
        if not all_points:
            point_rows(tree, J, joint, at, A, row)
        _, along = material(velocity, drift, joint, at)
        if kind == POINT:  # the ball rolls: its lowest point moves on it
            turning = xyz(velocity, joint, 3)
            along = plus(along, times(radius, cross(turning, cross(turning, normal))))
        else:
            turning_rows(tree, J, joint, A, row + 3)
            b[row + 3], b[row + 4], b[row + 5] = times(-1.0, xyz(drift, joint, 3))
        b[row], b[row + 1], b[row + 2] = times(-1.0, along)
        row += 3 if kind == POINT else 6


# elimination -------------------------------------------------------------------------------------------------------------


@_compiled
def gauss_jordan(B, first, last, top, n, weights, pivots, sizes):
    """Reduce rows first:last of B (m, N + 1) in place, columns chosen among the first n by weight (n,) × size, and clear them
    in all other rows from `top` on. Rows first:last hold nothing beyond column n but the last one, the right-hand side.

    pivots: (m,) receives the column that each row is solved for. sizes: (m,) length of each row before.
    Returns the least part of a row that was left when its turn came.
    """
    right, least = B.shape[1] - 1, 1.0
    for row in range(first, last):
        best, pivot = 0.0, -1
        for c in range(n):
            size = weights[c] * abs(B[row, c])
            if size > best:
                best, pivot = size, c
        if pivot < 0 or abs(B[row, pivot]) <= 1e-14 * sizes[row]:
            return 0.0
        least = min(least, abs(B[row, pivot]) / sizes[row])
        pivots[row] = pivot
        scale = 1.0 / B[row, pivot]
        for c in range(n):
            B[row, c] *= scale
        B[row, right] *= scale
        for other in range(top, B.shape[0]):
            factor = B[other, pivot]
            if other != row and factor != 0.0:
                for c in range(n):
                    B[other, c] -= factor * B[row, c]
                B[other, right] -= factor * B[row, right]
                B[other, pivot] = 0.0
    return least


@_compiled
def row_sizes(B, sizes):
    """sizes (m,) = Euclidean length of each row of B (m, n + 1), the last column left out."""
    for row in range(B.shape[0]):
        square = 0.0
        for c in range(B.shape[1] - 1):
            square += B[row, c] * B[row, c]
        sizes[row] = np.sqrt(square)


@_compiled
def equalities(A, b, M, h, Jp, base, B):
    """(7) without its joint rows: B (m + base, nv + k + 1) = [A 0 | b] above [M_b -J_bᵀ | -h_b]."""
    m, nv, k = A.shape[0], A.shape[1], Jp.shape[0]
    for i in range(m):
        for c in range(nv):
            B[i, c] = A[i, c]
        for c in range(nv, nv + k):
            B[i, c] = 0.0
        B[i, nv + k] = b[i]
    for i in range(base):
        for c in range(nv):
            B[m + i, c] = M[i, c]
        for c in range(k):
            B[m + i, nv + c] = -Jp[c, i]
        B[m + i, nv + k] = -h[i]


@_allocating
def contradict(A, v, U, b):
    """Whether rows of A q̈ = b contradict each other by more than the contacts' motion A v explains; U (m, r): of A's SVD."""
    gap, motion = b - np.dot(U, np.dot(U.T, b)), np.dot(A, v)
    return np.max(np.abs(gap)) > 1e-6 + _NOISE * np.max(np.abs(motion))


@_allocating
def independent_rows(A, b, v, resolved, right):
    """(5) Orthonormal rows (r, nv) and right-hand sides (r,) that say what A q̈ = b says along the directions A resolves.

    They are put into the first ones of resolved (m, nv) and right (m,); returns r. The other directions are left out, as in
    `build_qp`. r is -1 where b contradicts itself, v (nv,) being the velocity.
    """
    U, s, Vt = np.linalg.svd(A, False)
    r = 0
    while r < s.size and s[r] > _MOTION * s[0]:
        r += 1
    U = np.ascontiguousarray(U[:, :r])
    resolved[:r], right[:r] = Vt[:r], np.dot(U.T, b) / s[:r]
    return -1 if contradict(A, v, U, b) else r


@_compiled
def motions(A, b, M, h, Jp, base, B, pivots, room):
    """(13)(17) Solve the equalities for as many entries of (q̈, λ): B (m + base, nv + k + 1) ends reduced, pivots (m + base,)
    holds the entry that each row is solved for. Returns the least part of a motion row and of any row that was left.

    Motion rows are solved for joints where that is possible, so that straight knees fall back to the base; the base rows
    for the base, and for λ where contacts already hold it.
    """
    m, nv, n = A.shape[0], A.shape[1], B.shape[1] - 1
    by_motion, by_base, sizes = line(room, nv), line(room, n), line(room, m + base)
    for c in range(n):
        by_base[c] = 1.0 if c < base else (0.1 if c < nv else 0.01)
    for c in range(nv):
        by_motion[c] = 0.05 if c < base else 1.0
    equalities(A, b, M, h, Jp, base, B)
    row_sizes(B, sizes)
    least = gauss_jordan(B, 0, m, 0, nv, by_motion, pivots, sizes)
    if least <= 1e-11:
        return least, least
    return least, min(least, gauss_jordan(B, m, m + base, m, n, by_base, pivots, sizes))


@_compiled
def parametrised(B, pivots, m, V, beta_of, free):
    """V (n, nb + 1) from reduced rows B (·, n + 1), each solved for its pivot; and which β each entry is, beta_of (n,), -1 for
    none. free: (nb,), room.

    The pivots of rows from m on still stand in the rows before, and are put in here.
    """
    n, nb = V.shape[0], V.shape[1] - 1
    for c in range(n):
        beta_of[c] = 0
    for row in range(pivots.size):
        beta_of[pivots[row]] = -1
    clear(V)
    j = 0
    for c in range(n):
        if beta_of[c] == 0:
            beta_of[c], free[j], V[c, j] = j, c, 1.0
            j += 1
    for row in range(pivots.size):
        at = pivots[row]
        for j in range(nb):
            V[at, j] = -B[row, free[j]]
        V[at, nb] = B[row, n]
    for row in range(m):
        at = pivots[row]
        for late in range(m, pivots.size):
            source = pivots[late]
            factor = B[row, source]
            if factor != 0.0:
                for j in range(nb + 1):
                    V[at, j] -= factor * V[source, j]


@_compiled
def add_product(left, V, beta_of, first, out, row):
    """Add left (m, n) times rows first:first + n of V to rows row:row + m of out (·, nb + 1); rows of V that are a β only
    touch one column, and the left's many zeros are skipped."""
    for i in range(left.shape[0]):
        for j in range(left.shape[1]):
            factor = left[i, j]
            if factor == 0.0:
                continue
            if beta_of[first + j] >= 0:
                out[row + i, beta_of[first + j]] += factor
            else:
                for c in range(V.shape[1]):
                    out[row + i, c] += factor * V[first + j, c]


@_compiled
def torques(V, beta_of, M, h, Jp, base, T):
    """(16) β -> τ = M_j q̈ + h_j - J_jᵀ λ as T (d, nb + 1), V as from `parametrised`."""
    nv, k, nb = M.shape[0], Jp.shape[0], V.shape[1] - 1
    clear(T)
    add_product(M[base:], V, beta_of, 0, T, 0)
    for c in range(k):
        for j in range(nv - base):
            factor = Jp[c, base + j]
            if factor == 0.0:
                continue
            if beta_of[nv + c] >= 0:
                T[j, beta_of[nv + c]] -= factor
            else:
                for i in range(nb + 1):
                    T[j, i] -= factor * V[nv + c, i]
    for j in range(nv - base):
        T[j, nb] += h[base + j]


# tasks -------------------------------------------------------------------------------------------------------------------


@_compiled
def rotation_error(R, wanted):
    """e = log(R wantedᵀ), for the three columns of each; and False where `wanted` is no rotation or the turn too far."""
    upright = dot(cross(wanted[0], wanted[1]), wanted[2]) > 0.0
    for a, b in ((0, 1), (1, 2), (2, 0)):
        upright &= abs(dot(wanted[a], wanted[a]) - 1.0) <= 1e-10 and abs(dot(wanted[a], wanted[b])) <= 1e-10
    twice = plus(plus(cross(wanted[0], R[0]), cross(wanted[1], R[1])), cross(wanted[2], R[2]))
    e = times(0.5, twice)
    sine = np.sqrt(dot(e, e))
    cosine = 0.5 * (dot(wanted[0], R[0]) + dot(wanted[1], R[1]) + dot(wanted[2], R[2]) - 1.0)
    scale = 1.0 + sine * sine / 6.0 if sine < 1e-4 else np.arctan2(sine, cosine) / sine
    return times(scale, e), upright and cosine > -0.9  # beyond that the sine no longer tells the axis


@_compiled
def centre_of_mass(oMi, links, velocity, drift):
    """Position, velocity and J̇ v of the centre of mass, world, and the mass. links: (n, 4) mass and its place in the joint."""
    com, moving, along, mass = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    for i in range(1, links.shape[0]):
        at = plus(xyz(oMi, i, 9), turned(rotation_of(oMi, i), xyz(links, i, 1)))
        v_at, a_at = material(velocity, drift, i, at)
        com = plus(com, times(links[i, 0], at))
        moving, along = plus(moving, times(links[i, 0], v_at)), plus(along, times(links[i, 0], a_at))
        mass += links[i, 0]
    return times(1.0 / mass, com), times(1.0 / mass, moving), times(1.0 / mass, along), mass


@_compiled
def motion_task(kind, joint, frames, i, targets, first, tree, oMi, J, Ag, links, velocity, drift, rows):
    """Rows (3, nv), e, ė, J̇ v - a_ff of task i on the CoM, an orientation or a frame; False if its target is no rotation.

    targets: from `first` on the position (3) or the rotation (9), row by row, the velocity (3) and the acceleration (3).
    """
    clear(rows)
    wanted = targets.reshape(1, targets.size)
    after, valid = first + (9 if kind == ORIENTATION else 3), True
    if kind == COM:
        at, e_dot, bias, mass = centre_of_mass(oMi, links, velocity, drift)
        e = minus(at, xyz(wanted, 0, first))
        for r in range(3):
            for c in range(J.shape[1]):
                rows[r, c] = Ag[r, c] / mass
    else:
        R, at = place(oMi, joint, frames, i)
        if kind == ORIENTATION:
            turning_rows(tree, J, joint, rows, 0)
            e_dot, bias = xyz(velocity, joint, 3), xyz(drift, joint, 3)
            by_rows = targets[first:after].reshape(3, 3)
            e, valid = rotation_error(R, (column(by_rows, 0, 0), column(by_rows, 0, 1), column(by_rows, 0, 2)))
        else:
            point_rows(tree, J, joint, at, rows, 0)
            e_dot, bias = material(velocity, drift, joint, at)
            e = minus(at, xyz(wanted, 0, first))
    return e, minus(e_dot, xyz(wanted, 0, after)), minus(bias, xyz(wanted, 0, after + 3)), valid


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
def objective(
    q, v, oMi, J, Ag, tree, links, tasks, gains, frames, targets, velocity, drift, V, beta_of, T, base, room, R, diagonal, aim
):
    """(18)(26) ½ Σ weight ‖residual‖² in β: R (·, nb + 1), diagonal (nb,), aim (nb,). Returns how many rows of R are in use,
    which is a multiple of four, the last of them zero; or -1 where a task cannot be read.

    It is ½ ‖R (β, 1)‖² + ½ Σ diagonal β² - aimᵀ β.

    tasks: (N, 3) kind, joint, first target. gains: (N, 3) weight, kp, kd. frames: (N, 12). V, T: β -> (q̈, λ), τ.
    Entries of (q̈, λ) that are a β only touch the diagonal.
    """
    nv, d, nb = J.shape[1], T.shape[0], V.shape[1] - 1
    k = V.shape[0] - nv
    clear(R)
    used, rows, ej, ej_dot = 0, table(room, 3, nv), line(room, d), line(room, d)
    weight, wanted = line(room, nv + k + d), line(room, nv + k + d)  # of the terms w/2 (x_i - wanted_i)² on single entries
    clear(weight)
    clear(wanted)
    for i in range(tasks.shape[0]):
        kind, at, w, kp, kd = tasks[i, 0], tasks[i, 2], gains[i, 0], gains[i, 1], gains[i, 2]
        if kind <= FRAME:
            e, e_dot, bias, valid = motion_task(
                kind, tasks[i, 1], frames, i, targets, at, tree, oMi, J, Ag, links, velocity, drift, rows
            )
            if not valid:
                return -1
            root = np.sqrt(w)
            for r in range(3):
                for c in range(nv):
                    rows[r, c] *= root
            add_product(rows, V, beta_of, 0, R, used)
            pull = times(root, plus(bias, plus(times(kp, e), times(kd, e_dot))))
            R[used, nb], R[used + 1, nb], R[used + 2, nb] = plus(column(R, used, nb), pull)
            used += 3
        else:
            first = nv + k if kind == TORQUE else (nv if kind == FORCE else base)
            if kind == POSTURE:
                posture_task(tree, q, v, targets[at:], base, ej, ej_dot)
            for j in range(k if kind == FORCE else d):
                goal = -kp * ej[j] - kd * ej_dot[j] if kind == POSTURE else targets[at + j]
                weight[first + j] += w
                wanted[first + j] += w * goal
    used = single_entries(R, used, V, beta_of, T, weight, wanted, diagonal, aim)
    return 4 * ((used + 3) // 4)


@_compiled
def single_entries(R, used, V, beta_of, T, weight, wanted, diagonal, aim):
    """Add Σ (weight / 2) (x - wanted / weight)² over single entries x of (q̈, λ, τ) to R, or to the diagonal where x is a β.

    Returns the number of rows of R in use. diagonal, aim: (nb,), as for `objective`.
    """
    nb, n = V.shape[1] - 1, V.shape[0]
    clear(diagonal)
    clear(aim)
    for i in range(n + T.shape[0]):
        if i < n and beta_of[i] >= 0:
            diagonal[beta_of[i]], aim[beta_of[i]] = weight[i], wanted[i]
        elif weight[i] > 0.0:
            row = V[i] if i < n else T[i - n]
            root = np.sqrt(weight[i])
            for c in range(nb + 1):
                R[used, c] = root * row[c]
            R[used, nb] -= wanted[i] / root
            used += 1
    return used


@_compiled
def normal_equations(R, diagonal, aim, both, slope):
    """Hessian, the lower triangle of the first nb rows of both (nb + 1, nb + 1), and slope (nb,) at β = 0, of what `objective`
    gives."""
    nb = diagonal.size
    clear(both)
    for i in range(0, R.shape[0], 4):  # four rows at a time: each sum is fetched and stored once for all of them
        for r in range(nb + 1):
            a, b, c, d = R[i, r], R[i + 1, r], R[i + 2, r], R[i + 3, r]
            for s in range(r + 1):
                both[r, s] += a * R[i, s] + b * R[i + 1, s] + c * R[i + 2, s] + d * R[i + 3, s]
    for r in range(nb):
        both[r, r] += diagonal[r]
        slope[r] = both[nb, r] - aim[r]


@_compiled
def gradient(R, diagonal, aim, beta, slope):
    """Slope (nb,) at β, residual by residual, which keeps the digits that the Hessian lost."""
    nb = beta.size
    for c in range(nb):
        slope[c] = diagonal[c] * beta[c] - aim[c]
    for i in range(R.shape[0]):
        residual = R[i, nb]
        for c in range(nb):
            residual += R[i, c] * beta[c]
        for c in range(nb):
            slope[c] += residual * R[i, c]


# rows and optimum --------------------------------------------------------------------------------------------------------


@_compiled
def cholesky(H, L):
    """L (nb, nb) with L Lᵀ = H, of whose first nb rows the lower triangle is read; False where a direction is not curved."""
    n = L.shape[0]
    clear(L)
    for j in range(n):
        for i in range(j, n):
            total = H[i, j]
            for c in range(j):
                total -= L[i, c] * L[j, c]
            if i > j:
                L[i, j] = total / L[j, j]
            elif total <= _CURVED * H[j, j]:
                return False
            else:
                L[j, j] = np.sqrt(total)
    return True


@_compiled
def minimum(L, slope, x):
    """x (nb,) = -(L Lᵀ)⁻¹ slope."""
    n = slope.size
    for i in range(n):
        total = -slope[i]
        for c in range(i):
            total -= L[i, c] * x[c]
        x[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        x[i] /= L[i, i]
        for c in range(i):
            x[c] -= L[i, c] * x[i]


@_compiled
def inverse(L, W):
    """W (nb, nb) = L⁻¹, lower triangular."""
    n = L.shape[0]
    clear(W)
    for i in range(n):
        for j in range(i):
            for c in range(j + 1):
                W[i, c] -= L[i, j] * W[j, c]
        W[i, i] = 1.0
        for c in range(i + 1):
            W[i, c] /= L[i, i]


@_compiled
def image(V, beta, first, last, out):
    """out (last - first,) = rows first:last of V (·, nb + 1) times (β, 1)."""
    nb = beta.size
    for i in range(first, last):
        total = V[i, nb]
        for c in range(nb):
            total += V[i, c] * beta[c]
        out[i - first] = total


@_compiled
def forces_of(V, beta_of, beta, forces):
    """forces (k,) = the last k rows of V times (β, 1); most of them are a β."""
    first = V.shape[0] - forces.size
    for i in range(forces.size):
        if beta_of[first + i] >= 0:
            forces[i] = beta[beta_of[first + i]]
        else:
            image(V, beta, first + i, first + i + 1, forces[i:])


@_compiled
def row_of(cones, i, j):
    """Three numbers of row j of point i of cones (P, F + 1, 3)."""
    return cones[i, j, 0], cones[i, j, 1], cones[i, j, 2]


@_compiled
def worst_facet(cones, i, f):
    """(28) The facet that the force f of point i is furthest beyond, and by how much; -1 where it is beyond none.

    cones: (P, F + 1, 3) rows, the last -normal. Forces in the circle that the facets touch are beyond none.
    """
    facets = cones.shape[1] - 1
    first, normal = row_of(cones, i, 0), times(-1.0, row_of(cones, i, facets))
    mu, along = -dot(first, normal), dot(normal, f)
    across = minus(f, times(along, normal))
    if along >= 0.0 and dot(across, across) <= mu * mu * along * along:
        return -1, 0.0
    worst, found = 0.0, -1
    for j in range(facets):
        excess = dot(row_of(cones, i, j), f)
        if excess > worst:
            worst, found = excess, j
    return found, worst


@_compiled
def violated_force_row(forces, cones, lengths, least_normal):
    """The row of (28) or of least normal force that is furthest beyond its bound, in unit length; -1 where none is.

    cones: (P, F + 1, 3) rows of G for one point's force, the last -normal. lengths: (P, F + 1) of those rows.
    """
    worst, found = _VIOLATED, -1
    facets = cones.shape[1] - 1
    for i in range(cones.shape[0]):
        f = forces[3 * i], forces[3 * i + 1], forces[3 * i + 2]
        facet, excess = worst_facet(cones, i, f)
        if facet >= 0 and excess > worst * lengths[i, facet]:
            worst, found = excess / lengths[i, facet], i * (facets + 1) + facet
        excess = dot(row_of(cones, i, facets), f) + least_normal
        if excess > worst * lengths[i, facets]:
            worst, found = excess / lengths[i, facets], i * (facets + 1) + facets
    return found


@_compiled
def violated_torque_row(tau, limits):
    """The torque limit that is furthest exceeded, counted as d upper ones, then d lower ones; -1 where none is."""
    worst, found = _VIOLATED, -1
    for j in range(tau.size):
        if tau[j] - limits[j] > worst:
            worst, found = tau[j] - limits[j], j
        if -tau[j] - limits[j] > worst:
            worst, found = -tau[j] - limits[j], tau.size + j
    return found


@_compiled
def violated_row(V, beta_of, T, beta, cones, lengths, least_normal, limits, forces, tau):
    """A row of (27)(28) that β violates, -1 for none: P (F + 1) force rows, then d upper and d lower torque limits.

    Torques are looked at when all forces are where they should be: they cost more to compute. forces (k,), tau (d,): room.
    """
    forces_of(V, beta_of, beta, forces)
    found = violated_force_row(forces, cones, lengths, least_normal)
    if found >= 0:
        return found
    image(T, beta, 0, tau.size, tau)
    found = violated_torque_row(tau, limits)
    return found if found < 0 else cones.shape[0] * cones.shape[1] + found


@_compiled
def row_in_beta(row, V, T, cones, least_normal, limits, out):
    """One row of (27)(28) on β: out (nb,) = G_row, and returns its bound h_row, as in G β ≤ h."""
    nb, d, force_rows = V.shape[1] - 1, T.shape[0], cones.shape[0] * cones.shape[1]
    clear(out)
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
def drop_row(W, U, active, mu, rows, bounds, at, q):
    """Goldfarb-Idnani: take row `at` of q active ones out of U (upper triangular) and the lists of them; W follows."""
    for j in range(at, q - 1):
        active[j], mu[j], bounds[j] = active[j + 1], mu[j + 1], bounds[j + 1]
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


@_compiled
def in_factor(W, row, d):
    """d (nb,) = W row; most rows are of one force whose entries are three of the β, and have no other entries."""
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


@_compiled
def directions(W, U, d, q, z, r):
    """Goldfarb-Idnani: the step z in β and r in the q multipliers as the new row's multiplier grows by 1; d (nb,) = W row."""
    n, j = d.size, q
    for i in range(n):
        z[i] = 0.0
    while j + 4 <= n:  # four rows at a time, as in `normal_equations`
        a, b, c, e = d[j], d[j + 1], d[j + 2], d[j + 3]
        for i in range(n):
            z[i] -= a * W[j, i] + b * W[j + 1, i] + c * W[j + 2, i] + e * W[j + 3, i]
        j += 4
    for late in range(j, n):
        for i in range(n):
            z[i] -= d[late] * W[late, i]
    for i in range(q - 1, -1, -1):
        total = d[i]
        for j in range(i + 1, q):
            total -= U[i, j] * r[j]
        r[i] = total / U[i, i]


@_compiled
def enforce(number, row, bound, beta, W, U, active, mu, rows, bounds, q, d, z, r):
    """Bring one violated row (nb,) of G β ≤ h to its bound, dropping active rows that pull; returns q and a status.

    active, mu, rows, bounds: numbers, multipliers, rows and bounds of the q active ones. d, z, r: (nb,), room for `directions`.
    """
    n, push = beta.size, 0.0
    for _ in range(2 * n + 2):
        in_factor(W, row, d)
        directions(W, U, d, q, z, r)
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
            active[q], mu[q], bounds[q] = number, push, bound
            for j in range(n):
                rows[q, j] = row[j]
            return q + 1, SOLVED
        drop_row(W, U, active, mu, rows, bounds, drop, q)
        q -= 1
    return q, DOUBTFUL


@_compiled
def largest(vector):
    """The largest size of an entry of a vector (n,)."""
    size = 0.0
    for i in range(vector.size):
        size = max(size, abs(vector[i]))
    return size


@_compiled
def polish(beta, mu, q, slope, L, W, U, rows, bounds, d, move, y):
    """One step of Newton's method from (β, mu) that are right but for rounding; slope: the gradient there, shape (nb,).

    Returns the largest change of an entry of β.
    rows: (q, nb), bounds: (q,) of the active rows. W, U: the factors of Goldfarb and Idnani: rows @ Wᵀ = [Uᵀ 0] and W H Wᵀ = 1.
    d, move, y: (nb,), room.
    """
    nb = beta.size
    if q == 0:
        minimum(L, slope, move)
        for i in range(nb):
            beta[i] += move[i]
        return largest(move)
    for a in range(q):
        for c in range(nb):
            slope[c] += mu[a] * rows[a, c]
    for j in range(nb):
        d[j], move[j] = 0.0, 0.0
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
            move[i] += step * W[j, i]
    for i in range(nb):
        beta[i] += move[i]
    for a in range(q - 1, -1, -1):  # the slope that the way to the bounds leaves is held by the multipliers
        d[a] -= y[a]
        for j in range(a + 1, q):
            d[a] -= U[a, j] * d[j]
        d[a] /= U[a, a]
        mu[a] += d[a]
    return largest(move)


@_compiled
def pulling_row(mu, q):
    """The active row whose multiplier, of q ones, is the most negative, so that it should not be active; -1 for none."""
    least, largest, found = 0.0, 0.0, -1
    for a in range(q):
        largest = max(largest, abs(mu[a]))
        if mu[a] < least:
            least, found = mu[a], a
    return found if least < -_PULLING * largest - 1e-13 else -1


@_compiled
def dual_search(R, diagonal, aim, V, beta_of, T, cones, lengths, least_normal, limits, room, beta, active, mu):
    """(27) β (nb,) with the least objective that keeps all rows; returns how many rows hold it, or what kept it from one.

    active, mu: (nb,) receive their numbers and multipliers.

    The dual active-set method of Goldfarb and Idnani (Math. Programming 27, 1983): start at the optimum without rows,
    bring a violated one to its bound, again and again. Rows that are never violated are only looked at. The end is
    polished; where that shows it to be none, since a row pulls or is violated, the search goes on.
    """
    nb, d = beta.size, T.shape[0]
    H, slope, L = table(room, nb + 1, nb + 1), line(room, nb), table(room, nb, nb)
    W, U, rows, bounds = table(room, nb, nb), table(room, nb, nb), table(room, nb, nb), line(room, nb)
    row, step, z, r = line(room, nb), line(room, nb), line(room, nb), line(room, nb)
    forces, tau = line(room, 3 * cones.shape[0]), line(room, d)
    normal_equations(R, diagonal, aim, H, slope)
    if not cholesky(H, L):
        return DOUBTFUL
    minimum(L, slope, beta)
    q, polished, moved, number, made = 0, 0, 0.0, 0, False
    for _ in range(100 + 10 * nb):
        number = violated_row(V, beta_of, T, beta, cones, lengths, least_normal, limits, forces, tau)
        if number < 0:
            if polished == _POLISHED:
                break
            gradient(R, diagonal, aim, beta, slope)
            moved = polish(beta, mu, q, slope, L, W, U, rows, bounds, step, z, r)
            polished = polished + 1 if moved > _SETTLED * (1.0 + largest(beta)) else _POLISHED
            pulling = pulling_row(mu, q)
            if pulling >= 0:
                drop_row(W, U, active, mu, rows, bounds, pulling, q)
                q, polished = q - 1, 0
            elif moved <= _VIOLATED:
                break
            continue
        polished = 0
        if not made:
            inverse(L, W)
            clear(U)
            made = True
        bound = row_in_beta(number, V, T, cones, least_normal, limits, row)
        q, status = enforce(number, row, bound, beta, W, U, active, mu, rows, bounds, q, step, z, r)
        if status != SOLVED:
            return status
    if number >= 0 or polished == 0 or not moved <= _UNSETTLED * (1.0 + largest(beta)):
        return DOUBTFUL
    return q


@_written_out
def unpacked(sizes, indices, numbers):
    """The tables of robot, contacts and tasks as `packed` laid them out, in the order in which `tick` takes them.

    sizes: joints, contacts, points, facets + 1, tasks, driven joints. indices, numbers: whole and real numbers, row by row.
    """
    n, n_contacts, n_points, n_rows, n_tasks, d = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4], sizes[5]
    i, j = 5 * n, 5 * n + 4 * n_contacts
    tree, contacts = indices[:i].reshape(n, 5), indices[i:j].reshape(n_contacts, 4)
    tasks = indices[j:].reshape(n_tasks, 3)
    a = 4 * n
    b = a + 16 * n_contacts
    c = b + 3 * n_points
    e = c + 3 * n_points * n_rows
    f = e + n_points * n_rows
    g = f + 3 * n_tasks
    o = g + 12 * n_tasks
    links, contact_frames = numbers[:a].reshape(n, 4), numbers[a:b].reshape(n_contacts, 16)
    points, cones = numbers[b:c].reshape(n_points, 3), numbers[c:e].reshape(n_points, n_rows, 3)
    lengths, gains, frames = (
        numbers[e:f].reshape(n_points, n_rows), numbers[f:g].reshape(n_tasks, 3), numbers[g:o].reshape(n_tasks, 12),
    )  # fmt: skip
    limits, least_normal = numbers[o : o + d], numbers[o + d]
    return tree, links, contacts, contact_frames, points, cones, lengths, tasks, gains, frames, limits, least_normal


def room_sizes(sizes, m):
    """How many real and how many whole numbers the memory of a tick must hold; sizes: as for `unpacked`, m: motion rows."""
    n_joints, _, n_points, _, n_tasks, d = (int(size) for size in sizes)
    base, k = 6, 3 * n_points
    nv = d + base
    n = nv + k  # and no more β than that
    contact = 12 * n_joints + (k + m) * nv + m
    elimination = (m + base) * (n + 1) + 2 * (nv + n + m + base) + m * nv + m
    maps = (n + d) * (n + 1)
    cost = (3 * n_tasks + 2 * d + k + 5) * (n + 1) + 3 * nv + 2 * d + 2 * (n + d)
    search = (n + 1) ** 2 + 4 * n * n + 7 * n + k + d
    return 1 + contact + elimination + maps + cost + search, 1 + (m + base) + 3 * n


@_compiled
def readable(q, v, targets, tree):
    """Whether all numbers are finite, and what stands for turns in q, a quaternion or (cos, sin), has length 1."""
    if not (finite(q) and finite(v) and finite(targets)):
        return False
    for i in range(1, tree.shape[0]):
        if tree[i, 4] > tree[i, 2]:
            square = 0.0
            for at in range(tree[i, 3] + (3 if tree[i, 4] == 7 else 0), tree[i, 3] + tree[i, 4]):
                square += q[at] * q[at]
            if abs(np.sqrt(square) - 1.0) > 1e-6:
                return False
    return True


@_compiled
def write_answer(V, T, beta, active, count, nv, answer):
    """(16) The first parts of `answer`, and the numbers of active rows (count,) in its last; False where it has no digits."""
    n, d = V.shape[0], T.shape[0]
    image(V, beta, 0, nv, answer[:nv])
    image(T, beta, 0, d, answer[nv : nv + d])
    image(V, beta, nv, n, answer[nv + d : n + d])
    for i in range(count):
        answer[2 * n + d + i] = active[i]
    for i in range(n + d):
        if not abs(answer[i]) <= _FAR:  # nor is what is no number
            return False
    return True


@_compiled
def tick(q, v, targets, M, h, J, Ag, oMi, sizes, indices, numbers, room, whole, answer, parts):
    """(26)(27) answer = (q̈, τ, λ), then the multipliers and the numbers of the rows that hold it, each (nv + k,), of which
    the first ones count. Returns how many, or what kept it from an answer.

    q: (nq,). v: (nv,). targets: those of all tasks, one after the other. M, h, J, Ag, oMi: Pinocchio's results for q and v.
    sizes, indices, numbers: the tables of robot, contacts and tasks, as for `unpacked`; few arrays, since each costs.
    room, whole: memory for real and for whole numbers, as large as `room_sizes` says. parts: how many of PARTS to run, for
    benchmarks; the answer needs all.
    """
    tree, links, contacts, contact_frames, points, cones, lengths, tasks, gains, frames, limits, least_normal = unpacked(
        sizes, indices, numbers
    )
    nv, d, k, m = v.size, limits.size, 3 * points.shape[0], motion_rows(contacts)
    base, n = nv - d, nv + k
    if not readable(q, v, targets, tree):
        return REFUSED
    room[0], whole[0] = 1, 1
    velocity, drift = table(room, tree.shape[0], 6), table(room, tree.shape[0], 6)
    sweep(tree, J, v, velocity, drift)
    Jp, b = table(room, k, nv), line(room, m)
    A = Jp if contacts.shape[0] == points.shape[0] and m == k else table(room, m, nv)
    contact_rows(tree, oMi, J, velocity, drift, contacts, contact_frames, points, A, b, Jp)
    if parts == 1:
        return UNFINISHED
    by_rows = M.T  # symmetric; Pinocchio's is stored by columns
    B, pivots = table(room, m + base, n + 1), line(whole, m + base)
    least_motion, least = motions(A, b, by_rows, h, Jp, base, B, pivots, room)
    if least_motion <= _DEPENDENT:
        resolved, right = table(room, m, nv), line(room, m)
        m = independent_rows(A, b, v, resolved, right)
        if m < 0:
            return DOUBTFUL
        B, pivots = B[: m + base], pivots[: m + base]
        _, least = motions(resolved[:m], right[:m], by_rows, h, Jp, base, B, pivots, room)
    if least <= 1e-11:
        return DOUBTFUL
    nb = n - m - base
    V, beta_of, T = table(room, n, nb + 1), line(whole, n), table(room, d, nb + 1)
    parametrised(B, pivots, m, V, beta_of, line(whole, nb))
    torques(V, beta_of, by_rows, h, Jp, base, T)
    if parts == 2:
        return UNFINISHED
    R, diagonal, aim = table(room, 3 * tasks.shape[0] + 2 * d + k + 3, nb + 1), line(room, nb), line(room, nb)
    used = objective(
        q, v, oMi, J, Ag, tree, links, tasks, gains, frames, targets, velocity, drift, V, beta_of, T, base, room,
        R, diagonal, aim,
    )  # fmt: skip
    if used < 0:
        return REFUSED
    if parts == 3:
        return UNFINISHED
    beta, active, mu = line(room, nb), line(whole, nb), answer[n + d : n + d + nb]
    count = dual_search(R[:used], diagonal, aim, V, beta_of, T, cones, lengths, least_normal, limits, room, beta, active, mu)
    if count < 0:
        return count
    return count if write_answer(V, T, beta, active, count, nv, answer) else DOUBTFUL
