"""The compiled entry point `tick`: eqs. (26), (27) over plain arrays.

`compiled.py` fills the arrays and calls `tick`; README.md explains its stages. A tick without an
answer returns a code: INVALID (a value is not finite, a quaternion has the wrong length, an
orientation error is too large, a target is not valid, a wheel lies on its side, or there is no
support polygon), INACCURATE (the last digits are lost), INFEASIBLE. After the first two, the
reference backend decides.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase.control.tick import problem_arrays as size
from floatbase.control.tick.costs import Cost, TaskTable, contact_costs, count_user_rows, task_costs
from floatbase.control.tick.dual_search import INACCURATE, dual_search
from floatbase.control.tick.dynamics import (
    DRIFT_FACTOR,
    MASS,
    N_TERMS,
    Model,
    bodies_size,
    compute_dynamics,
    take_bodies,
)
from floatbase.control.tick.elimination import (
    DEPENDENT_ROW,
    ZERO_ROW,
    Parametrisation,
    eliminate,
    independent_rows,
    parametrise,
    torques,
)
from floatbase.control.tick.inequalities import (
    Inequalities,
    affine_value,
    capture_points,
    joint_bounds,
)
from floatbase.control.tick.jit import jit, jit_cached, jit_inline
from floatbase.control.tick.kinematics import ContactTable, contact_rows
from floatbase.control.tick.workspace import (
    all_finite,
    read_matrix,
    read_vector,
    take_matrix,
    take_vector,
)
from floatbase.robots import UNIT_NORM_TOLERANCE

INVALID, STOPPED = -1, -4
N_STAGES = 5  # of a tick: dynamics, contact rows, elimination, costs, optimum
# m/s², N·m or N: a larger entry of the answer is nearly undetermined and has lost its digits
MAX_ENTRY = 1e8


@jit_inline
def unpack(nv, sizes, int_tables, float_tables, inputs, counters, workspace, saturated):
    """Return model, contacts, tasks, limits, joint limits and more from their flat arrays.

    `problem_arrays.pack_problem` and `user_terms.UserTerms` wrote the arrays. sizes: its entries
    have names in `problem_arrays`. counters: two integers of memory. saturated: memory for
    `Inequalities`. int_tables, float_tables: integers and real numbers of all tables,
    one table after another. inputs: as for `tick`.
    """
    n, d, k = sizes[size.N_JOINTS], sizes[size.N_DRIVEN], sizes[size.N_FORCES]
    n_contacts, n_points = sizes[size.N_CONTACTS], sizes[size.N_POINTS]
    n_rows, n_tasks = sizes[size.N_CONE_ROWS], sizes[size.N_TASKS]
    n_user_tasks = sizes[size.N_USER_TASKS]
    ints, floats = counters[:1], counters[1:]
    ints[0], floats[0] = 0, 0
    tree = read_matrix(int_tables, ints, n, 6)
    contact_table = read_matrix(int_tables, ints, n_contacts, 9)
    task_table = read_matrix(int_tables, ints, n_tasks, 7)
    terms = read_vector(float_tables, floats, N_TERMS)
    links = read_matrix(float_tables, floats, n, MASS + 1)
    joints = read_matrix(float_tables, floats, n, 15)
    model = Model(tree, joints, links, read_vector(float_tables, floats, nv), terms)
    frames = read_matrix(float_tables, floats, n_contacts, 19)
    points = read_matrix(float_tables, floats, n_points, 4)
    bounds = sizes[size.N_TARGETS]  # inputs: targets, bounds of normal forces, user-defined terms
    user_start = bounds + 2 * n_points
    contacts = ContactTable(
        contact_table, frames, points, inputs, user_start, sizes[size.SAME_ROWS] == 1,
        take_matrix(workspace, n_points, 3),
    )  # fmt: skip
    gains = read_matrix(float_tables, floats, n_tasks, 3)
    user_tasks = user_start + sizes[size.N_CONTACT_NUMBERS]
    n_user_rows, user_inequalities = count_user_rows(inputs, user_tasks, n_user_tasks, nv, k, d)
    task_frames = read_matrix(float_tables, floats, 2 * n_tasks, 12)
    tasks = TaskTable(task_table, gains, task_frames, inputs, user_tasks, n_user_tasks, n_user_rows)
    cones = read_matrix(float_tables, floats, n_points * n_rows, 5)
    torque_limits = read_vector(float_tables, floats, d)
    joint_limits = read_matrix(float_tables, floats, 6, d)
    period, joint_limit_weight, contact_weight = read_vector(float_tables, floats, 3)
    groups = take_vector(workspace, inputs.size - user_inequalities)
    for i in range(groups.size):
        groups[i] = inputs[user_inequalities + i]
    limits = Inequalities(
        cones, n_rows - 1, n_points, torque_limits, inputs, bounds, groups,
        sizes[size.N_INEQUALITIES], take_matrix(workspace, 3, nv + k + 1),
        sizes[size.HAS_CONES] == 1, sizes[size.HAS_OPTIONAL] == 1,
        sizes[size.HAS_JOINT_LIMITS] == 1, take_vector(workspace, d), take_vector(workspace, d),
        joint_limit_weight, saturated,
    )  # fmt: skip
    return model, contacts, tasks, limits, joint_limits, period, contact_weight


def workspace_sizes(
    sizes: npt.NDArray[Any], n_inputs: int, n_user_rows: int = 0
) -> tuple[int, int]:
    """Return how many real numbers and how many integers a tick needs as memory.

    sizes: as for `unpack`. n_inputs: size of the inputs. n_user_rows: number of rows of all
    user-defined tasks.
    """
    n_joints, n_tasks, n_points = sizes[[size.N_JOINTS, size.N_TASKS, size.N_POINTS]].tolist()
    m, d, k = sizes[[size.N_MOTION_ROWS, size.N_DRIVEN, size.N_FORCES]].tolist()
    base, nv = 6, d + 6
    n = nv + k  # and no more β than that
    contact = bodies_size(n_joints, nv) + (k + m) * nv + m + 3 * n_points
    elimination = (m + base) * (n + 1) + 2 * (2 * n + m + base) + m * nv + m
    space = (n + d) * (n + 1)
    n_rows = 3 * n_tasks + n_user_rows + m + 2 * d + k + 5
    cost = n_rows * (n + 1) + 3 * nv + 2 * d + 2 * (n + d)
    search = (n + 1) ** 2 + 3 * n * n + 8 * n + k + 3 * d + nv + 3 * (n + 1) + n_inputs
    return 1 + contact + elimination + space + cost + search, 3 + (m + base) + 3 * n


@jit
def inputs_valid(q, v, inputs, tree):
    """Return whether all numbers are finite, and quaternions and (cos, sin) in q have length 1.

    tree: as in `Model`.
    """
    if not (all_finite(q) and all_finite(v) and all_finite(inputs)):
        return False
    for i in range(1, tree.shape[0]):
        if tree[i, 4] > tree[i, 2]:
            square = 0.0
            for at in range(tree[i, 3] + (3 if tree[i, 4] == 7 else 0), tree[i, 3] + tree[i, 4]):
                square += q[at] * q[at]
            if abs(np.sqrt(square) - 1.0) > UNIT_NORM_TOLERANCE:
                return False
    return True


@jit
def write_result(space: Parametrisation, beta, active, n_active, nv, result):
    """Write (q̈, τ, λ) at β and the numbers of the active rows into `result`.

    Returns False if an entry is NaN or too large to be accurate.
    """
    n, d = space.V.shape[0], space.T.shape[0]
    affine_value(space.V, beta, 0, nv, result[:nv])
    affine_value(space.T, beta, 0, d, result[nv : nv + d])
    affine_value(space.V, beta, nv, n, result[nv + d : n + d])
    for i in range(n_active):
        result[2 * n + d + i] = active[i]
    is_accurate = True
    for i in range(n + d):
        is_accurate &= abs(result[i]) <= MAX_ENTRY  # nor is NaN
    return is_accurate


def make_tick(digest):
    """Return the function `tick`, to be compiled; digest: of this folder."""

    def tick(
        q, v, inputs, sizes, int_tables, float_tables, float_workspace, int_workspace, result,
        stages,
    ):  # fmt: skip
        """Compute torques, accelerations and forces of one state: eqs. (26), (27).

        Returns the number of active rows, or a code that says why there is no answer. q, v: (nq,),
        (nv,), the state. inputs: what changes from tick to tick, as `user_terms.UserTerms` packs
        it: targets, minimum and maximum normal force of each point, then user-defined contacts,
        tasks and rows. sizes, int_tables, float_tables: as for `unpack`; few arrays, since each one
        costs time. float_workspace, int_workspace: workspaces of `workspace_sizes` numbers, the
        only memory besides `result` that is written to. result: receives q̈, τ, λ, then the
        multipliers and the numbers of the active rows, (nv + k,) each, then
        `Inequalities.saturated`. stages: how many of N_STAGES to run, for benchmarks.
        """
        _ = digest  # makes it part of numba's cache key
        nv, m = v.size, sizes[size.N_MOTION_ROWS]
        d, k = sizes[size.N_DRIVEN], sizes[size.N_FORCES]
        base, n = nv - d, nv + k
        passive = base if sizes[size.UNDERACTUATED] == 1 else 0  # rows of (7) without a motor
        float_workspace[0], int_workspace[0] = 1, 1
        model, contacts, tasks, limits, joint_limits, period, contact_weight = unpack(
            nv, sizes, int_tables, float_tables, inputs, take_vector(int_workspace, 2),
            float_workspace, result[3 * n + d :],
        )  # fmt: skip
        if not inputs_valid(q, v, inputs, model.tree):
            return INVALID
        bodies = take_bodies(model, v, float_workspace)
        compute_dynamics(model, bodies, q)
        if stages == 1:
            return STOPPED
        M, h = bodies.M, bodies.h
        J_points, b = take_matrix(float_workspace, k, nv), take_vector(float_workspace, m)
        A = J_points if contacts.same_rows else take_matrix(float_workspace, m, nv)
        if not contact_rows(bodies, contacts, A, b, J_points):
            return INVALID
        soft_A, soft_b = A[:0], b[:0]
        if contact_weight > 0.0:
            soft_A, soft_b, A, b, m = A, b, A[:0], b[:0], 0
        for i in range(m):
            b[i] *= model.terms[DRIFT_FACTOR]
        if stages == 2:
            return STOPPED
        B = take_matrix(float_workspace, m + passive, n + 1)
        pivots = take_vector(int_workspace, m + passive)
        motion_pivot, smallest_pivot = eliminate(
            A, b, M, h, J_points, passive, float_workspace, B, pivots
        )
        if motion_pivot <= DEPENDENT_ROW:
            rows, rhs = take_matrix(float_workspace, m, nv), take_vector(float_workspace, m)
            m = independent_rows(A, b, v, rows, rhs)
            if m < 0:
                return INACCURATE
            B, pivots = B[: m + passive], pivots[: m + passive]
            _, smallest_pivot = eliminate(
                rows[:m], rhs[:m], M, h, J_points, passive, float_workspace, B, pivots
            )
        if smallest_pivot <= ZERO_ROW:
            return INACCURATE
        nb = n - m - passive
        V, T = take_matrix(float_workspace, n, nb + 1), take_matrix(float_workspace, d, nb + 1)
        space = Parametrisation(V, take_vector(int_workspace, n), T)
        parametrise(B, pivots, m, take_vector(int_workspace, nb), space.V, space.beta_index)
        torques(space.V, space.beta_index, M, h, J_points, base, space.T)
        if stages == 3:
            return STOPPED
        n_rows = soft_b.size + 3 * tasks.table.shape[0] + tasks.n_user_rows + 2 * d + k + 3
        R = take_matrix(float_workspace, n_rows, nb + 1)
        diagonal, linear = take_vector(float_workspace, nb), take_vector(float_workspace, nb)
        used = contact_costs(soft_A, soft_b, contact_weight, space, R)
        used = task_costs(
            q, v, bodies, contacts, tasks, space, base, float_workspace, Cost(R, diagonal, linear),
            used,
        )  # fmt: skip
        if used < 0:
            return INVALID
        if stages == 4:
            return STOPPED
        if limits.has_joint_limits:
            joint_bounds(q, v, model.tree, joint_limits, period, limits.least, limits.largest)
        if not capture_points(limits, bodies, contacts.positions, space):
            return INVALID
        beta, active = take_vector(float_workspace, nb), take_vector(int_workspace, nb)
        mu = result[n + d : n + d + nb]
        n_active = dual_search(
            Cost(R[:used], diagonal, linear), limits, space, nv, float_workspace, active, mu, beta
        )
        if n_active < 0:
            return n_active
        return n_active if write_result(space, beta, active, n_active, nv, result) else INACCURATE

    return tick


tick = jit_cached(make_tick, nogil=True)  # other threads can run Python meanwhile
