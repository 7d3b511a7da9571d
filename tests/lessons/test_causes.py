"""Causes that lessons and documentation name: without the cause, the effect goes."""

import contextlib
import io
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import floatbase as fb
from floatbase.actuators import FirstOrderLag
from floatbase.behaviours import Gait, Jump, Stand, Walk, support_margin
from floatbase.control import JointLimits
from floatbase.lessons.lesson08 import run_go2
from floatbase.lessons.lessonX import InjectedFault, crash_test, random_cases, record_box
from floatbase.lessons.publish import lesson_notebooks, read_notebook
from floatbase.playground import ModelMismatch, Perturbation, PerturbedSimulation
from floatbase.robots import Foot

pytestmark = pytest.mark.front_end  # 20 s of simulations
GO2, TALOS = fb.load("go2"), fb.load("talos")
CONTACTS = fb.Contacts.points(GO2, mu=0.7)
TESTED = {"claims", "picture", "predict", "check", "exercise", "install"}


@cache
def lesson08():
    """What lesson 08 has defined when its trot is complete."""
    defined = {"stand": CONTACTS.without("FL_foot")}
    with contextlib.redirect_stdout(io.StringIO()):
        for cell in read_notebook(lesson_notebooks()["08"]).cells:
            if cell.cell_type == "code" and not TESTED & set(cell.metadata.get("tags", [])):
                exec(cell.source, defined)
            if cell.source.startswith("from floatbase.lessons.lesson08 import mean_velocity"):
                return defined
    raise AssertionError("lesson 08 has no trot")


def test_angular_momentum_explains_most_of_the_difference_between_go2_and_its_pendulum():
    lesson = lesson08()
    record, away, omega = (lesson[name] for name in ("record", "away", "omega"))
    along = record.foot_positions[0, 0] - record.foot_positions[0, 1]  # from RR to FL
    axis = np.array([*along[:2], 0.0]) / np.linalg.norm(along[:2])
    momentum = [
        pin.computeCentroidalMomentum(GO2.model, GO2.model.createData(), q, v).angular @ axis
        for q, v in zip(np.array(record.q), np.array(record.v), strict=True)
    ]
    taken = np.gradient(momentum, record.time) / (GO2.mass * GO2.standing().com[2])

    def late(brake):  # s, until the pendulum is 50 mm away
        state, step = np.array([away[0], 0.0]), record.time[1] - record.time[0]
        for i in range(len(record)):
            state[1] += step * (omega**2 * state[0] - brake[i])
            state[0] += step * state[1]
            if state[0] > 0.05:
                return record.time[i]
        return np.inf

    measured = record.time[np.argmax(away > 0.05)]
    alone = late(0.0 * taken)
    assert measured > 1.03 * alone and late(taken) - alone > 0.5 * (measured - alone)


def test_a_trot_needs_footholds_that_are_computed_in_the_air():
    lesson, chosen = lesson08(), {}

    def at_lift_off(foot, now, since, desired):
        if since < 2.1e-3 or foot not in chosen:
            chosen[foot] = lesson["foothold"](foot, now, since, desired)
        return chosen[foot]

    assert run_go2(lesson["Trot"]([0.3, 0]), 2.5).outcome == "completed"
    assert run_go2(lesson["Trot"]([0.3, 0], at_lift_off), 2.5).outcome != "completed"


def test_a_trot_returns_to_its_line_only_if_its_velocity_depends_on_the_position():
    lesson, push, start = lesson08(), [0, 100, 0], GO2.standing().com[:2]

    class Returns(lesson["Trot"]):
        def __call__(self, q, v, t):
            line = start + [0.3 * max(0.0, t - lesson["START"]), 0.0]
            self.desired = np.array([0.3, 0.0]) + line - fb.State(GO2, q, v).com[:2]
            return lesson["Trot"].__call__(self, q, v, t)

    walk = Walk(GO2, CONTACTS, Gait.trot(GO2, swing=0.25, start=0.5), (0.3, 0.0))
    aside = [run_go2(c, 4.0, push).com[-1, 1] for c in (lesson["Trot"]([0.3, 0]), walk)]
    assert np.allclose(aside, 0.11, atol=0.01)
    assert abs(run_go2(Returns([0.3, 0]), 4.0, push).com[-1, 1]) < 0.02


def test_a_trot_with_shorter_steps_loses_less_speed():
    lesson = lesson08()
    assert lesson["mean_velocity"](run_go2(lesson["Trot"]([0.3, 0]), 3.0))[0] < 0.292
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(lesson, "T", 0.15)
        patch.setattr("floatbase.lessons.lesson08.helpers.SWING_TIME", 0.15)
        patch.setitem(lesson["step"].__globals__, "T", 0.15)
        record = run_go2(lesson["Trot"]([0.3, 0]), 3.0)
    assert lesson["mean_velocity"](record, 0.6)[0] > 0.296


def test_a_ramp_makes_the_torques_of_a_crawl_jump_less_but_not_those_of_a_trot():
    def jump(gait, ramp):
        walk = Walk(GO2, CONTACTS, gait, (0.1, 0.0), ramp=ramp)
        return abs(np.diff(run_go2(walk, 3.0).tau, axis=0))[300:].max()

    crawl, trot = Gait.crawl(GO2, 0.3, 0.2, start=0.5), Gait.trot(GO2, swing=0.25, start=0.5)
    assert jump(crawl, 0.0) > 3.0 > 1.5 > jump(crawl, 0.1)
    assert jump(trot, 0.1) > 0.9 * jump(trot, 0.0)


def test_a_foot_can_be_lifted_beside_the_triangle_if_the_ground_can_pull(standing):
    up = fb.FrameTask("FL_foot", standing.point("FL_foot") + [0, 0, 0.05], kp=100)
    tasks, outcomes = [*fb.standing_tasks(standing), up], []
    for mismatch, adhesion in ((None, 0.0), (ModelMismatch(cones=False), 30.0)):
        ground = Perturbation(adhesion_force=adhesion, disabled_contacts=["FL_foot"])
        sim = PerturbedSimulation(GO2, 0.7, perturbation=ground)
        controller = fb.WholeBodyController(
            GO2, CONTACTS.without("FL_foot"), tasks, modify_qp=mismatch, joint_limits=None
        )
        outcomes.append(fb.rollout(sim, controller, 1.2, control_period=2e-3).outcome)
    assert outcomes == ["fell", "completed"]


def test_a_short_push_leaves_the_ground_no_time_and_strong_legs_do_not_help(standing):
    aside = CONTACTS.positions(standing)[0, 1] - standing.com[1]
    impulse = GO2.mass * np.sqrt(GO2.gravity * standing.com[2]) / standing.com[2] * aside  # m ω s

    def stands(factor, duration, strength=1.0):
        robot = fb.load("go2", torque_limits=strength * np.array(GO2.torque_limits))
        push = fb.Push([0, factor * impulse / duration, 0], 0.2, duration)
        stand = Stand(robot, fb.Contacts.points(robot, mu=0.7))
        record = fb.rollout(fb.Simulation(robot), stand, 1.6, [push], 2e-3)
        return record.outcome == "completed"

    assert stands(1.0, 0.01) and not stands(1.08, 0.01)
    assert stands(1.2, 0.1) and not stands(1.4, 0.1) and not stands(1.4, 0.1, strength=3.0)


def test_slow_legs_do_not_reach_the_place_where_a_step_would_help():
    outcomes = [
        run_go2(Stand(GO2, CONTACTS, Gait.trot(GO2, swing=swing)), 2.0, [0, 250, 0], 0.2).outcome
        for swing in (0.2, 0.35)
    ]
    assert outcomes == ["completed", "fell"]


def test_joint_stops_end_the_hip_strategy():
    feet = [Foot(f"{side}_sole_link") for side in ("left", "right")]
    robot = fb.load("talos", feet=feet)
    late = []
    for limited in (True, False):
        sim = fb.Simulation(robot)
        if not limited:
            sim.model.jnt_limited[:] = 0
        limits = {} if limited else {"joint_limits": None}
        points = fb.Contacts.points(robot, mu=0.7)
        controller = fb.WholeBodyController(
            robot, points, fb.standing_tasks(sim.state), contact_weight=1e4, **limits
        )
        record = fb.rollout(sim, controller, 4.0, control_period=2e-3)
        late.append(record.time[record.com[:, 0] - record.com[0, 0] > 0.294][0])
    assert late[1] > late[0] + 0.5


def test_corner_forces_agree_only_while_the_springs_of_the_ground_are_equal():
    soles = fb.Contacts.flat_feet(TALOS, mu=0.7)
    sim = fb.Simulation(TALOS)
    sim.model.geom("left_sole_link corner 0").solref[0] *= 2
    controller = fb.WholeBodyController(TALOS, soles, fb.standing_tasks(sim.state))
    record = fb.rollout(sim, controller, 1.0, control_period=2e-3)
    assert abs(record.measured[-1] - record.planned[-1]).max() > 20


def test_talos_on_one_foot_needs_its_next_step_where_the_capture_point_is_outside():
    walk = Walk(TALOS, fb.Contacts.flat_feet(TALOS, mu=0.7), Gait.walk(TALOS), (0.3, 0.0))
    walked = fb.rollout(fb.Simulation(TALOS), walk, 3.6, control_period=4e-3)
    omega, outcomes = np.sqrt(9.81 / walked.com[0, 2]), {}
    for i in (385, 560, 600, 745, 790):
        now, sole = walked.state(i), walked.contacts_at(i)
        corners = sole.positions(now)
        ahead = support_margin(now.com[:2] + now.com_velocity[:2] / omega, corners[:, :2]) > 0.01
        sim = fb.Simulation(TALOS)
        sim.reset(now)
        above = fb.CoMTask([*corners.mean(axis=0)[:2], now.com[2]])
        tasks = [above, *fb.standing_tasks(now)[1:]]
        stays = fb.WholeBodyController(TALOS, sole, tasks, contact_weight=1e4)
        outcome = fb.rollout(sim, stays, 2.0, control_period=4e-3).outcome
        outcomes.setdefault(bool(ahead), set()).add(outcome)
    assert outcomes == {True: {"completed"}, False: {"fell"}}


class ChangedTorques:
    """Motors whose torques are a delayed or a smaller change of the first torques."""

    def __init__(self, first, delay, gain):
        self.first, self.gain, self.late = np.array(first), gain, [np.array(first)] * delay

    def step(self, tau, q, v, dt):
        self.late.append(np.array(tau))
        return self.first + self.gain * (self.late.pop(0) - self.first)


def slow_motors(robot, fault, first):
    lag = FirstOrderLag(robot, 1e3 / (2.0 * np.pi * 45.0))  # 45 ms
    lag.reset(first)
    return lag


@pytest.mark.parametrize(("delay", "gain", "falls"), [(0, 5 / 6, False), (20, 1.0, True)])
def test_the_delay_of_slow_motors_fells_the_robot_not_the_smaller_command(
    monkeypatch, delay, gain, falls
):
    def motors(robot, fault, first):
        return ChangedTorques(first, delay, gain)

    monkeypatch.setattr("floatbase.lessons.lessonX.cases.faulty_motors", motors)
    assert crash_test("slow motors", 45.0).fell == falls


def test_slow_motors_fell_the_robot_on_a_floor_with_four_times_the_friction(monkeypatch):
    monkeypatch.setattr("floatbase.lessons.lessonX.cases.faulty_motors", slow_motors)
    assert crash_test("friction", 4 * 1.2).fell


def test_a_forgotten_drift_does_no_harm_to_a_slow_twist():
    twist = type(random_cases(1)[0].twists[0])
    assert record_box("fast", twist(), InjectedFault("drift")).fell
    assert not record_box("slow", twist(rate=1.2), InjectedFault("drift")).fell


def test_stronger_motors_do_not_keep_a_joint_within_its_limit_when_the_target_is_out_of_reach():
    beyond = []
    for strength in (1.0, 10.0):
        robot = fb.load("go2", torque_limits=strength * np.array(GO2.torque_limits))
        state = robot.standing()
        raised = fb.CoMTask(state.com + [0.0, 0.0, 0.3])
        tasks, limits = [raised, *fb.standing_tasks(state)[1:]], JointLimits.of(robot)
        contacts = fb.Contacts.points(robot, mu=0.7)
        controller = fb.WholeBodyController(robot, contacts, tasks, joint_limits=limits)
        q = fb.rollout(fb.Simulation(robot), controller, 1.0, control_period=2e-3).q[:, 7:]
        low, high = (bound[7:] for bound in (robot.model.lowerPositionLimit,
                                             robot.model.upperPositionLimit))  # fmt: skip
        beyond.append(np.maximum(q - high, low - q).max() / (high - low).max())
    assert beyond[0] > 0.01 and beyond[1] > 0.9 * beyond[0]


def test_a_jump_leaves_the_ground_with_angular_momentum_and_its_legs_add_to_the_tilt():
    jump = Jump(GO2, fb.Contacts.feet(GO2, mu=0.6), height=0.2)
    record = fb.rollout(fb.Simulation(GO2), jump, 2.5, control_period=2e-3)
    air = [i for i, stance in enumerate(record.stances) if stance.k == 0]
    middle, locked = air[len(air) // 2], np.array(record.v)
    locked[:, 6:] = 0.0  # the same body with joints that stand still
    whole, base = (
        pin.computeCentroidalMomentum(
            GO2.model, GO2.model.createData(), np.array(record.q[middle]), v[middle]
        ).angular[1]
        for v in (np.array(record.v), locked)
    )
    assert base < whole < -0.2
