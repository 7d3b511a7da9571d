"""The compiled backend against the reference backend: same torques, verdicts and messages."""

from dataclasses import replace
from typing import Any

import judges
import numpy as np
import pinocchio as pin
import pytest
from messages import missing, raises

import floatbase as fb
from floatbase.control import LinearInequality, capture_point_inequality
from floatbase.control.tick import CompiledTick
from floatbase.dynamics import (
    CONSTRAINT_RANK_TOLERANCE,
    RollingWheel,
    fixed_frame,
    moving_frame,
    rigid_between,
)
from floatbase.errors import InfeasibleError, InputError
from floatbase.linear_algebra import null_space
from floatbase.objectives import (
    AngularMomentumTask,
    AxisTask,
    CentreOfPressureTask,
    RelativePoseTask,
)
from floatbase.qp import FEASIBILITY_TOLERANCE, Solution

# N·m between the backends if contact rows are dependent: the reference backend has no more digits
DEPENDENT = 1e-6
# N·m between the backends: both keep eight digits of the strongest motor's limit on
# well-conditioned contacts
TORQUE = 1e-8


def prove_optimal(solution: Solution) -> None:
    """Check the optimality conditions of a convex problem, relative to the terms of their sums.

    They prove that the answer is the optimum.
    """
    qp, x, mu = solution.qp, solution.x, solution.inequality_multipliers
    residuals = solution.residuals
    slopes = (qp.H @ x, qp.g, qp.A.T @ solution.equality_multipliers, qp.G.T @ mu)
    forces = (np.abs(qp.A) @ np.abs(x), np.abs(qp.b))
    costs = (mu * qp.h, mu * (np.abs(qp.G) @ np.abs(x)))
    assert residuals.stationarity <= ROUNDING * largest(*slopes)
    assert residuals.equality <= ROUNDING * largest(*forces)
    assert residuals.complementarity <= ROUNDING * largest(*costs)
    assert residuals.inequality <= 2.0 * FEASIBILITY_TOLERANCE * np.max(qp.row_norms)
    assert residuals.dual == 0.0


def prove_all(controller: fb.WholeBodyController, states: list[fb.State]) -> None:
    """Apply `prove_optimal` at all states except infeasible ones, of which there may be a few."""
    proved = 0
    for state in states:
        try:
            command = controller(state.q, state.v)
        except InfeasibleError:
            continue
        prove_optimal(command.solution)
        proved += 1
    assert proved > 0.5 * len(states)


def largest(*terms: np.ndarray) -> float:
    return max(1.0, *(float(np.max(np.abs(term), initial=0.0)) for term in terms))


# rounding of a sum, as a fraction of its terms, through a Cholesky factor of condition 1e7
ROUNDING = 1e-9


# the same answer ----------------------------------------------------------------------------------


GO2, TALOS = judges.load("go2"), judges.load("talos")
SOLES, POINTS = fb.Contacts.flat_feet(TALOS), fb.Contacts.points(TALOS)
LEFT, RIGHT = SOLES.only("left_sole_link"), POINTS.only("right_sole_link")
WEAK = [
    *fb.standing_tasks(TALOS.standing()), fb.ForceTask(weight=1e-8), fb.TorqueTask(weight=0.0),
]  # fmt: skip


def feet(n: int) -> fb.Contacts:
    return fb.Contacts.points(GO2, frames=[foot.frame for foot in GO2.feet][:n])


def facets(n: int, inner_approximation: bool) -> tuple[Any, ...]:
    """Return a problem of go2 on ground that is tilted at each foot."""
    tilted = fb.Contacts.points(GO2, mu=0.4, normals=judges.random_normals(4, n))
    options = {"inner_approximation": inner_approximation, "min_normal_force": 2.0}
    return "go2", 4, TORQUE, tilted, None, options | {"facets": n, "facet_rotation": 0.3 * n}


def limited(joints: slice, limit: float) -> tuple[Any, ...]:
    limits = np.full(12, np.inf)
    limits[joints] = limit
    return "go2", 6, TORQUE, None, None, {"torque_limits": limits}


# robot, number of states, bound [N·m], contacts, tasks and options of the controller
PROBLEMS: dict[str, tuple[Any, ...]] = {
    **{name: (name, 20, TORQUE) for name in judges.ROBOTS if name != "solo8"},
    "contact rows of rank 11": ("solo8", 15, DEPENDENT),
    # corner forces are nearly undetermined: DAQP alone ends 1e-6 N·m from the optimum
    "weights of 1e-8": ("talos", 5, 1e-7, SOLES, WEAK, {"inner_approximation": False}),
    **{f"{n} feet": ("go2", 4, TORQUE, feet(n)) for n in (1, 2, 3)},
    "one sole": ("talos", 3, TORQUE, LEFT),
    "two points": ("talos", 3, TORQUE, POINTS),
    "a sole and a point": ("talos", 3, TORQUE, LEFT + RIGHT),
    "no contact": ("talos", 3, TORQUE, fb.Contacts.none()),
    **{f"{n} inner facets": facets(n, True) for n in (3, 5, 8, 16, 64)},
    **{f"{n} outer facets": facets(n, False) for n in (3, 5, 8, 16, 64)},
    **{f"torque limits of {x} N·m": limited(slice(None), x) for x in (3.0, 12.0, np.inf)},
    **{f"some torque limits of {x} N·m": limited(slice(0, 12, 3), x) for x in (3.0, 12.0)},
}  # fmt: skip


@pytest.mark.parametrize("label", PROBLEMS)
def test_a_compiled_tick_gives_the_torques_of_the_reference_backend(label):
    name, n, bound, contacts, tasks, options = (*PROBLEMS[label], None, None, None)[:6]
    robot, at = judges.load(name), judges.near_and_far(name, n)
    if contacts is None:
        contacts = judges.stance(robot)
    both = judges.pair(robot, contacts, tasks, **(options or {}))
    assert judges.largest_difference(both, at) < bound
    if name == "solo8":
        prove_all(both[0], at)


def resolution(robot: fb.Robot, contacts: fb.Contacts, q: np.ndarray) -> float:
    """Return the smallest singular value of A in (5), relative to the largest."""
    eom = fb.equations_of_motion(fb.State(robot, q, np.zeros(robot.nv)), contacts)
    s = np.linalg.svd(eom.A, compute_uv=False)
    return float(s[-1] / s[0])


def with_resolution(state: fb.State, contacts: fb.Contacts, value: float) -> fb.State:
    """Return the state with this `resolution` on the line from standing through `state`.

    A loses rank at standing.
    """
    robot, low, high = state.robot, 0.0, 1.0
    away = pin.difference(robot.model, robot.standing().q, state.q)

    def at(step: float) -> np.ndarray:
        return pin.integrate(robot.model, robot.standing().q, step * away)

    while resolution(robot, contacts, at(high)) < value:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = resolution(robot, contacts, at(middle)) < value
        low, high = (middle, high) if below else (low, middle)
    assert resolution(robot, contacts, at(high)) == pytest.approx(value, rel=1e-6)
    return fb.State(robot, at(high), state.v)


@pytest.mark.parametrize("share", [0.03, 0.3, 0.99, 1.01, 3.0])
def test_where_contact_rows_nearly_repeat_each_other_the_same_directions_count(share):
    """solo8 on three feet: the smallest singular value of A on either side of the tolerance.

    The tolerance is CONSTRAINT_RANK_TOLERANCE.
    """
    robot = judges.load("solo8")
    contacts = fb.Contacts.points(robot).without(robot.feet[3].frame)
    both = judges.pair(robot, contacts)
    value = share * CONSTRAINT_RANK_TOLERANCE
    states = [with_resolution(state, contacts, value) for state in judges.states("solo8", 5, 0.1)]
    assert judges.largest_difference(both, states) < DEPENDENT
    prove_all(both[0], states)


@pytest.mark.parametrize("bend", [0.0, 1e-7, 1e-5, 1e-3, 1e-2, 0.1])
def test_straight_knees(bend, go2):
    both = judges.pair(go2, judges.stance(go2))
    for seed, state in enumerate(judges.states("go2", 4, 0.05)):
        q = np.array(state.q)
        q[9::3] = bend
        straight = fb.State(go2, q, np.zeros(go2.nv) if seed % 2 else state.v)
        expected = both[1](straight.q, straight.v).tau
        found = both[0](straight.q, straight.v).tau
        assert np.max(np.abs(found - expected)) < 1e-7 * (1.0 + np.max(np.abs(expected)))


def test_every_task_with_targets_that_move(go2):
    at, ramp = go2.standing(), np.linspace(-1.0, 1.0, 12)
    foot = at.point("FL_foot") + [0.0, 0.0, 0.05]

    def rising(t: float) -> tuple[object, ...]:
        return at.com + [0.0, 0.0, 0.01 * t], [0.0, 0.0, 0.01], [0.0, 0.2, t]

    def turning(t: float) -> tuple[object, ...]:
        return judges.rotation([0.1 * t, 0.0, 0.2]), [0.1, 0.0, 0.0], [0.0, t, 0.0]

    tasks = [
        fb.CoMTask(rising, kp=50.0, kd=3.0, weight=4.0),
        fb.OrientationTask("base", turning),
        fb.OrientationTask("FL_calf", judges.rotation([0.3, 0.1, 0.0]), weight=0.3),
        fb.FrameTask("FL_foot", lambda t: np.array([foot, np.zeros(3), [0.0, t, 1.0]]), weight=3.0),
        fb.FrameTask("FL_calf", at.point("FL_calf"), [0.1, 0.0, 0.2], [0.0, 1.0, 0.0]),
        fb.PostureTask(lambda t: (at.q, t * ramp, ramp), weight=0.2),
        fb.PostureTask(lambda t: at.q, weight=0.02),
        fb.PostureTask(at.q, 1.5 + 0.5 * ramp, np.ones(12), kp=3.0, weight=0.1, name="soft"),
        fb.ForceTask(lambda t: np.full(9, 10.0 + t), weight=1e-4),
        fb.TorqueTask(np.ones(12), weight=1e-3),
    ]
    both = judges.pair(go2, judges.stance(go2).without("FL_foot"), tasks)
    for t, state in enumerate(judges.near_and_far("go2", 4)):
        assert judges.difference(*both, state, 0.3 * t) < TORQUE


LINK = """<link name="{}"><inertial><mass value="1"/><origin xyz="0.1 0 0.2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""


def test_joints_without_limits_and_bases_that_are_bolted_down(tmp_path):
    """A continuous joint is (cos, sin) in q."""
    links = "".join(LINK.format(f"l{i}") for i in range(3))
    joints = "".join(
        f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/><origin '
        f'xyz="0 0 0.3"/>'
        f'<axis xyz="{axis}"/><limit effort="50" velocity="9" lower="-3" upper="3"/></joint>'
        for i, (kind, axis) in enumerate([("continuous", "0 1 0"), ("prismatic", "0.6 0 0.8")])
    )
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(f'<robot name="arm">{links}{joints}</robot>')
    robot = fb.load_urdf(urdf, floating=False)
    target = [np.cos(2.9), np.sin(2.9), 0.1]
    others = [fb.FrameTask("l2", [0.1, 0.0, 0.4]), fb.CoMTask([0.0, 0.0, 0.3])]
    both = judges.pair(robot, fb.Contacts.none(), [fb.PostureTask(target), *others])
    for seed in range(5):
        assert judges.difference(*both, robot.random_state(seed, 0.8)) < TORQUE
    for controller in both:
        with raises(InputError, "q", "j0", 2):
            controller([2.0, 0.0, 0.1], np.zeros(2))
    tasks = [fb.PostureTask(lambda t: [1.0 + t * (t > 0.1), 0.0, 0.1]), *others]
    for controller in judges.pair(robot, fb.Contacts.none(), tasks):
        assert controller(robot.posture, np.zeros(2), 0.0).backend == controller.backend
        with raises(InputError, "q", "j0", 1.5):
            controller(robot.posture, np.zeros(2), 0.5)
    beyond = [fb.PostureTask([2.0, 0.0, 0.1])]
    with raises(InputError, "q", "j0", 2):
        fb.WholeBodyController(robot, fb.Contacts.none(), beyond, backend="compiled")


def test_a_single_joint_is_enough(tmp_path):
    """Pinocchio's Jacobians of one joint have one dimension fewer."""
    urdf = tmp_path / "pendulum.urdf"
    urdf.write_text(
        f'<robot name="pendulum">{LINK.format("wall")}{LINK.format("bob")}'
        '<joint name="pin" type="revolute"><parent link="wall"/><child link="bob"/><axis xyz="0 1 '
        '0"/>'
        '<limit effort="50" velocity="9" lower="-3" upper="3"/></joint></robot>'
    )
    robot = fb.load_urdf(urdf, floating=False)
    tasks = [fb.CoMTask([0.1, 0.0, 0.2]), fb.FrameTask("bob", np.zeros(3))]
    tasks += [fb.OrientationTask("bob"), fb.PostureTask([0.0]), fb.TorqueTask(weight=0.0)]
    state, both = robot.random_state(0, 0.5), judges.pair(robot, fb.Contacts.none(), tasks)
    assert judges.difference(*both, state) < TORQUE
    assert state.com_jacobian.shape == (3, 1) and state.frame_jacobian("bob").shape == (6, 1)
    command = both[0](state.q, state.v)
    assert command.tau == pytest.approx(state.M @ command.qdd + state.h)


# the same verdicts and messages -------------------------------------------------------------------


def test_infeasible_problems_are_reported_by_both_with_the_same_rows():
    """The motors cannot push with ten times the robot's weight at each leg."""
    robot = judges.load("solo12")
    both = judges.pair(robot, judges.stance(robot), min_normal_force=10.0 * 9.81 * robot.mass)
    for state in judges.near_and_far("solo12", 4):
        assert judges.difference(*both, state) == 0.0
        with pytest.raises(InfeasibleError):
            both[0](state.q, state.v)


class Entries:
    """A user-defined task that leaves nearly all of its block open."""

    weight = 1e-4

    def __init__(self, block, rows):
        self.block, self.name, self.rows = block, block, rows

    def residual(self, eom, t=0.0):
        return fb.Affine(self.rows, np.ones(len(self.rows)))


@pytest.mark.parametrize("robot", ["go2", "solo12"], indirect=True)
def test_rows_with_hardly_any_curvature_are_no_conflict(robot):
    """The rows of forces that are nearly undetermined seem to depend on one another."""
    open_tasks = [Entries("forces", np.ones((1, 9))), Entries("tau", np.eye(12)[:2])]
    controller = fb.WholeBodyController(
        robot,
        fb.Contacts.points(robot).without(robot.feet[3].frame),
        [*fb.standing_tasks(robot.standing()), *open_tasks],
        torque_limits=0.3 * robot.torque_limits,
    )
    for state in judges.near_and_far(robot.name, 8):
        if controller.attempt(state.q, state.v) is None:
            with pytest.raises(InfeasibleError):
                controller(state.q, state.v)


def test_motion_rows_that_disagree_while_the_feet_rest_are_left_to_the_reference_backend():
    """solo8 on four feet: J allows a velocity to first order, but its curvature J̇ v forbids it."""
    robot = judges.load("solo8")
    compiled, reference = judges.pair(robot, judges.stance(robot))
    state = robot.standing()
    motions = null_space(fb.equations_of_motion(state, compiled.contacts).A)
    v = motions @ motions.T[:, 3]  # the base rolls as far as the feet allow
    assert compiled.compiled(np.array(state.q), 1e-3 * v, 0.0) is not None
    assert compiled.compiled(np.array(state.q), 10.0 * v, 0.0) is None
    assert judges.difference(compiled, reference, state.replace(v=10.0 * v)) == 0.0
    with raises(InfeasibleError, "motion FL_FOOT y"):
        compiled(state.q, 10.0 * v)


@pytest.mark.parametrize(
    ("q", "v"),
    [
        (np.zeros(3), np.zeros(18)),
        ("nonsense", np.zeros(18)),
        (np.zeros(19), np.zeros(18)),
        (np.full(19, np.nan), np.zeros(18)),
        (None, np.full(18, np.inf)),
        (None, [1.0]),
    ],
)
def test_a_bad_state_is_refused_in_the_same_words(q, v, go2):
    compiled, reference = judges.pair(go2, judges.stance(go2))
    q = go2.standing().q if q is None else q
    assert refusal(compiled, q, v) == refusal(reference, q, v)


def refusal(controller: fb.WholeBodyController, *given: object) -> str:
    with pytest.raises(InputError) as caught:
        controller(*given)
    return str(caught.value)


@pytest.mark.parametrize("target", [[1.0, 2.0], [np.nan, 0.0, 0.0], "there"])
def test_a_bad_target_is_refused_in_the_same_words(target, go2):
    state = go2.standing()
    moving = fb.CoMTask(lambda t: target if t > 0 else state.com)
    compiled, reference = judges.pair(go2, judges.stance(go2), [moving])
    assert refusal(compiled, state.q, state.v, 1.0) == refusal(reference, state.q, state.v, 1.0)


# solutions ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["go2", "talos"], indirect=True)
def test_a_compiled_answer_proves_itself_on_the_reference_problem(robot):
    """All joints but one are limited to nine tenths of the largest torque that they would need."""
    free, _ = judges.pair(robot, judges.stance(robot), torque_limits=np.inf)
    limited = np.arange(robot.d) != 4
    torques = [free(state.q, state.v).tau[limited] for state in judges.near_and_far(robot.name, 6)]
    limit = 0.9 * np.max(np.abs(torques))
    both = judges.pair(robot, judges.stance(robot), torque_limits=np.where(limited, limit, np.inf))
    kinds = set()
    for state in judges.near_and_far(robot.name, 6):
        found, expected = (controller(state.q, state.v) for controller in both)
        r = found.solution.residuals
        assert max(r.stationarity, r.equality, r.inequality, r.complementarity) < 1e-6
        assert r.dual == 0.0
        assert found.solution.objective == pytest.approx(expected.solution.objective, rel=1e-9)
        assert np.allclose(found.solution["forces"], found.forces)
        # a flat foot's four corners share one wrench: rows can be dependent
        if robot.name == "go2":
            assert set(found.active) == set(expected.active)
            for row, multiplier in expected.multipliers.items():
                assert found.multipliers[row] == pytest.approx(multiplier, rel=1e-5, abs=1e-7)
        kinds |= {row.split()[0] for row in found.active}
    assert "torque" in kinds


def test_a_command_keeps_its_numbers_when_the_state_moves_on(go2):
    controller, reference = judges.pair(go2, judges.stance(go2))
    state, other = judges.states("go2", 2)
    q, v = np.array(state.q), np.array(state.v)
    command = controller(q, v)
    tau = command.tau.copy()
    q[:], v[:] = other.q, other.v
    controller(q, v)
    assert np.array_equal(command.tau, tau)
    assert np.allclose(command.solution.qp.H, reference.qp(state, slacks=False).H)


# tasks --------------------------------------------------------------------------------------------


def moving_tasks(robot: fb.Robot) -> dict[str, Any]:
    """Return tasks with moving targets, on frames that move on their own and on fixed ones."""
    foot, other = robot.feet[0].frame, robot.feet[-1].frame
    pose, turned = np.eye(4), judges.rotation([0.3, -0.2, 0.5])
    pose[:3, :3], pose[:3, 3] = turned, (0.1, 0.2, -0.3)
    rates = np.linspace(-0.5, 1.0, 6)
    return {
        "relative": RelativePoseTask(foot, other, lambda t: (pose, t * rates, 2.0 * rates)),
        "relative to the base": RelativePoseTask(other, "base", pose, weight=3.0, kd=7.0),
        "axis": AxisTask(foot, [0.2, 0.3, 1.0], lambda t: ([t, 0.4, 2.0], rates[:3], rates[3:])),
        "axis on target": AxisTask("base", [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]),
        "momentum": AngularMomentumTask(lambda t: (t * rates[:3], rates[3:]), kd=3.0),
        "pressure": CentreOfPressureTask(lambda t: [*robot.standing().com[:2], 0.1 * t]),
    }


@pytest.mark.parametrize("robot", ["go2", "g1", "talos"], indirect=True)
def test_tasks_on_axes_relative_poses_and_momentum_are_compiled(robot):
    standing, added = fb.standing_tasks(robot.standing()), moving_tasks(robot)
    bound = 0.1 * judges.agreement(robot)  # 1e-9 of the strongest motor's limit
    for tasks in (*([task] for task in added.values()), added.values()):
        both = judges.pair(robot, judges.stance(robot), [*standing, *tasks])
        assert not both[0].compiled.user_terms.any
        assert judges.largest_difference(both, judges.states(robot.name, 3, 0.1), t=0.4) < bound


def added_terms(robot: fb.Robot) -> dict[str, tuple[fb.Contacts, dict[str, Any]]]:
    """Return contacts and options of a controller: each kind of constraint and inequality."""
    feet, first = fb.Contacts.feet(robot), robot.feet[0].frame
    others, joints = feet.without(first), np.eye(robot.nv)[-4:]
    sides = LinearInequality("sides", "qdd", (np.vstack([joints, -joints]), np.ones(8)), weight=2.0)
    rise = LinearInequality("rise", "tau", (np.eye(robot.d)[:3], np.full(3, 0.5)), weight=1.0)
    load = LinearInequality("load", "forces", (np.ones((1, feet.k)), [robot.weight]), weight=10.0)
    capture = [capture_point_inequality(0.03, 0.05, str(w), weight=w) for w in (50.0, 2.0)]
    wheels = [
        RollingWheel(
            foot.frame, [0.1 * i, 1.0, 0.2], 0.05, [0.1, 0.05, 1.0], centre=[0.0, 0.1, 0.2]
        )
        for i, foot in enumerate(robot.feet)
    ]
    drive = fb.Contacts([moving_frame(first, lambda t: np.array([0.1, 0.2, t]))])
    return {
        "hard rows": (feet, {"inequalities": [replace(sides, weight=None)]}),
        "soft rows": (feet, {"inequalities": [rise, capture[0], load, sides, capture[1]]}),
        "soft normal forces": (feet, {"min_normal_force": 20.0, "normal_force_weight": 3.0}),
        "soft contacts": (feet, {"contact_weight": 1e3, "inequalities": capture}),
        "fixed frame": (fb.Contacts([fixed_frame("base")]) + feet, {}),
        "driven frame": (drive + others, {"inequalities": capture}),
        "connection": (fb.Contacts([rigid_between(first, robot.feet[1].frame)]), {}),
        "moving ground": (
            fb.Contacts.feet(robot, acceleration=lambda t: np.array([0.1, t, 0.2])),
            {"inequalities": capture},
        ),
        "wheels": (fb.Contacts(wheels), {"inequalities": capture if len(wheels) > 2 else []}),
    }


@pytest.mark.parametrize("robot", ["go2", "talos"], indirect=True)
def test_constraints_and_inequalities_of_the_package_are_compiled(robot):
    bound, active = 0.1 * judges.agreement(robot), set()
    tasks = [*fb.standing_tasks(robot.standing()), *moving_tasks(robot).values()]
    for contacts, options in added_terms(robot).values():
        both = judges.pair(robot, contacts, tasks, **options)
        *_, python = both[0].backend_reason.partition("beside it: ")
        assert all(each.startswith("the target of ") for each in python.split(", "))
        for state in (*judges.states(robot.name, 2, 0.1), robot.standing()):
            one, other = (each(state.q, state.v, 0.4) for each in both)
            assert one.backend == "compiled"
            assert np.max(np.abs(one.tau - other.tau)) < bound
            assert one.solution.qp.inequality_names == other.solution.qp.inequality_names
            prove_optimal(one.solution)
            active |= {row.owner for row in one.active}
    assert {"sides", "rise", "2.0"} <= active


def test_a_wheel_on_its_side_and_a_robot_on_its_back_are_refused_in_the_same_words(go2):
    wheel = fb.Contacts([RollingWheel("FL_foot", [0.0, 1.0, 0.0], 0.05)])
    for contacts, rows, turn in (
        (wheel, [], [1.0, 0.0, 0.0, 1.0]),
        (fb.Contacts.feet(go2), [capture_point_inequality()], [1.0, 0.0, 0.0, 0.0]),
    ):
        q = np.concatenate([np.zeros(3), turn / np.linalg.norm(turn), np.zeros(12)])
        both = judges.pair(go2, contacts, inequalities=rows)
        assert len({refusal(each, q, np.zeros(18)) for each in both}) == 1


@pytest.mark.parametrize(("entry", "change"), [(12, 1e-3), (15, 1e-3), (15, 1e-7), (13, 1e-12)])
def test_the_last_row_of_a_pose_among_raw_targets_counts_on_both_backends(entry, change):
    robot, state = judges.load("go2"), judges.load("go2").standing()
    task = RelativePoseTask("FL_foot", "FR_foot", np.eye(4))
    both = judges.pair(robot, judges.stance(robot), [*fb.standing_tasks(state), task])
    targets = both[0].targets_at(0.0)
    targets[both[0].targets[task.name].start + entry] += change
    if change > 1e-6:
        assert len({refusal(each, state.q, state.v, 0.0, targets) for each in both}) == 1
    else:
        one, other = (each(state.q, state.v, 0.0, targets).tau for each in both)
        assert np.allclose(one, other, rtol=0.0, atol=judges.agreement(robot))


def test_an_axis_opposite_to_its_direction_and_directions_of_any_length_have_answers():
    robot, state = judges.load("go2"), judges.load("go2").standing()
    axis = state.frame_pose("base").rotation.T @ [0.0, 0.0, 1.0]
    tasks = [*fb.standing_tasks(state), AxisTask("base", axis, [0.0, 0.0, -1.0])]
    both = judges.pair(robot, judges.stance(robot), tasks)
    one, other = (each(state.q, state.v) for each in both)
    assert np.allclose(one.tau, other.tau, rtol=0.0, atol=judges.agreement(robot))
    targets, bound = both[0].targets_at(0.0), judges.agreement(robot)
    for direction in ([0.0, 3.0, 4.0], [1e-3, 0.0, 1e-3]):
        targets[both[0].targets["axis of base"]][:3] = direction
        one, other = (each(state.q, state.v, 0.0, targets) for each in both)
        assert np.allclose(one.tau, other.tau, rtol=0.0, atol=bound)


# which backend runs -------------------------------------------------------------------------------


def test_the_reason_of_the_backend_names_what_runs_as_python():
    robot, rows = judges.load("go2"), (np.eye(12), np.full(12, 1e3))
    mine = LinearInequality("mine", "tau", lambda eom, t: rows)
    others = [LinearInequality("constant", "tau", rows), capture_point_inequality()]
    compiled = judges.pair(robot, judges.stance(robot), inequalities=[*others, mine])[0]
    assert compiled.backend_reason.endswith("Python beside it: mine")
    com, *rest = fb.standing_tasks(robot.standing())
    circling = fb.CoMTask(lambda t: com.position)
    tasks = compiled.replace(inequalities=others, tasks=[circling, *rest])
    assert tasks.backend_reason.endswith(f"beside it: the target of {com.name}")


def test_another_solver_uses_the_reference_backend_and_the_reason_names_the_solver():
    controller = judges.controller_of("go2", solver="cvxpy")
    assert controller.backend == "reference"
    assert not missing(controller.backend_reason, "solver", "cvxpy")
    with raises(InputError, "backend", "solver", "cvxpy"):
        judges.controller_of("go2", solver="cvxpy", backend="compiled")


def test_a_replaced_controller_is_like_a_new_one(go2):
    both = judges.pair(go2, judges.stance(go2), facets=6)
    state = go2.random_state(3, 0.1)
    for frames in (["FL_foot"], ["FR_foot", "RL_foot"], ["FL_foot", "FR_foot", "RR_foot"]):
        contacts = fb.Contacts.points(go2, frames=frames)
        assert judges.difference(*(one.replace(contacts=contacts) for one in both), state) < TORQUE
    with raises(InputError, "target", 12, 3):
        aimed = both[0].replace(tasks=[*both[0].tasks[:3], fb.ForceTask(np.zeros(12))])
        aimed.replace(contacts=fb.Contacts.points(go2, frames=["FL_foot"]))


def test_a_target_that_becomes_a_reflection_is_refused_by_the_reference_backend(go2, standing):
    mirrored = fb.OrientationTask("base", lambda t: np.diag([1.0, 1.0, 1.0 if t < 1.0 else -1.0]))
    controller = fb.WholeBodyController(go2, judges.stance(go2), [mirrored], backend="compiled")
    assert controller(standing.q, standing.v, 0.0).backend == "compiled"
    with raises(InputError, "rotation", "base"):
        controller(standing.q, standing.v, 2.0)


def test_a_tick_keeps_its_targets_when_another_tick_comes_between(go2):
    """Two threads may share a controller: one tick's targets must not reach the other's problem."""
    state, com = go2.standing(), go2.standing().com

    def turning(t: float) -> np.ndarray:
        if t == 1.0:
            compiled(state.q, state.v, 7.0)
        return judges.rotation([0.0, 0.1 * t, 0.0])

    rising = fb.CoMTask(lambda t: com + [0.0, 0.0, 0.01 * t])
    tasks = [rising, fb.OrientationTask("base", turning), *fb.standing_tasks(state)[2:]]
    compiled, reference = judges.pair(go2, judges.stance(go2), tasks)
    assert judges.difference(compiled, reference, state, 1.0) < TORQUE


@pytest.mark.parametrize(("name", "weight"), [("solo12", 1e3), ("solo12", 1e5), ("go2", 1e5)])
def test_weights_far_apart_give_the_optimum_or_the_reference_backend(name, weight):
    """Rounding can end the search at the wrong active set: Newton's method detects it."""
    robot = judges.load(name)
    at = robot.standing()
    contacts = fb.Contacts.points(robot, mu=0.4, frames=[foot.frame for foot in robot.feet][:3])
    tasks = [fb.CoMTask(at.com, weight=weight), fb.PostureTask(at.q)]
    compiled = fb.WholeBodyController(robot, contacts, tasks, facets=64, backend="compiled")
    prove_all(compiled, judges.states(name, 40, 0.3))


def test_a_rotation_in_printed_digits_means_the_nearest_one_and_stays_on_the_compiled_backend(go2):
    state = go2.random_state(2, 0.1)
    exact = judges.rotation([0.1, -0.2, 0.3])
    U, _, Vt = np.linalg.svd(exact.astype(np.float32).astype(np.float64))
    for given in (exact.astype(np.float32), lambda t: exact.astype(np.float32)):
        tasks, nearest = ([fb.OrientationTask("base", R)] for R in (given, U @ Vt))
        compiled, reference = judges.pair(go2, judges.stance(go2), tasks)
        _, expected = judges.pair(go2, judges.stance(go2), nearest)
        found = compiled(state.q, state.v)
        assert found.backend == "compiled"
        for other in (reference, expected):
            assert np.max(np.abs(found.tau - other(state.q, state.v).tau)) < TORQUE


def test_a_new_controller_has_run_a_tick_before_the_loop_does(monkeypatch, go2):
    warmed: list[CompiledTick] = []
    monkeypatch.setattr(CompiledTick, "warm_up", lambda self: warmed.append(self))
    controller = fb.WholeBodyController(go2, judges.stance(go2), [judges.KeepStill()])
    assert controller.backend == "compiled" and warmed == [controller.compiled]
    assert controller.replace(tasks=fb.standing_tasks(go2.standing())).backend == "compiled"
    assert warmed == [controller.compiled], "a replaced controller's tick was compiled before"
