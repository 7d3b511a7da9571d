"""Centroidal dynamics, eqs. (20)-(25), against momentum from MuJoCo and Pinocchio, and cvxpy."""

import cvxpy as cp
import judges
import mujoco
import numpy as np
import pytest
from judges import Array
from messages import refused

import floatbase as fb
from floatbase import dynamics, linear_algebra, objectives
from floatbase.dynamics import fixed_frame
from floatbase.errors import InputError

TIGHT = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-10)
TIGHT |= {"solver": cp.CLARABEL, "max_iter": 200}
LEAN = judges.random_normals(4, 5)


robot = judges.every_floating_robot


def mujocos_momentum(judge: judges.Mujoco, qpos: Array, qvel: Array) -> Array:
    """Compute MuJoCo's linear and angular momentum about the centre of mass, world frame, shape
    (6,).
    """
    judge.data.qpos[:], judge.data.qvel[:] = qpos, qvel
    mujoco.mj_fwdPosition(judge.model, judge.data)
    mujoco.mj_fwdVelocity(judge.model, judge.data)
    mujoco.mj_subtreeVel(judge.model, judge.data)
    mass = judge.model.body_subtreemass[0]
    return np.concatenate([mass * judge.data.subtree_linvel[0], judge.data.subtree_angmom[0]])


def mujocos_momentum_rate(state, contacts, forces, tau):
    """Differentiate MuJoCo's momentum under forces at the contact points and joint torques, without
    ground. Return MuJoCo's q̈ in our coordinates, too.
    """
    judge = judges.Mujoco(state.robot).move_to(state)
    model, data = judge.model, judge.data
    bits = mujoco.mjtDisableBit
    model.opt.disableflags |= int(bits.mjDSBL_CONTACT) | int(bits.mjDSBL_CLAMPCTRL)
    owners = [contact.name for contact in contacts.friction_contacts for _ in contact.point_names]
    applied, points, none = data.qfrc_applied, np.array(contacts.positions(state)), np.zeros(3)
    applied[:] = 0.0
    for frame, point, force in zip(owners, points, forces.reshape(-1, 3), strict=True):
        mujoco.mj_applyFT(model, data, force, none, point, judge.body(frame), applied)
    for joint, torque in zip(state.robot.joint_names, tau, strict=True):
        applied[model.joint(joint).dofadr[0]] += torque
    mujoco.mj_forward(model, data)
    qpos, qvel, qacc, dt = data.qpos.copy(), data.qvel.copy(), data.qacc.copy(), 1e-6
    ends = []
    for sign in (1.0, -1.0):
        there = qpos.copy()
        mujoco.mj_integratePos(model, there, qvel, sign * dt)
        ends.append(mujocos_momentum(judge, there, qvel + sign * dt * qacc))
    # qacc = T q̈ + Ṫ v, where the base velocity is constant in the base frame and turns in the
    # world: Ṫ v = R (ω × v)
    qacc[:3] -= judges.quaternion_rotation(state.q[3:7]) @ np.cross(state.v[3:6], state.v[:3])
    return (ends[0] - ends[1]) / (2.0 * dt), np.linalg.solve(judge.T, qacc)


def test_momentum_and_its_rate_are_mujocos(robot):
    """In motion, under random forces and torques. The rate is compared with differences of MuJoCo's
    momentum along MuJoCo's motion.
    """
    rng = np.random.default_rng(2)
    for state in judges.states(robot.name, 1):
        judge, contacts = judges.Mujoco(state.robot).move_to(state), judges.stance(state.robot)
        found = mujocos_momentum(judge, judge.data.qpos.copy(), judge.data.qvel.copy())
        assert judges.relative(objectives.centroidal_momentum(state), found) < 1e-9
        forces = state.robot.weight * rng.normal(size=contacts.k)
        rate, qdd = mujocos_momentum_rate(state, contacts, forces, rng.normal(size=state.robot.d))
        found, scale = objectives.centroidal_momentum_rate(state, qdd), np.abs(forces).sum()
        assert np.allclose(found, rate, atol=1e-6 * scale)
        # the motion q̇ changes the momentum, too
        still = objectives.centroidal_momentum_rate(state, np.zeros(state.robot.nv))
        assert not np.allclose(still, rate, atol=1e-2 * scale)


def test_the_grasp_matrix_sums_forces_and_their_moments_about_any_point():
    """Eqs. (20), (21) against the definition, Σ f_i and Σ (x_i - x_c) × f_i. Without points, the
    matrix has no columns.
    """
    rng = np.random.default_rng(0)
    points, about, forces = rng.normal(size=(5, 3)), rng.normal(size=3), rng.normal(size=(5, 3))
    wrench = dynamics.grasp_matrix(points, about) @ forces.ravel()
    assert np.allclose(wrench[:3], forces.sum(axis=0))
    assert np.allclose(wrench[3:], np.cross(points - about, forces).sum(axis=0))
    assert dynamics.grasp_matrix(np.zeros((0, 3)), about).shape == (6, 0)


# (20)(21) -----------------------------------------------------------------------------------------


def test_the_wrench_of_contact_forces_is_the_rate_of_mujocos_momentum_less_gravity(robot):
    """Σ f = ṗ - m g and Σ (x_i - x_c) × f_i = L̇ in motion, with and without joint torques, since
    these are internal.
    """
    rng = np.random.default_rng(0)
    for seed, state in enumerate(judges.states(robot.name, 2)):
        contacts = judges.stance(state.robot)
        forces = state.robot.weight * rng.normal(size=contacts.k)
        tau = 5.0 * seed * rng.normal(size=state.robot.d)
        rate = mujocos_momentum_rate(state, contacts, forces, tau)[0]
        wrench = objectives.com_wrench_map(state, contacts)
        gravity = np.array([0.0, 0.0, -state.robot.mass * 9.81])
        scale = np.abs(forces).sum()
        assert np.allclose(wrench["force"](forces), rate[:3] - gravity, atol=1e-6 * scale)
        assert np.allclose(wrench["moment"](forces), rate[3:], atol=1e-6 * scale)
        moments = objectives.net_moment_matrix(state, contacts) @ forces
        assert np.allclose(moments, rate[3:], atol=1e-6 * scale)


def test_there_is_one_identity_block_for_each_point_four_for_four_feet(robot):
    """Eq. (20) is printed with three blocks for four feet."""
    contacts = judges.stance(robot)
    G_f = objectives.net_force_matrix(contacts)
    assert G_f.shape == (3, 3 * contacts.n_points)
    for block in np.split(G_f, contacts.n_points, axis=1):
        assert np.array_equal(block, np.eye(3))
    if robot.name in judges.BALLS:
        assert G_f.shape == (3, 12)


# (22) ---------------------------------------------------------------------------------------------


def test_at_the_minimum_of_the_wrench_objective_the_robot_moves_as_desired(robot):
    """On a full stance, the minimum of eq. (22) is zero, and the minimizing forces produce the
    desired motion of centre of mass and momentum.
    """
    rng = np.random.default_rng(0)
    for state in judges.states(robot.name, 3):
        contacts = judges.stance(state.robot)
        a, spin = rng.normal(size=3), rng.normal(size=3)
        desired = objectives.desired_wrench(state, a, spin)
        cost = objectives.wrench_objective(state, contacts, *desired)
        forces = cost.minimizer()
        assert cost(forces) < 1e-12 * state.robot.weight**2
        rate = mujocos_momentum_rate(state, contacts, forces, np.zeros(state.robot.d))[0]
        assert np.allclose(rate[:3] / state.robot.mass, a, atol=1e-4)
        assert np.allclose(rate[3:], spin, atol=1e-4 * state.robot.weight)


def test_the_wrench_objective_has_the_value_of_its_formula(standing):
    """One or two feet cannot produce all six numbers, so the minimum is above zero."""
    rng = np.random.default_rng(0)
    for feet in (1, 2, 4):
        contacts = fb.Contacts.points(standing.robot)
        contacts = contacts.only(*contacts.names[:feet])
        force, moment = 50.0 * rng.normal(size=3), 5.0 * rng.normal(size=3)
        weights = {"force_weight": 0.5, "moment_weight": 3.0}
        cost = objectives.wrench_objective(standing, contacts, force, moment, **weights)
        lam = rng.normal(size=3 * feet)
        points = contacts.positions(standing)
        f = lam.reshape(-1, 3)
        direct = 0.25 * np.sum((force - f.sum(axis=0)) ** 2)
        direct += 1.5 * np.sum((moment - np.cross(points - standing.com, f).sum(axis=0)) ** 2)
        assert cost(lam) == pytest.approx(direct, rel=1e-10)
        assert (cost(cost.minimizer()) > 1e-3) == (feet < 3)


# (23) ---------------------------------------------------------------------------------------------


def split(f: Array, n: Array) -> tuple[float, float]:
    """Return tangential and signed normal size of a force, by trigonometry, not projectors."""
    normal = float(f @ n)
    return float(np.sqrt(max(0.0, f @ f - normal**2))), normal


def test_the_force_bias_is_squared_friction_plus_alpha_times_squared_distance_from_a():
    rng = np.random.default_rng(0)
    contacts = fb.Contacts.points(judges.load("go2"), normals=LEAN)
    for _ in range(20):
        lam, alpha, a = 30.0 * rng.normal(size=12), rng.uniform(0.1, 3.0), rng.uniform(0.0, 60.0, 4)
        pairs = [split(f, n) for f, n in zip(lam.reshape(4, 3), LEAN, strict=True)]
        tangential = 0.5 * sum(t**2 for t, _ in pairs)
        normal = 0.5 * sum((s - ai) ** 2 for (_, s), ai in zip(pairs, a, strict=True))
        assert objectives.tangential_bias(contacts)(lam) == pytest.approx(tangential, rel=1e-10)
        assert objectives.normal_bias(contacts, a)(lam) == pytest.approx(normal, rel=1e-10)
        expected = tangential + alpha * normal
        assert objectives.force_bias(contacts, alpha, a)(lam) == pytest.approx(expected, rel=1e-10)


# (24)(25) -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "sign"), [("solo8", -1), ("go2", 0), ("solo12", 0), ("anymal_kinova", 1)]
)
def test_the_catalogue_shows_too_few_torques_exactly_enough_and_redundancy(name, sign):
    eom = judges.at_rest(name, 0)
    found = objectives.torques_from_forces(eom)
    assert np.sign(eom.d - eom.k) == sign
    # solo8: 8 torques and one null(Jᵀ)
    assert found.reachable.n_in == (9 if name == "solo8" else 12)
    assert found.null_torques.shape[1] == max(eom.d - eom.k, 0)


@pytest.mark.parametrize("seed", [None, 0, 1])
@pytest.mark.parametrize("name", judges.BALLS)
def test_the_smallest_torques_for_reachable_forces_are_cvxpys(name, seed):
    """Minimize ½‖τ‖² over (q̈, τ) with eq. (7) and given λ. Random torques produce the forces that
    solo8 can reach.
    """
    rng = np.random.default_rng(0)
    eom = judges.at_rest(name, seed)
    found = objectives.torques_from_forces(eom)
    tau0 = rng.normal(size=eom.d)
    expected = dynamics.forces_from_torques(eom)(tau0)
    assert found.distance(expected) < 1e-6 * np.linalg.norm(expected)
    tau = found.torque(expected)
    qdd = judges.aba(eom, tau, expected)
    assert np.max(np.abs(eom.A @ qdd - eom.b)) < 1e-6 * max(1.0, np.abs(qdd).max())
    assert np.linalg.norm(tau) <= np.linalg.norm(tau0) * (1 + 1e-9)
    # eq. (25) about τ0, whose torques change by dtau at constant forces
    Q = np.linalg.svd(eom.A, full_matrices=False)
    rows = Q[2][: linear_algebra.rank(eom.A)]
    x = cp.Variable(eom.d)
    effect = rows @ np.linalg.solve(eom.M, eom.S)
    cp.Problem(cp.Minimize(cp.sum_squares(tau0 + x)), [effect @ x == 0]).solve(**TIGHT)
    assert np.allclose(tau, tau0 + x.value, atol=1e-5 * max(1.0, np.abs(tau0).max()))
    if eom.d > eom.k:
        assert np.linalg.norm(tau) < 0.999 * np.linalg.norm(tau0)
    elif name in ("go2", "solo12"):
        assert np.allclose(tau, tau0, atol=1e-6)


@pytest.mark.parametrize("exponent", [3, 5, 7])
def test_torques_for_the_forces_of_standing_stay_what_they_are_near_a_loss_of_rank(exponent):
    """solo8 is nearly symmetric with 0.1 rad/s of noise. Eq. (25) taken literally needs hundreds of
    N·m and more.
    """
    standing, contacts = judges.load("solo8").standing(), fb.Contacts.points(judges.load("solo8"))
    desired = np.tile([0.0, 0.0, standing.robot.weight / 4], 4)
    rng = np.random.default_rng(0)
    near = judges.along(standing, rng.normal(size=14), 10.0**-exponent)
    near = near.replace(v=0.1 * rng.normal(size=14))
    both = [fb.equations_of_motion(state, contacts) for state in (standing, near)]
    there, here = (objectives.torques_from_forces(eom).torque(desired) for eom in both)
    assert np.max(np.abs(here - there)) < 0.3  # N·m


def test_forces_that_solo8_cannot_give_have_a_gap_and_the_nearest_it_can_is_cvxpys():
    rng = np.random.default_rng(0)
    for seed in (None, 0, 1):
        eom = judges.at_rest("solo8", seed)
        found = objectives.torques_from_forces(eom)
        zeta = dynamics.forces_from_torques(eom)
        N = dynamics.undetermined_forces(eom)
        desired = 10.0 * rng.normal(size=12)
        tau, unseen = cp.Variable(8), cp.Variable(N.shape[1])
        reach = zeta.A @ tau + zeta.b + N @ unseen
        cp.Problem(cp.Minimize(cp.sum_squares(reach - desired))).solve(**TIGHT)
        nearest = reach.value
        assert found.distance(desired) > 1.0
        assert found.distance(desired) == pytest.approx(np.linalg.norm(nearest - desired), rel=1e-5)
        assert np.allclose(found.nearest(desired), nearest, atol=1e-4)
        assert found.distance(found.nearest(desired)) < 1e-7
        again = zeta(found.torque(found.nearest(desired)))
        assert np.allclose(eom.J.T @ again, eom.J.T @ found.nearest(desired), atol=1e-5)


@pytest.mark.parametrize("name", ["go2", "anymal_kinova"])
def test_with_three_joints_per_leg_every_force_is_possible(name):
    eom = judges.at_rest(name, 1)
    found = objectives.torques_from_forces(eom)
    desired = 30.0 * np.random.default_rng(0).normal(size=eom.k)
    assert found.distance(desired) < 1e-8
    assert np.allclose(found.nearest(desired), desired, atol=1e-8)
    assert np.allclose(dynamics.forces_from_torques(eom)(found.torque(desired)), desired, atol=1e-6)


def test_torques_for_forces_out_of_reach_leave_the_smallest_contact_acceleration():
    """For d < k, `TorquesFromForces` minimizes ‖J q̈ - b‖ with this λ, and then τ."""
    eom = judges.at_rest("solo8", 0)
    desired = 10.0 * np.random.default_rng(3).normal(size=12)
    x = cp.Variable(8)
    free = np.linalg.solve(eom.M, eom.J.T @ desired - eom.h)
    gap = eom.A @ free + eom.A @ np.linalg.solve(eom.M, eom.S) @ x - eom.b
    cp.Problem(cp.Minimize(cp.sum_squares(gap))).solve(**TIGHT)
    tau = objectives.torques_from_forces(eom).torque(desired)
    left = eom.A @ judges.aba(eom, tau, desired) - eom.b
    assert np.linalg.norm(left) > 1.0
    assert np.linalg.norm(left) == pytest.approx(np.linalg.norm(gap.value), rel=1e-6)


# what does not fit --------------------------------------------------------------------------------


GO2 = judges.load("go2")
STATE, FEET = GO2.standing(), fb.Contacts.points(GO2)
MIXED = FEET + fb.Contacts([fixed_frame("base")])
EOM = fb.equations_of_motion(STATE, FEET)
SPACE = fb.feasible_space(EOM)
NONE = np.zeros(3)


@pytest.mark.parametrize(
    "case",
    [
        (lambda: objectives.com_wrench_map(STATE, MIXED), "bolts of base"),
        (lambda: objectives.wrench_objective(STATE, MIXED, NONE, NONE), "bolts of base"),
        (lambda: objectives.tangential_bias(MIXED), "bolts of base"),
        (lambda: objectives.force_bias(MIXED, 1.0, 0.0), "bolts of base"),
        (lambda: objectives.normal_bias(FEET, [1.0, np.inf, 0.0, 0.0]), "a", np.inf),
        (lambda: objectives.torques_from_forces(EOM).distance(np.zeros(9)), "forces", 9, 12),
        (lambda: objectives.torques_from_forces(EOM).nearest(np.zeros(9)), "forces", 9, 12),
        (
            lambda: objectives.partial_minimum(fb.Quadratic.zero(12), SPACE, "lambda"),
            "lambda", "qdd", "tau", "forces",
        ),
    ],
)  # fmt: skip
def test_bad_input_is_refused_by_name(case):
    call, *named = case
    refused(call, InputError, *named)
