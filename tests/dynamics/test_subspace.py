"""ζ, η, C, B and their spaces, eqs. (8)-(14), (16), (17).

Ranks come from MuJoCo's matrices and elimination with complete pivoting. Forces come from least
squares of the whole system and from MuJoCo's contacts.
"""

import itertools
from functools import cache

import judges
import numpy as np
import numpy.typing as npt
import pytest
import scipy.linalg
from judges import Array
from messages import raises

import floatbase as fb
from floatbase import dynamics
from floatbase._geometry import minimum_jerk
from floatbase.dynamics import EquationsOfMotion, PointContact, fixed_frame
from floatbase.errors import InputError


def stances(name: str) -> list[fb.Contacts]:
    """Make every subset of a robot's feet as points, and as flat feet if they are flat.

    A robot without feet gets no contacts.
    """
    robot = judges.load(name)
    frames = [foot.frame for foot in robot.feet]
    some = [list(c) for n in range(1, len(frames) + 1) for c in itertools.combinations(frames, n)]
    kinds = [fb.Contacts.points] + ([fb.Contacts.flat_feet] if name in judges.FLAT else [])
    return [kind(robot, frames=frames) for kind in kinds for frames in some] or [fb.Contacts.none()]


def straight(name: str) -> fb.State:
    """Return the standing posture with every knee straight."""
    robot = judges.load(name)
    q = np.array(robot.posture)
    for joint in robot.joint_names:
        if any(word in joint for word in ("calf", "KFE", "leg_left_4", "leg_right_4")):
            q[robot.model.idx_qs[robot.model.getJointId(joint)]] = 0.0
    return fb.State(robot, q)


@cache
def clear_states(name: str, n: int) -> list[fb.State]:
    """Draw n random states in which the rank of every stance is clear.

    No singular value is near the limit 1e-4 below which a direction is not resolved.
    """

    def clear(state: fb.State) -> bool:
        rows = [contacts.constraint(state)[0] for contacts in stances(name)]
        parts = [np.linalg.svd(A, compute_uv=False) for A in rows]
        return not any(np.any((s > 1e-9 * s[0]) & (s < 5e-4 * s[0])) for s in parts if s.size)

    states = map(judges.load(name).random_state, itertools.count())
    return list(itertools.islice(filter(clear, states), n))


def configurations(name: str) -> dict[str, fb.State]:
    """Return standing, straight knees, all joints at zero, and two random configurations."""
    robot = judges.load(name)
    found = {"standing": robot.standing(), "straight": straight(name), "neutral": robot.neutral()}
    return found | {f"random {i}": state for i, state in enumerate(clear_states(name, 2))}


@cache
def cases(name: str) -> list[tuple[str, EquationsOfMotion]]:
    """Combine every configuration with every stance of a robot."""
    return [
        (f"{name} {where} on {contacts.names}", fb.equations_of_motion(state, contacts))
        for where, state in configurations(name).items()
        for contacts in stances(name)
    ]


def eliminated(A: npt.ArrayLike, tolerance: float = 1e-8) -> int:
    """Compute a rank by Gaussian elimination with complete pivoting, without singular values.

    The rows are scaled to unit length.
    """
    A = np.array(A, dtype=np.float64)
    lengths = np.linalg.norm(A, axis=1, keepdims=True)
    A = A / np.where(lengths > 1e-12, lengths, 1.0)
    count = 0
    while A.size and count < min(A.shape):
        rest = np.abs(A[count:, count:])
        i, j = np.unravel_index(rest.argmax(), rest.shape)
        if rest[i, j] < tolerance:
            break
        A[[count, count + i]] = A[[count + i, count]]
        A[:, [count, count + j]] = A[:, [count + j, count]]
        A[count + 1 :] -= np.outer(A[count + 1 :, count] / A[count, count], A[count])
        count += 1
    return count


def judged(eom: EquationsOfMotion) -> tuple[Array, Array]:
    """Return M and J from MuJoCo."""
    judge = judges.mujoco_of(eom.robot.name).move_to(eom.state)
    owners = [each.name for each in eom.contacts.friction_contacts for _ in each.point_names]
    points = zip(owners, eom.contacts.positions(eom.state), strict=True)
    J = [judge.jacobian(frame, point)[0] for frame, point in points]
    return judge.M, np.vstack([np.zeros((0, eom.nv)), *J])


def held(eom: EquationsOfMotion) -> EquationsOfMotion:
    """Return the equations at the nearest velocity that the contacts allow, A v = 0."""
    v = eom.state.v - np.linalg.pinv(eom.A, rcond=1e-9) @ (eom.A @ eom.state.v)
    return fb.equations_of_motion(eom.state.replace(v=v), eom.contacts)


@cache
def held_cases(name: str) -> list[tuple[str, EquationsOfMotion]]:
    """Return `cases` with velocities that the contacts allow."""
    return [(case, held(eom)) for case, eom in cases(name)]


# counting -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", judges.KINDS)
def test_ranks_of_the_contact_jacobian_are_those_of_mujocos_by_elimination(name):
    for case, eom in cases(name):
        found = dynamics.dimensions(eom)
        _, J = judged(eom)
        assert found.rank_J == eliminated(J), case
        assert found.rank_J_base == eliminated(J[:, : eom.nv - eom.d]), case
        assert (found.nv, found.d, found.k) == (eom.robot.nv, eom.robot.d, eom.contacts.k)


@pytest.mark.parametrize("name", judges.KINDS)
def test_null_spaces_of_B_and_C_both_have_dimension_d_plus_k_minus_rank_J(name):
    for case, eom in cases(name):
        found, (_, J) = dynamics.dimensions(eom), judged(eom)
        expected = eom.d + eom.k - eliminated(J)
        assert (found.null_B, found.null_C) == (expected, expected), case
        assert dynamics.feasible_space(eom).dimension == expected, case
        assert dynamics.torque_force_space(eom).n_in == expected, case
        B, C = dynamics.motion_matrix(eom)[0], dynamics.torque_force_matrix(eom)[0]
        assert B.shape[1] - eliminated(B) == expected, case
        assert C.shape[1] - eliminated(C) == expected, case
        if found.rank_J == eom.k:
            assert expected == eom.d, case


@pytest.mark.parametrize("name", judges.KINDS)
def test_as_many_accelerations_are_free_as_torques_reach_by_mujocos_matrices(name):
    """rank V_q̈ = d - rank J + rank J_b is the number of accelerations that torques can produce
    while the contacts hold.
    """
    for case, eom in cases(name):
        M, J = judged(eom)
        found = dynamics.dimensions(eom)
        assert found.rank_V_qdd == eom.d - eliminated(J) + eliminated(J[:, : eom.nv - eom.d]), case
        N = np.linalg.svd(J)[2][eliminated(J) :].T if len(J) else np.eye(eom.nv)
        reached = N @ np.linalg.solve(N.T @ M @ N, N.T @ eom.S)
        assert found.rank_V_qdd == eliminated(reached, 1e-7), case


@pytest.mark.parametrize("name", judges.FLOATING)
def test_internal_forces_are_those_that_push_the_rigid_body_nowhere_as_many_as_geometry_says(name):
    """k - rank J_b from geometry alone: one point, points on a line, and other points have 3, 5 or
    6 independent wrenches on a rigid body.
    """
    for case, eom in cases(name):
        points = eom.contacts.positions(eom.state)
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        spanned = int(np.sum(spread > 1e-9))
        expected = eom.k - {0: 3, 1: 5}.get(spanned, 6)
        F = dynamics.internal_forces(eom)
        assert F.shape == (eom.k, expected), case
        assert dynamics.dimensions(eom).internal == expected, case
        for f in F.T:
            each = f.reshape(-1, 3)
            assert np.allclose(each.sum(axis=0), 0.0, atol=1e-9), case
            assert np.allclose(np.cross(points, each).sum(axis=0), 0.0, atol=1e-9), case


@pytest.mark.parametrize("name", judges.FLOATING)
def test_torques_squeeze_internal_forces_in_without_moving_anything(name):
    """If τ changes by -J_jᵀ λ for an internal λ, the acceleration by Pinocchio's recursion is the
    same.
    """
    rng = np.random.default_rng(0)
    for case, eom in cases(name)[:: 3 if name != "talos" else 1]:
        F = dynamics.internal_forces(eom)
        if F.shape[1] == 0:
            continue
        tau, forces = rng.normal(size=eom.d), rng.normal(size=eom.k)
        squeeze = 20.0 * F @ rng.normal(size=F.shape[1])
        before = judges.aba(eom, tau, forces)
        after = judges.aba(eom, tau - eom.J[:, 6:].T @ squeeze, forces + squeeze)
        assert np.allclose(before, after, atol=1e-7 * max(1.0, np.abs(before).max())), case
        # a squeeze outside null(Jᵀ) needs these torques
        if np.linalg.norm(eom.J.T @ squeeze) > 1.0:
            assert np.linalg.norm(judges.aba(eom, tau, forces + squeeze) - before) > 1e-2, case


@pytest.mark.parametrize("name", judges.ROBOTS)
def test_forces_are_unique_exactly_where_null_J_transposed_is_empty(name):
    for case, eom in cases(name):
        _, J = judged(eom)
        N = dynamics.undetermined_forces(eom)
        assert N.shape[1] == eom.k - eliminated(J), case
        assert (dynamics.contact_space(eom).r == eom.k) == (eliminated(J) == eom.k), case
        if eom.k:
            assert np.max(np.abs(J.T @ N), initial=0.0) < 1e-8, case


def test_solo8_on_four_feet_has_rank_10_if_symmetric_9_with_straight_legs_11_elsewhere():
    robot = judges.load("solo8")
    others = [(state, 11) for state in clear_states("solo8", 10)]
    for state, rank in ((robot.standing(), 10), (robot.neutral(), 9), *others):
        found = dynamics.dimensions(fb.equations_of_motion(state, fb.Contacts.points(robot)))
        assert (found.rank_J, found.null_B, found.undetermined) == (rank, 20 - rank, 12 - rank)
        assert found.rank_V_qdd == 8 - rank + found.rank_J_base


def test_straight_knees_cost_rank_once_the_base_is_bolted_and_the_formula_holds_there_too(go2):
    contacts = fb.Contacts.points(go2) + fb.Contacts([fixed_frame("base")])
    for state, lost in ((go2.standing(), 0), (go2.neutral(), 4)):
        found = dynamics.dimensions(fb.equations_of_motion(state, contacts))
        assert found.rank_J == 18 - lost
        assert found.null_B == found.null_C == 12 + 18 - found.rank_J
        # independent motions of the legs; none if they are bent
        assert found.rank_V_qdd == 12 - found.rank_J + 6 == lost


def near_singular(exponent: int, speed: float = 0.0) -> EquationsOfMotion:
    """Make equations of solo8 on four feet near a loss of rank, with velocity noise.

    The distance is 10^-exponent, and the noise is `speed` [m/s, rad/s].
    """
    robot = judges.load("solo8")
    rng = np.random.default_rng(0)
    state = judges.along(robot.standing(), rng.normal(size=robot.nv), 10.0**-exponent)
    state = state.replace(v=speed * rng.normal(size=robot.nv))
    return fb.equations_of_motion(state, fb.Contacts.points(robot))


def test_contacts_hold_under_eta_but_for_directions_they_resolve_worse_than_a_ten_thousandth():
    """A q̈ = b holds to 1e-10 of |q̈| along the resolved directions, and along the others to their
    singular value times |q̈|.
    """
    for exponent in range(1, 13):
        eom = near_singular(exponent)
        qdd = dynamics.accelerations_from_torques(eom)(np.random.default_rng(1).normal(size=8))
        U, s, _ = np.linalg.svd(eom.A)
        gap, held = np.abs(U.T @ (eom.A @ qdd - eom.b)), s > 1e-4 * s[0]
        assert np.max(gap[held]) < 1e-10 * np.linalg.norm(qdd), exponent
        assert np.all(gap[~held] <= (s[~held] + 1e-10) * np.linalg.norm(qdd)), exponent
        assert held.sum() == dynamics.contact_space(eom).r, exponent
        assert held.sum() == (11 if exponent == 1 else 10) or 1 < exponent < 5, exponent


def test_velocity_noise_makes_no_force_near_a_loss_of_rank():
    """The torques that keep solo8 at rest in the singular stance produce the same forces nearby, to
    1 % of the weight.

    Eq. (9) taken literally needs more than 1e8 N for joint angles off by 1e-6 rad and a velocity
    off by 0.1.
    """
    robot = judges.load("solo8")
    standing, contacts = robot.standing(), fb.Contacts.points(robot)
    tau = judges.controller_of("solo8")(standing.q, standing.v).tau
    expected = dynamics.forces_from_torques(fb.equations_of_motion(standing, contacts))(tau)
    for exponent, speed in itertools.product(range(4, 13), (0.0, 0.01, 0.1)):
        eom = near_singular(exponent, speed)
        case = exponent, speed
        gap = dynamics.forces_from_torques(eom)(tau) - expected
        assert np.max(np.abs(gap)) < 0.01 * robot.weight, case
        qdd = dynamics.accelerations_from_torques(eom)(tau)
        assert np.max(np.abs(qdd)) < 0.2 + 10.0 * speed, case
        space = dynamics.feasible_space(eom)
        # the point of smallest norm, which includes q̈ in rad/s²
        assert np.max(np.abs(space.map.b)) < 10.0 * robot.weight, case


def test_newtons_law_holds_in_the_feasible_space_however_near_the_robot_is_to_losing_rank():
    """It also holds for forces along poorly resolved directions, which have a small effect on q̈."""
    for exponent in range(1, 13):
        eom = near_singular(exponent, 0.1)
        space = dynamics.feasible_space(eom)
        qdd, tau, forces = space(10.0 * np.random.default_rng(2).normal(size=space.dimension))
        gap = judges.aba(eom, tau, forces) - qdd
        assert np.max(np.abs(gap)) < 1e-9 * np.max(np.abs(qdd)), exponent
        assert space.dimension == eom.d + eom.k - dynamics.dimensions(eom).rank_J, exponent


def test_the_drift_that_counts_is_b_without_what_badly_resolved_directions_add_to_it():
    eom = near_singular(6, 0.1)
    U, _, Vt = np.linalg.svd(eom.A)
    A, b = dynamics.resolved_constraint(eom)
    assert np.max(np.abs(U[:, 10:].T @ b)) < 1e-12 < np.max(np.abs(U[:, 10:].T @ eom.b))
    assert np.max(np.abs(A @ Vt[10])) < 1e-12 < np.max(np.abs(eom.A @ Vt[10]))
    assert np.allclose(U[:, :10].T @ b, U[:, :10].T @ eom.b, atol=1e-12)
    go2 = judges.load("go2")
    regular = fb.equations_of_motion(go2.random_state(0), fb.Contacts.points(go2))
    A, b = dynamics.resolved_constraint(regular)
    assert np.allclose(A, regular.A, atol=1e-12) and np.allclose(b, regular.b, atol=1e-12)


def test_contacts_whose_forces_act_where_nothing_is_held_are_refused():
    """A thruster is not a contact: its rows must constrain the direction of its force."""

    class Thruster(PointContact):
        row_names = ("x", "y")

        def constraint(self, state: fb.State, t: float = 0.0) -> tuple[Array, Array]:
            A, b = super().constraint(state, t)
            return A[:2], b[:2]

    state = judges.load("go2").standing()
    thruster = fb.Contacts([Thruster("FL_foot", radius=0.022)])
    with raises(InputError, "A", "J"):
        dynamics.feasible_space(fb.equations_of_motion(state, thruster))


@pytest.mark.parametrize("name", judges.FLOATING)
def test_in_free_flight_all_torques_are_free_and_no_force_is_left(name):
    state = judges.load(name).random_state(0)
    eom = fb.equations_of_motion(state, fb.Contacts.none())
    found = dynamics.dimensions(eom)
    assert found.null_B == found.null_C == found.rank_V_qdd == eom.d
    assert found.internal == found.undetermined == 0
    tau = np.random.default_rng(0).normal(size=eom.d)
    qdd = dynamics.accelerations_from_torques(eom)(tau)
    assert judges.relative(qdd, judges.aba(eom, tau, np.zeros(0))) < 1e-9
    assert dynamics.forces_from_torques(eom)(tau).shape == (0,)


# ζ and η ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", judges.ROBOTS)
def test_zeta_gives_the_smallest_forces_and_eta_the_only_accelerations(name):
    """Every configuration and stance, with and without loss of rank, against one least-squares
    solution of the whole system.
    """
    rng = np.random.default_rng(0)
    for case, eom in held_cases(name):
        tau = 5.0 * rng.normal(size=eom.d)
        qdd, forces = judges.constrained(eom, tau)
        assert judges.relative(dynamics.accelerations_from_torques(eom)(tau), qdd) < 1e-6, case
        found = dynamics.forces_from_torques(eom)(tau)
        assert judges.relative(found, forces) < 1e-6, case
        N = dynamics.undetermined_forces(eom)
        scale = 1.0 + np.abs(found).max(initial=0.0)
        assert np.max(np.abs(N.T @ found), initial=0.0) < 1e-6 * scale, case


@pytest.mark.parametrize("robot", judges.BALLS, indirect=True)
def test_mujocos_forces_in_motion_differ_from_zeta_by_less_than_1e_4_of_the_weight(robot):
    """The difference is 2e-5 of the weight while swaying at 1 rad/s and 2 cm, so a rigid contact is
    a good model of MuJoCo's stiffest contact.
    """
    standing, contacts = robot.standing(), judges.stance(robot)

    def sway(t: float) -> Array:
        path = np.array([0.02 * np.sin(6.0 * t), 0.0, 0.01 * np.sin(9.0 * t)])
        return standing.com + minimum_jerk(4.0 * t)[0] * path

    tasks = (fb.CoMTask(sway), *fb.standing_tasks(standing)[1:])
    controller = fb.WholeBodyController(robot, contacts, tasks)
    run = fb.rollout(fb.Simulation(robot), controller, 0.5, control_period=2e-3)
    assert run.outcome == "completed"
    assert np.abs(run.v[100:]).max() > 0.1
    gaps = []
    for i in range(100, len(run), 5):
        zeta = dynamics.forces_from_torques(fb.equations_of_motion(run.state(i), contacts))
        gaps.append(zeta(run.tau[i]) - run.measured[i])
    assert 1e-7 < np.abs(gaps).max() / robot.weight < 1e-4


@pytest.mark.parametrize("name", judges.ROBOTS)
def test_B_and_C_are_the_equations_of_motion_in_one_matrix_each(name):
    """Eqs. (10) and (12) against eq. (7) at points that do not solve it: the residuals are equal.
    The part of b is computed with MuJoCo's M.
    """
    rng = np.random.default_rng(4)
    for case, eom in cases(name):
        if case.split()[1] != "random":
            continue
        qdd, tau, forces = rng.normal(size=eom.nv), rng.normal(size=eom.d), rng.normal(size=eom.k)
        B, right = dynamics.motion_matrix(eom)
        left = B @ np.concatenate([qdd, tau, forces]) - right
        judge = judges.mujoco_of(name).move_to(eom.state)
        newton = judge.M @ qdd + judge.h - eom.S @ tau - eom.J.T @ forces
        assert np.allclose(left, np.concatenate([newton, eom.A @ qdd - eom.b]), atol=1e-7), case
        C, a = dynamics.torque_force_matrix(eom)
        expected = eom.A @ judges.aba(eom, tau, forces) - eom.b
        gap = C @ np.concatenate([tau, forces]) - a - expected
        assert np.allclose(gap, 0.0, atol=1e-7 * np.abs(expected).max(initial=1.0))


@pytest.mark.parametrize("name", judges.ROBOTS)
def test_the_feasible_space_is_the_pseudo_inverse_point_and_the_null_space_of_B_as_in_13(name):
    for case, eom in held_cases(name):
        if case.split()[1] not in ("standing", "random"):
            continue
        B, right = dynamics.motion_matrix(eom)
        space = dynamics.feasible_space(eom)
        v = np.linalg.lstsq(B, right, rcond=1e-10)[0]
        N = scipy.linalg.null_space(B, rcond=1e-10)
        assert judges.relative(space.map.b, v) < 1e-6, case
        assert np.allclose(space.map.A @ space.map.A.T, N @ N.T, atol=1e-7), case
        C, a = dynamics.torque_force_matrix(eom)
        pairs = dynamics.torque_force_space(eom)
        if dynamics.contact_space(eom).r == eom.k:  # C squares the small singular values of J
            N = scipy.linalg.null_space(C, rcond=1e-10)
            assert np.allclose(pairs.A @ pairs.A.T, N @ N.T, atol=1e-6), case
            assert judges.relative(pairs.b, np.linalg.lstsq(C, a, rcond=1e-10)[0]) < 1e-5, case


# the whole space ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", judges.ROBOTS)
def test_coordinates_of_a_point_of_the_space_are_the_beta_it_came_from(name):
    rng = np.random.default_rng(2)
    for case, eom in cases(name):
        space = dynamics.feasible_space(eom)
        beta = rng.normal(size=space.dimension)
        assert np.allclose(space.coordinates(*space(beta)), beta, atol=1e-8), case
        assert np.allclose(space.map.A.T @ space.map.A, np.eye(space.dimension), atol=1e-10), case
        # (13) v has no part along V⊥
        assert np.max(np.abs(space.map.A.T @ space.map.b)) < 1e-6, case


def test_with_inconsistent_contacts_the_dynamics_hold_and_motion_rows_are_met_nearest():
    """solo8 with four feet that slide apart: A q̈ = b has no solution, but Newton's law must still
    hold.
    """
    state = judges.load("solo8").random_state(3, spread=0.6)
    eom = fb.equations_of_motion(state, fb.Contacts.points(state.robot))
    nearest = eom.A @ np.linalg.lstsq(eom.A, eom.b, rcond=1e-10)[0]
    assert np.max(np.abs(nearest - eom.b)) > 1e-3
    space = dynamics.feasible_space(eom)
    qdd, tau, forces = space(np.random.default_rng(0).normal(size=space.dimension))
    newton, _ = eom.residual(qdd, tau, forces)
    assert np.max(np.abs(newton)) < 1e-9 * np.abs(forces).max()
    assert np.allclose(eom.A @ qdd, nearest, atol=1e-8)
    tau = np.ones(8)
    assert np.allclose(eom.A @ dynamics.accelerations_from_torques(eom)(tau), nearest, atol=1e-7)
