"""Rollouts: time, record, and reports of errors."""

import judges
import numpy as np
import pytest
from judges import Torques, limp
from messages import missing, raises, refused, warns

import floatbase as fb
from floatbase.control import Command
from floatbase.dynamics import fixed_frame
from floatbase.errors import (
    FloatbaseError,
    InfeasibleError,
    InputError,
    SimulationWarning,
    UnknownNameError,
)
from floatbase.robots import State, with_floating_base


@pytest.fixture
def sim() -> fb.Simulation:
    return fb.Simulation(judges.load("go2"))


def test_a_limp_robot_falls_and_the_outcome_is_fell(sim):
    record = fb.rollout(sim, limp, 3.0)
    assert record.outcome == "fell" and record.time[-1] < 2.0
    assert record.final.q[2] < 0.2 and record.error is None


def test_forces_that_a_controller_does_not_give_are_nan_and_are_measured_all_the_same(sim):
    record = fb.rollout(sim, limp, 0.05)
    assert np.all(np.isnan(record.planned))
    assert record.contacts.point_names == sim.point_names
    assert record.measured[:5].reshape(5, 4, 3)[:, :, 2].sum() > 0


def test_a_base_that_begins_at_height_zero_falls_only_when_it_sinks():
    arm = with_floating_base(judges.load("ur5"))
    q = arm.standing().q.copy()
    q[2] = 0.0
    sim = fb.Simulation(arm)
    sim.reset(fb.State(arm, q))
    sim.step(np.zeros(arm.d))
    assert sim.q[2] < 0.0
    assert not sim.fallen
    sim.data.qpos[2] = -1.0
    sim.step(np.zeros(arm.d))
    assert sim.fallen


def test_a_robot_that_stands_on_its_back_has_fallen(sim):
    q = sim.q
    q[2] = 1.0
    sim.reset(State(sim.robot, q))
    assert not sim.fallen
    v = np.zeros(18)
    v[3] = 20.0
    sim.reset(State(sim.robot, q, v))
    for _ in range(60):  # 1.2 rad
        sim.step(np.zeros(12))
    assert sim.fallen


def test_a_physics_that_explodes_has_diverged(sim, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log to the working directory
    sim.reset(sim.robot.standing().replace(v=np.full(18, 1e7)))
    record = fb.rollout(sim, limp, 1.0)
    assert record.outcome == "diverged"
    assert len(record) < 10
    assert np.all(np.isfinite(record.q))
    sim.reset()
    assert not sim.diverged
    assert fb.rollout(sim, judges.controller_of("go2"), 0.05).outcome == "completed"


def test_a_controller_without_an_answer_ends_the_record_and_its_error_is_kept(sim):
    inner = judges.controller_of("go2")

    def gives_up(q: np.ndarray, v: np.ndarray, t: float) -> Command:
        if t > 0.0095:
            raise InfeasibleError("no point satisfies all constraints", ["FL_foot normal force"])
        return inner(q, v, t)

    record = fb.rollout(sim, gives_up, 1.0)
    assert record.outcome == "controller failed"
    assert isinstance(record.error, InfeasibleError)
    assert record.error.constraints == ("FL_foot normal force",)
    assert len(record) == 10


def test_a_controller_that_fails_at_once_leaves_an_empty_record(sim):
    state, contacts = sim.robot.standing(), fb.Contacts.points(sim.robot)
    tasks = fb.standing_tasks(state)
    greedy = fb.WholeBodyController(sim.robot, contacts, tasks, min_normal_force=5000.0)
    record = fb.rollout(sim, greedy, 0.1)
    assert (record.outcome, len(record)) == ("controller failed", 0)
    assert record.q.shape == (0, sim.robot.nq) and record.com.shape == (0, 3)
    assert "controller failed" in repr(record)
    for look in (record.slip, lambda: record.final):
        refused(look, InputError, "controller failed")
    fb.rollout(sim, judges.controller_of("go2"), 0.01)  # feet have touched the ground
    record = fb.rollout(sim, greedy, 0.1)
    assert record.outcome == "controller failed"
    assert record.measured.shape == (0, 12) and record.foot_positions.shape == (0, 4, 3)


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, None, "much"])
def test_torques_that_are_no_finite_numbers_end_the_record_and_rows_before_are_kept(sim, number):
    inner = judges.controller_of("go2")

    def goes_wild(q: np.ndarray, v: np.ndarray, t: float) -> Torques:
        tau = list(inner(q, v, t).tau)
        if t < 0.0095:
            return Torques(tau)
        tau[3] = number
        # the torques are reported before forces of another length
        return Torques(tau, np.full(5, np.nan))

    record = fb.rollout(sim, goes_wild, 0.1)
    assert (record.outcome, len(record)) == ("controller failed", 10)
    assert isinstance(record.error, FloatbaseError)
    assert not missing(str(record.error), "controller", str(number), sim.robot.joint_names[3], 0.01)
    assert np.all(np.isfinite(record.tau))


def test_actuators_with_nan_torques_end_the_record_and_cannot_write_into_those_desired(sim):
    class Broken:
        def step(self, tau: np.ndarray, q: np.ndarray, v: np.ndarray, dt: float) -> np.ndarray:
            assert not tau.flags.writeable
            return tau * np.nan if sim.time > 0.0095 else tau

    record = fb.rollout(sim, judges.controller_of("go2"), 0.1, actuators=Broken())
    assert (record.outcome, len(record)) == ("controller failed", 10)
    assert "actuators" in str(record.error)


def test_mistakes_in_a_controller_are_not_swallowed(sim):
    def broken(q: np.ndarray, v: np.ndarray, t: float) -> Torques:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fb.rollout(sim, broken, 0.1)


def test_the_record_holds_a_row_for_each_tick_taken_before_its_torques_act(sim):
    start, seen = sim.robot.standing(), []
    inner = judges.controller_of("go2")

    def watched(q: np.ndarray, v: np.ndarray, t: float) -> Command:
        seen.append((q.copy(), v.copy(), t))
        return inner(q, v, t)

    record = fb.rollout(sim, watched, 0.02)
    q, v, t = (np.array(rows) for rows in zip(*seen, strict=True))
    assert np.array_equal(record.q, q) and np.array_equal(record.v, v)
    assert np.allclose(record.time, t) and np.allclose(t, 1e-3 * np.arange(20))
    assert np.allclose(record.q[0], start.q)
    assert np.array_equal(record.state(3).q, record.q[3])
    assert np.array_equal(record.final.q, record.q[-1])
    assert np.allclose(record.com, [record.state(i).com for i in range(20)])
    strayed = np.linalg.norm(record.foot_positions - record.foot_positions[0], axis=2)
    assert np.allclose(record.slip(), strayed.max(axis=0))
    assert record.com is record.com


def test_torques_are_held_for_the_whole_control_period(sim):
    times = []

    def counting(q: np.ndarray, v: np.ndarray, t: float) -> Torques:
        times.append(t)
        return Torques(np.full(12, float(len(times))))

    record = fb.rollout(sim, counting, 0.02, control_period=0.005)
    assert np.allclose(times, [0.0, 0.005, 0.01, 0.015])
    assert np.allclose(record.time, times)
    assert sim.time == pytest.approx(0.02)
    assert np.array_equal(record.tau[:, 0], [1.0, 2.0, 3.0, 4.0])
    again = fb.Simulation(sim.robot)
    for step in range(20):
        again.step(np.full(12, 1.0 + step // 5))
    assert np.array_equal(again.q, sim.q)


def test_measured_forces_are_the_mean_over_the_control_period(go2):
    slow, fast = fb.Simulation(go2), fb.Simulation(go2)
    coarse = fb.rollout(slow, limp, 0.02, control_period=0.005)
    fine = fb.rollout(fast, limp, 0.02)
    assert np.allclose(coarse.measured, fine.measured.reshape(4, 5, 12).mean(axis=1), atol=1e-9)


def test_a_rollout_goes_on_from_where_the_last_one_ended(sim):
    controller = judges.controller_of("go2")
    push = fb.Push([30.0, 0.0, 0.0], start=0.015, duration=0.01)
    first, second = (fb.rollout(sim, controller, 0.02, [push]) for _ in range(2))
    assert second.time[0] == pytest.approx(first.time[-1] + 1e-3)
    whole = fb.rollout(fb.Simulation(sim.robot), controller, 0.04, [push])
    assert np.allclose(np.vstack([first.q, second.q]), whole.q, atol=1e-12)
    assert second.pushes == (push,)


def test_moving_targets_see_the_simulations_clock(sim):
    seen = []
    target = sim.robot.standing().com

    def path(t: float) -> tuple[np.ndarray, ...]:
        seen.append(t)
        return target + [0.0, 0.05 * t, 0.0], np.array([0.0, 0.05, 0.0]), np.zeros(3)

    robot = sim.robot
    tasks = [fb.CoMTask(path), fb.OrientationTask(), fb.PostureTask(robot.standing().q)]
    controller = fb.WholeBodyController(robot, fb.Contacts.points(robot), tasks)
    seen.clear()
    fb.rollout(sim, controller, 0.005)
    assert np.allclose(seen, [0.0, 0.001, 0.002, 0.003, 0.004])


def test_a_flat_foot_taken_as_a_point_is_measured_by_all_its_corners():
    robot, flat = judges.load("talos"), judges.controller_of("talos")

    class Points:
        """The flat-footed controller, with two point contacts as its stance."""

        contacts = fb.Contacts.points(robot)

        def __call__(self, q: np.ndarray, v: np.ndarray, t: float) -> Torques:
            return Torques(flat(q, v, t).tau)

    corners, points = (fb.rollout(fb.Simulation(robot), by, 0.03) for by in (flat, Points()))
    forces, places = (
        rows.reshape(30, 2, 4, 3) for rows in (corners.measured, corners.foot_positions)
    )
    assert np.allclose(points.measured.reshape(30, 2, 3), forces.sum(axis=2), atol=1e-6)
    assert np.allclose(points.foot_positions, places.mean(axis=2), atol=1e-9)


def test_a_controller_that_writes_into_its_arguments_changes_nothing(sim):
    def careless(q: np.ndarray, v: np.ndarray, t: float) -> Torques:
        q[:], v[:] = 0.0, 1.0
        return Torques(np.zeros(12))

    found = fb.rollout(sim, careless, 0.01)
    sim.reset()
    expected = fb.rollout(sim, limp, 0.01)
    assert np.array_equal(found.q, expected.q)
    assert np.array_equal(found.v, expected.v)


def test_contacts_and_constraints_that_the_physics_lacks_are_not_measured_as_zero(go2):
    points = fb.Contacts.points(go2, frames=["FL_foot", "RR_foot", "FL_calf"])
    contacts = points + fb.Contacts([fixed_frame("base")])
    controller = fb.WholeBodyController(go2, contacts, fb.standing_tasks(go2.standing()))
    with warns(SimulationWarning, "FL_calf", "bolts of base"):
        record = fb.rollout(fb.Simulation(go2), controller, 0.005)
    assert np.all(np.isnan(record.measured[:, 6:]))
    assert np.all(np.isfinite(record.measured[:, :6]))
    assert record.foot_positions.shape == (5, 3, 3)
    assert np.all(np.isnan(record.foot_positions[:, 2]))
    assert np.all(np.isfinite(record.planned))


# a stance that changes ----------------------------------------------------------------------------


class Switching:
    """A controller that stands on four feet, but on three from 0.1 s to 0.2 s."""

    def __init__(self, lifted: str = "FL_foot"):
        robot = judges.load("go2")
        state, every = robot.standing(), fb.Contacts.points(robot)
        com = np.array(state.com)
        com[:2] = every.without(lifted).positions(state)[:, :2].mean(axis=0)
        shift = fb.CoMTask(lambda t: state.com + min(1.0, t / 0.1) * 0.6 * (com - state.com))
        up = fb.FrameTask(lifted, state.point(lifted) + [0.0, 0.0, 0.03])
        tasks = (shift, *fb.standing_tasks(state)[1:])
        self.four = fb.WholeBodyController(robot, every, tasks)
        self.three = fb.WholeBodyController(robot, every.without(lifted), (*tasks, up))
        self.robot, self.now = robot, self.four

    @property
    def contacts(self) -> fb.Contacts:
        return self.now.contacts

    def __call__(self, q: np.ndarray, v: np.ndarray, t: float) -> Command:
        self.now = self.three if 0.1 <= t < 0.2 - 1e-9 else self.four
        return self.now(q, v, t)


def test_a_record_follows_a_stance_that_changes(sim):
    """Outside the stance, planned forces are 0, but measured forces are as in the simulation."""
    record = fb.rollout(sim, Switching(), 0.3, control_period=0.002)
    assert record.outcome == "completed"
    assert record.contacts.names == ("FL_foot", "FR_foot", "RL_foot", "RR_foot")
    assert record.planned.shape == record.measured.shape == (150, 12)
    sizes = [len(record.contacts_at(i)) for i in range(150)]
    assert sizes == [4] * 50 + [3] * 50 + [4] * 50
    up = np.array(sizes) == 3
    assert np.all(record.planned[up, :3] == 0.0)
    assert np.all(np.abs(record.force("FL_foot", "planned")[~up, 2]) > 0.0)
    assert np.all(record.force("FL_foot")[60:95] == 0.0)  # in the air
    assert record.foot_positions[95, 0, 2] > 0.002
    for i in (20, 70):  # each row has the plan of its own stance
        command = Switching()(record.q[i], record.v[i], float(record.time[i]))
        # FL, the first one, is not always in the stance
        present = slice(3 * (4 - len(record.contacts_at(i))), None)
        assert np.allclose(record.planned[i][present], command.forces, atol=1e-9)


def test_a_foot_that_joins_the_stance_later_joins_the_record(sim):
    controller = Switching()

    class Late:
        contacts = controller.three.contacts

        def __call__(self, q: np.ndarray, v: np.ndarray, t: float) -> Command:
            inner = controller.three if t < 0.0095 else controller.four
            self.contacts = inner.contacts
            return inner(q, v, t)

    record = fb.rollout(sim, Late(), 0.02)
    assert record.contacts.names == ("FR_foot", "RL_foot", "RR_foot", "FL_foot")
    assert np.all(record.planned[:10, 9:] == 0.0)
    assert np.all(record.planned[10:, 11] > 0.0)
    assert np.allclose(record.measured.reshape(20, 4, 3)[:, 3], record.force("FL_foot"))
    assert [len(record.contacts_at(i)) for i in (0, 9, 10, 19)] == [3, 3, 4, 4]


def test_a_contact_that_changes_its_kind_within_a_rollout_is_refused():
    robot, frames = judges.load("talos"), ["left_sole_link"]

    class Shifty:
        contacts = fb.Contacts.flat_feet(robot, frames=frames)

        def __call__(self, q: np.ndarray, v: np.ndarray, t: float) -> Torques:
            if t >= 0.001:
                self.contacts = fb.Contacts.points(robot, frames=frames)
            return Torques(np.zeros(robot.d))

    with raises(InputError, "left_sole_link", 12, 3):
        fb.rollout(fb.Simulation(robot), Shifty(), 0.01)


def test_the_force_of_a_foot_is_found_by_its_name_and_of_a_flat_foot_is_the_resultant():
    sim = fb.Simulation(judges.load("talos"))
    record = fb.rollout(sim, judges.controller_of("talos"), 0.02)
    for kind in ("measured", "planned"):
        forces = getattr(record, kind).reshape(20, 2, 4, 3).sum(axis=2)
        for i, name in enumerate(("left_sole_link", "right_sole_link")):
            assert np.allclose(record.force(name, kind), forces[:, i])
    refused(lambda: record.force("left_sole"), UnknownNameError, "left_sole", "left_sole_link")
    with raises(UnknownNameError, "wished", "measured", "planned"):
        record.force("left_sole_link", "wished")


def test_a_bar_shows_how_far_it_is(capsys):
    for progress in (True, False):
        fb.rollout(fb.Simulation(judges.load("go2")), judges.limp, 0.02, progress=progress)
        assert ("20/20" in capsys.readouterr().err) == progress
