"""Joint limits: viable bounds on q̈, both backends, an independent QP, and stops in MuJoCo."""

from dataclasses import replace

import judges
import numpy as np
import pinocchio as pin
import pytest
from messages import raises

import floatbase as fb
from floatbase.control import JointLimits, Limits, LinearInequality, build_qp
from floatbase.errors import InfeasibleError, InputError
from floatbase.robots import Robot, State

PERIODS = (1e-3, 2e-3, 4e-3)
# of a joint's range: the torques are constant in a control period, the equations are not
OVERSHOOT = 1e-3


def limits_of(n: int, rng: np.random.Generator, **changes: object) -> JointLimits:
    """Return limits of ±1 rad and 5 rad/s, with random braking accelerations."""
    values: dict[str, object] = {
        "lower": -np.ones(n), "upper": np.ones(n), "velocity": np.full(n, 5.0),
        "acceleration": np.full(n, np.inf), "braking": rng.uniform(5.0, 500.0, n),
    }  # fmt: skip
    return JointLimits(**(values | changes))


@pytest.mark.parametrize("dt", PERIODS)
def test_accelerations_within_the_bounds_keep_a_joint_inside_for_ever(dt):
    rng = np.random.default_rng(0)
    limits = limits_of(300, rng)
    q, v, side = rng.uniform(-1.0, 1.0, 300), np.zeros(300), np.ones(300)
    for i in range(2000):
        if i % 200 == 0:
            side = rng.choice([-1.0, 1.0], 300)
        least, largest = limits.bounds(q, v)
        assert np.all(least <= largest)
        qdd = np.clip(1e4 * side * rng.uniform(size=300), least, largest)
        q, v = q + v * dt + 0.5 * qdd * dt**2, v + qdd * dt
        assert np.max(np.abs(q)) < 1.0 + 1e-9 and np.max(np.abs(v)) < 5.0 + 1e-9


def test_the_bounds_forbid_no_motion_that_could_still_stop():
    """At the bound, a joint that brakes from the next period on stops just at its limit."""
    rng = np.random.default_rng(1)
    limits = replace(limits_of(1000, rng), velocity=np.full(1000, np.inf))
    q, v, dt = rng.uniform(-1.0, 1.0, 1000), rng.uniform(0.0, 5.0, 1000), limits.period
    largest = limits.bounds(q, v)[1]
    after = q + v * dt + 0.5 * largest * dt**2, v + largest * dt
    stop = after[0] + np.maximum(after[1], 0.0) ** 2 / (2.0 * limits.braking)
    viable = largest > -limits.braking
    assert np.sum(viable) > 300 and np.allclose(stop[viable], 1.0, atol=1e-9)


def test_a_joint_beyond_its_limit_returns_and_one_at_its_limit_may_rest():
    limits = limits_of(3, np.random.default_rng(2))
    least, largest = limits.bounds([1.0, -1.0, 1.1], [0.0, 0.0, 0.0])
    assert largest[0] == least[1] == 0.0
    assert largest[2] < -limits.braking[2]
    locked = replace(limits, lower=np.ones(3), upper=np.ones(3))
    least, largest = locked.bounds(np.ones(3), np.array([0.0, 1.0, -1.0]))
    assert np.all(least <= largest) and largest[0] == 0.0


def near_limits(robot: Robot, n: int, seed: int = 0) -> list[State]:
    """Return states in which some joints move towards limits that are near."""
    rng, limits, standing = np.random.default_rng(seed), JointLimits.of(robot), robot.standing()
    first, states = robot.nv - robot.d, []
    for _ in range(n):
        q = np.array(standing.q)
        v = 0.05 * rng.choice([1.0, 10.0]) * rng.normal(size=robot.nv)
        for j in rng.choice(np.flatnonzero(np.isfinite(limits.upper)), 3):
            side, gap = rng.choice([-1.0, 1.0]), 0.02 * abs(rng.normal())
            limit = limits.upper[j] if side > 0.0 else limits.lower[j]
            q[robot.nq - robot.d + j] = limit - side * gap
            v[first + j] = side * 2.0 * abs(rng.normal())
        states.append(State(robot, q, v))
    return states


@pytest.mark.parametrize(
    ("name", "weight"), [("go2", None), ("hyq", 1e4), ("solo12", 30.0), ("talos", 30.0)]
)
def test_both_backends_agree_near_limits(name, weight):
    robot = judges.load(name)
    limits = JointLimits.of(robot, weight=weight)
    compiled, reference = judges.pair(robot, judges.stance(robot), joint_limits=limits)
    n_active, n_violated = 0, 0
    for state in near_limits(robot, 8):
        # bounds of 1000 rad/s² beside tasks of 1 rad/s² cost digits
        assert judges.difference(compiled, reference, state) < 1e-6 * robot.torque_limits.max()
        try:
            command, expected = (each(state.q, state.v) for each in (compiled, reference))
        except InfeasibleError:
            continue
        kinds = ("position limit", "velocity limit")
        joints = [row for row in command.active if row.kind.endswith(kinds)]
        n_active += bool(joints)
        assert command.violations == pytest.approx(expected.violations, rel=1e-4, abs=1e-6)
        assert set(command.violations) <= set(joints)
        n_violated += bool(command.violations)
        residuals = command.solution.residuals
        assert max(residuals.inequality, residuals.dual) < 1e-6
    assert n_active > 0
    assert weight is not None or n_violated == 0


def driven(robot: Robot, joint: int, side: float, period: float, **options: object) -> fb.Rollout:
    """Return a run in which a joint of a bolted robot is driven at its stop as fast as it can."""
    limits, target = JointLimits.of(robot), np.array(robot.posture)
    span = limits.upper[joint] - limits.lower[joint]
    target[joint] = (limits.upper if side > 0.0 else limits.lower)[joint] + side * span
    tasks = [fb.PostureTask(target, kp=400.0, kd=40.0)]
    controller = fb.WholeBodyController(robot, fb.Contacts.none(), tasks, **options)
    return fb.rollout(fb.Simulation(robot), controller, 0.8, control_period=period)


@pytest.mark.parametrize(
    ("name", "joints"), [("go2", (0, 1, 2)), ("solo12", (1, 5)), ("talos", (3, 9, 15, 21))]
)
def test_no_joint_passes_its_limit_in_mujoco(name, joints):
    floating = judges.load(name)
    robot = fb.load_urdf(
        floating.urdf, name=name, floating=False, package_dirs=floating.package_dirs,
        posture=floating.posture[7:], torque_limits=floating.torque_limits,
    )  # fmt: skip
    limits = JointLimits.of(robot)
    span, fastest = limits.upper - limits.lower, 0.0
    for i, joint in enumerate(joints):
        for side in (1.0, -1.0):
            run = driven(robot, joint, side, PERIODS[i % 3])
            assert run.outcome == "completed"
            beyond = np.maximum(run.q - limits.upper, limits.lower - run.q)[:, joint]
            assert np.max(beyond) < OVERSHOOT * span[joint]
            speed = np.max(np.abs(run.v[:, joint]))
            assert speed < (1.0 + 2.0 * OVERSHOOT) * limits.velocity[joint]
            fastest = max(fastest, float(np.max(np.abs(run.v[:, joint]))))
    assert fastest > 1.0
    run = driven(robot, joints[-1], 1.0, 1e-3, joint_limits=None)
    beyond = np.max(run.q[:, joints[-1]]) - limits.upper[joints[-1]]
    speed = np.max(np.abs(run.v[:, joints[-1]]))
    assert beyond > OVERSHOOT * span[joints[-1]] or speed > limits.velocity[joints[-1]]


def test_active_limits_are_named_for_joint_kind_and_side(go2):
    joint = go2.joint_names.index("FL_calf_joint")
    limits = JointLimits.of(go2, weight=None)
    free = fb.Contacts.none()
    for kind, q, v, changes in (
        ("position", limits.upper[joint] - 1e-4, 0.0, {}),
        ("velocity", -1.5, limits.velocity[joint], {}),
        ("acceleration", -1.5, 0.0, {"acceleration": np.full(12, 20.0)}),
    ):
        state = go2.standing()
        configuration, speeds = np.array(state.q), np.zeros(go2.nv)
        configuration[7 + joint], speeds[6 + joint] = q, v
        target = np.array(configuration)
        target[7 + joint] += 1.0
        task = fb.PostureTask(target, kp=900.0, kd=0.0)
        changed = replace(limits, **changes)
        controller = fb.WholeBodyController(go2, free, [task], joint_limits=changed)
        active = controller(configuration, speeds).active
        row = next(row for row in active if row.owner == "FL_calf_joint")
        assert row == f"FL_calf_joint {kind} upper" and row.kind == f"upper {kind} limit"


# soft ---------------------------------------------------------------------------------------------


def test_impossible_soft_constraints_are_violated_and_named(backend, go2, standing):
    """An impossible inequality, a squeezed force and a joint beyond its limit, all at once."""
    q = np.array(standing.q)
    at = 7 + go2.joint_names.index("FL_calf_joint")
    q[at] = JointLimits.of(go2).upper[at - 7] + 0.01
    rise = LinearInequality("rise", "qdd", (-np.eye(go2.nv)[2:3], [-200.0]))
    squeeze = {"min_normal_force": 60.0, "max_normal_force": 40.0}
    options = {"inequalities": [rise], "backend": backend, **squeeze}
    limits = JointLimits.of(go2, weight=None)
    hard = judges.controller_of("go2", joint_limits=limits, **options)
    with pytest.raises(InfeasibleError):
        hard(q, standing.v)
    soft = judges.controller_of("go2", on_infeasible="soften", **options)
    command = soft(q, standing.v)
    assert command.softened and "rise" in command.violations
    for foot in soft.contacts.names:  # at most 40 N and at least 60 N
        amounts = [x for name, x in command.violations.items() if name.endswith(foot)]
        assert sum(amounts) == pytest.approx(20.0, abs=1e-6)
    least, largest = soft.limits.joint_limits.bounds(q[7:], np.zeros(go2.d))
    violated = (command.qdd[6:] > largest + 1e-6) | (command.qdd[6:] < least - 1e-6)
    named = {name.owner for name in command.violations if name.owner in go2.joint_names}
    assert named == {go2.joint_names[i] for i in np.flatnonzero(violated)}
    assert np.all(np.abs(command.tau) <= go2.torque_limits + 1e-6)
    eom = fb.equations_of_motion(State(go2, q), judges.stance(go2))
    assert np.allclose(eom.A @ command.qdd, eom.b, atol=1e-6)  # the contacts still hold


def test_a_soft_force_bound_holds_while_it_can(go2):
    standing, contacts = go2.standing(), judges.stance(go2)
    bounds = {"FL_foot": lambda t: 10.0 + 500.0 * t}
    options = {"max_normal_force": {"FR_foot": 5.0}, "min_normal_force": bounds}
    for controller in judges.pair(go2, contacts, normal_force_weight=1e3, **options):
        for t, holds in ((0.0, True), (1.0, False)):
            command = controller(standing.q, standing.v, t)
            force = command.force("FL_foot")[2]
            assert (force >= 10.0 + 500.0 * t - 1e-6) == holds
            assert bool(command.violations) == (not holds)
            if not holds:
                name = next(name for name in command.violations if "FL_foot" in name)
                assert command.violations[name] == pytest.approx(510.0 - force, abs=1e-6)


def test_limits_are_the_robots_by_default_and_can_be_off(go2):
    default = judges.controller_of("go2")
    assert np.array_equal(default.limits.joint_limits.upper, go2.model.upperPositionLimit[7:])
    kinds = {name.kind for name in default.qp(go2.standing()).inequality_names}
    assert "upper position limit" in kinds
    off = judges.controller_of("go2", joint_limits=None)
    assert off.limits.joint_limits is None
    kinds = {name.kind for name in off.qp(go2.standing()).inequality_names}
    assert not kinds & {"upper position limit", "lower velocity limit"}


def test_braking_follows_the_torque_limits_of_the_controller(go2):
    weak = judges.controller_of("go2", torque_limits=2.0).limits.joint_limits
    assert np.array_equal(weak.braking, JointLimits.of(go2, torque_limits=2.0).braking)
    posture = np.array(go2.posture)
    inertia = pin.crba(go2.model, go2.model.createData(), posture).diagonal()[6:]
    assert np.allclose(weak.braking, np.minimum(0.5 * 2.0 / inertia, 300.0))
    limits = Limits.of(go2, torque_limits=2.0, facets=8)
    assert limits.facets == 8 and np.array_equal(limits.joint_limits.braking, weak.braking)
    assert np.array_equal(limits.torque_limits, np.full(go2.d, 2.0))
    assert Limits.of(go2, joint_limits=None).joint_limits is None
    with raises(InputError, "joint_limits", "Limits.of"):
        Limits(go2.torque_limits, joint_limits="robot")


def test_soft_bounds_have_rows_only_where_there_are_bounds(go2):
    for bounds, rows in (
        ({}, set()),
        ({"min_normal_force": {"FL_foot": 0.0, "FR_foot": 5.0}}, {"smallest FR_foot"}),
        ({"max_normal_force": {"FL_foot": 0.0}}, {"largest FL_foot"}),
        ({"min_normal_force": {"RL_foot": lambda t: 0.0}}, {"smallest RL_foot"}),
    ):
        both = judges.pair(go2, judges.stance(go2), normal_force_weight=10.0, **bounds)
        qp = both[0].qp(go2.standing())
        names = {name for name in qp.inequality_names if name.startswith("soft normal force")}
        assert names == {f"soft normal force {row}" for row in rows}
        assert judges.difference(*both, go2.standing()) < judges.agreement(go2)


def test_a_saturated_row_of_large_weight_leaves_no_rounding_behind(go2):
    """Rows of weight 1e8 that are violated only during the search leave their penalty behind."""
    rng = np.random.default_rng(4)
    for _ in range(10):
        G, h = rng.normal(size=(6, go2.nv)), rng.normal(0.0, 20.0, 6)
        rows = LinearInequality("heavy", "qdd", (G, h), weight=1e8)
        light = LinearInequality("light", "qdd", (-G[:3], 5.0 - h[:3]), weight=1.0)
        both = judges.pair(go2, judges.stance(go2), inequalities=[rows, light])
        state = go2.random_state(int(rng.integers(1000)), 0.1)
        assert judges.difference(*both, state) < 1e-6 * go2.torque_limits.max()


def test_another_solver_finds_the_torques_beyond_a_soft_limit_from_the_arrays_of_the_problem(go2):
    cp = pytest.importorskip("cvxpy")
    state, limits = go2.standing(), JointLimits.of(go2)
    upper = np.array(limits.upper)
    upper[2] = state.q[9] - 0.1
    controller = judges.controller_of("go2", joint_limits=replace(limits, upper=upper))

    def torques(qp: fb.QP) -> np.ndarray:
        """Return the torques that Clarabel finds for the arrays of a problem."""
        x = cp.Variable(qp.n)
        cost = 0.5 * cp.quad_form(x, cp.psd_wrap(qp.H)) + qp.g @ x
        accuracy = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-11)
        problem = cp.Problem(cp.Minimize(cost), [qp.A @ x == qp.b, qp.G @ x <= qp.h])
        problem.solve("CLARABEL", **accuracy)
        return x.value[qp.blocks["tau"]]

    eom = fb.equations_of_motion(state, controller.contacts)
    command, small = controller(state.q, state.v), controller.qp(state, slacks=False)
    assert command.violations and np.max(np.abs(torques(small) - command.tau)) > 10.0
    built = build_qp(eom, controller.tasks, controller.limits)
    for qp in (controller.qp(state), controller.problem.qp(state), built, small.with_slacks()):
        assert np.allclose(torques(qp), command.tau, rtol=0.0, atol=0.1)
    levels = controller.replace(tasks=[controller.tasks[:1], controller.tasks[1:]])
    assert np.allclose(torques(levels.qp(state)), levels(state.q, state.v).tau, atol=0.1)


def test_joint_limits_that_do_not_fit_are_refused():
    limits = limits_of(3, np.random.default_rng(0))
    with raises(InputError, "joint limits", "3", "12"):
        judges.controller_of("go2", joint_limits=limits)
    with raises(InputError, "joint_limits"):
        judges.controller_of("go2", joint_limits="all")
    for changes in (
        {"lower": 2.0 * np.ones(3)}, {"velocity": [1.0, 0.0, 1.0]}, {"braking": [np.inf] * 3},
        {"upper": np.ones(2)}, {"upper": [np.nan] * 3}, {"period": 0.0}, {"weight": -1.0},
    ):  # fmt: skip
        with pytest.raises(InputError):
            replace(limits, **changes)
