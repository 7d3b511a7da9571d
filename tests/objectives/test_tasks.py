"""Tasks: residuals are actual - desired acceleration, by finite differences of motion."""

from collections.abc import Callable
from functools import partial
from typing import Any

import judges
import numpy as np
import pinocchio as pin
from messages import raises

import floatbase as fb
from floatbase.dynamics import EquationsOfMotion
from floatbase.errors import InputError
from floatbase.objectives import AngularMomentumTask, AxisTask, RelativePoseTask

N = 5
# rad: on the arm of anymal_kinova, gravity leaves half of it with a posture of small weight
DRIFT = 0.01


robot = judges.every_robot


def cases(name: str) -> list[tuple[EquationsOfMotion, np.ndarray, np.random.Generator]]:
    """Make equations at random states, each with a random acceleration."""
    found = []
    for seed, state in enumerate(judges.states(name, N)):
        rng = np.random.default_rng(seed)
        eom = fb.equations_of_motion(state, judges.stance(state.robot))
        found.append((eom, rng.normal(size=eom.nv), rng))
    return found


def test_the_centre_of_mass_residual_is_its_acceleration_less_the_desired_one(robot):
    for eom, qdd, rng in cases(robot.name):
        target, velocity, feed = rng.normal(size=(3, 3))
        task = fb.CoMTask(target, velocity, feed, kp=7.0, kd=3.0)
        actual = judges.acceleration_of(lambda s: s.com, eom.state, qdd)
        moving = judges.derivative(lambda s: s.com, eom.state, eom.state.v)
        desired = feed - 7.0 * (eom.state.com - target) - 3.0 * (moving - velocity)
        assert np.allclose(task.residual(eom)(qdd), actual - desired, atol=2e-5)


def test_the_frame_residual_is_its_acceleration_less_the_desired_one(robot):
    for eom, qdd, rng in cases(robot.name):
        frame = eom.robot.frames[-1]
        target, velocity, feed = rng.normal(size=(3, 3))
        task = fb.FrameTask(frame, target, velocity, feed, kp=7.0, kd=3.0)
        actual = judges.acceleration_of(lambda s, f=frame: s.point(f), eom.state, qdd)
        moving = judges.derivative(lambda s, f=frame: s.point(f), eom.state, eom.state.v)
        desired = feed - 7.0 * (eom.state.point(frame) - target) - 3.0 * (moving - velocity)
        assert np.allclose(task.residual(eom)(qdd), actual - desired, atol=2e-5)


def test_the_orientation_residual_is_the_angular_acceleration_less_the_desired_one(robot):
    for eom, qdd, rng in cases(robot.name):
        frame = eom.robot.frames[-1]
        R = eom.state.frame_pose(frame).rotation
        error, velocity, feed = 0.5 * rng.normal(size=(3, 3))
        # R R_dᵀ = exp(error): the frame is ahead of its target by `error`, about axes of the world
        target, step = judges.rotation(-error) @ R, 1e-5
        task = fb.OrientationTask(frame, target, velocity, feed, kp=7.0, kd=3.0)

        def turned(state: fb.State, frame: str = frame) -> np.ndarray:
            return state.frame_pose(frame).rotation

        actual = judges.turning_acceleration_of(turned, eom.state, qdd)
        ahead, behind = (turned(judges.along(eom.state, eom.state.v, t)) for t in (step, -step))
        moving = judges.turn_between(ahead, behind) / (2.0 * step)
        desired = feed - 7.0 * error - 3.0 * (moving - velocity)
        assert np.allclose(task.residual(eom)(qdd), actual - desired, atol=5e-5)


def test_the_posture_residual_is_each_joints_acceleration_less_a_spring_to_its_angle(robot):
    for eom, qdd, rng in cases(robot.name):
        robot, state = eom.robot, eom.state
        target = robot.random_state(int(rng.integers(1000)), 0.2)
        task = fb.PostureTask(target.q, kp=7.0, kd=3.0)
        e = state.q[-robot.d :] - target.q[-robot.d :]
        expected = qdd[-robot.d :] + 7.0 * e + 3.0 * state.v[-robot.d :]
        assert np.allclose(task.residual(eom)(qdd), expected, atol=1e-9)


def test_the_posture_of_the_base_does_not_count():
    eom = fb.equations_of_motion(judges.load("go2").random_state(0), fb.Contacts.none())
    q = eom.state.q.copy()
    q[:3] += 1.0
    q[3:7] = [0.0, 0.0, 0.0, 1.0]
    residuals = [fb.PostureTask(p).residual(eom) for p in (eom.state.q, q)]
    assert np.array_equal(residuals[0].b, residuals[1].b)
    assert not np.any(residuals[0].A[:, :6])


def test_force_and_torque_residuals_are_actual_minus_target(robot):
    for eom, _, rng in cases(robot.name):
        forces, tau = rng.normal(size=eom.k), rng.normal(size=eom.d)
        assert np.array_equal(fb.ForceTask().residual(eom)(forces), forces)
        assert np.array_equal(fb.TorqueTask().residual(eom)(tau), tau)
        assert np.allclose(fb.ForceTask(np.ones(eom.k)).residual(eom)(forces), forces - 1.0)
        assert np.allclose(fb.TorqueTask(np.ones(eom.d)).residual(eom)(tau), tau - 1.0)


def test_a_resting_robot_that_stands_where_it_should_is_given_no_acceleration(robot):
    state = robot.standing()
    eom = fb.equations_of_motion(state, judges.stance(state.robot))
    for task in fb.standing_tasks(state):
        assert np.allclose(task.residual(eom)(np.zeros(eom.nv)), 0.0, atol=1e-9), task.name


def test_targets_may_be_functions_of_time():
    state = judges.load("go2").random_state(0)
    eom = fb.equations_of_motion(state, fb.Contacts.points(state.robot))
    p, v, a = [2.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.0, 1.0, 2.0]
    R = judges.rotation([0.0, 0.0, 0.3])
    q = state.integrate(np.full(18, 0.1))
    w = np.linspace(-1.0, 1.0, 12)
    kinds = [
        (partial(fb.CoMTask, kp=4.0), (p, v, a)),
        (partial(fb.FrameTask, "FL_foot"), (p, v, a)),
        (partial(fb.OrientationTask, "base"), (R, v, a)),
        (fb.PostureTask, (q, w, 2.0 * w)),
    ]
    for task, (x, *rates) in kinds:
        alone, still = task(lambda t, x=x: x), task(x)
        for together in ((x, *rates), [x, *rates]):
            moving = task(lambda t, x=x, given=together: given if t == 2.0 else x)
            assert np.array_equal(moving.residual(eom, 2.0).b, task(x, *rates).residual(eom).b)
            assert np.array_equal(moving.residual(eom, 1.0).b, still.residual(eom).b)
        assert np.array_equal(alone.residual(eom, 1.0).b, still.residual(eom).b)
        assert not np.allclose(task(x, *rates).residual(eom).b, still.residual(eom).b)
    rows = fb.CoMTask(lambda t: np.array([p, v, a]))
    assert np.array_equal(rows.residual(eom).b, fb.CoMTask(p, v, a).residual(eom).b)


def test_a_moving_target_is_evaluated_once_a_tick_and_followed_without_lag():
    """A critically damped task lags behind a slow target by (kd / kp) times the target's velocity,
    unless it knows this velocity.
    """
    robot, amplitude, rate = judges.load("go2"), 0.01, 2.0  # m, rad/s
    state, asked = robot.standing(), []

    def path(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        asked.append(t)
        side, s, c = np.array([0.0, amplitude, 0.0]), np.sin(rate * t), np.cos(rate * t)
        return state.com + side * s, side * rate * c, -side * rate**2 * s

    def error(position: Callable[[float], Any]) -> float:
        tasks = [fb.CoMTask(position, weight=1e3), *fb.standing_tasks(state)[1:]]
        controller = fb.WholeBodyController(robot, judges.stance(robot), tasks)
        asked.clear()
        run = fb.rollout(fb.Simulation(robot), controller, 1.5)
        assert run.outcome == "completed"
        wanted = state.com[1] + amplitude * np.sin(rate * run.time)
        return float(np.max(np.abs(run.com[1000:, 1] - wanted[1000:])))

    lag = error(lambda t: (path(t)[0], np.zeros(3), np.zeros(3)))
    assert 0.7 < lag / (0.2 * amplitude * rate) < 1.1  # kd / kp = 0.2 s
    assert error(path) < 0.1 * lag
    assert len(asked) == len(set(asked))
    assert error(lambda t: path(t)[0]) < 0.03 * amplitude


def turning(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A rotation about two axes, with its angular velocity and acceleration in the world."""
    about_z, x = judges.rotation([0.0, 0.0, 2.0 * t]), np.array([1.0, 0.0, 0.0])
    velocity = np.array([0.0, 0.0, 2.0]) + 3.0 * about_z @ x
    return about_z @ judges.rotation(3.0 * t * x), velocity, 6.0 * about_z @ [0.0, 1.0, 0.0]


def test_a_target_function_that_returns_the_target_alone_is_differentiated():
    robot = judges.load("kinova")
    q, rates = robot.standing().q, np.linspace(-1.0, 1.0, robot.d)
    place, velocity = np.array([0.3, -0.2, 5.0]), np.array([1.0, 2.0, 3.0])

    def pose(t: float) -> np.ndarray:
        return pin.SE3(turning(t)[0], place + velocity * t).homogeneous

    _, omega, alpha = turning(0.3)
    cases = [
        (fb.CoMTask(lambda t: np.sin(t) * place), np.cos(0.3) * place, -np.sin(0.3) * place),
        (fb.OrientationTask("base", lambda t: turning(t)[0]), omega, alpha),
        (
            fb.PostureTask(lambda t: pin.integrate(robot.model, q, t * t * rates)),
            0.6 * rates,
            2.0 * rates,
        ),
        (
            RelativePoseTask("base", "other", pose),
            np.append(velocity, omega),
            np.append(np.zeros(3), alpha),
        ),
        (AngularMomentumTask(lambda t: np.sin(t) * place), np.cos(0.3) * place),
    ]
    for task, *expected in cases:
        _, *found = task.targets_at(robot, 0, 0.3)
        for one, other in zip(found, expected, strict=True):
            assert np.allclose(one, other, rtol=0.0, atol=5e-3 * np.abs(other).max() + 1e-6)
    axis = AxisTask("base", [0.0, 0.0, 1.0], lambda t: turning(t)[0][:, 2])
    state = judges.load("go2").random_state(0)
    eom = fb.equations_of_motion(state, fb.Contacts.none())
    full = AxisTask("base", [0.0, 0.0, 1.0], lambda t: (turning(t)[0][:, 2], *turning(t)[1:]))
    assert np.allclose(axis.residual(eom, 0.3).b, full.residual(eom, 0.3).b, atol=0.05)


def test_jumps_kinks_and_ends_of_a_target_function_cause_no_large_derivatives():
    robot, up = judges.load("go2"), np.array([0.0, 0.0, 1.0])

    def rates_of(path: Callable[[float], float], t: float) -> list[float]:
        targets = fb.CoMTask(lambda t: path(t) * up).targets_at(robot, 0, t)
        return [float(target[2]) for target in targets[1:]]

    def ends(t: float) -> float:
        if not 0.0 <= t <= 1.0:
            raise ValueError(t)
        return t * t

    noise = np.random.default_rng(0)
    for t in np.linspace(0.999, 1.001, 17):
        assert rates_of(lambda t: 1.0 * (t >= 1.0), t) == [0.0, 0.0]
        assert rates_of(lambda t: int(1000 * t) / 1000, t) == [0.0, 0.0]
        assert np.allclose(rates_of(lambda t: max(t - 1.0, 0.0), t)[1], 0.0, atol=1e-6)
        assert rates_of(lambda t: t + noise.normal(), t) == [0.0, 0.0]
    assert np.allclose(rates_of(ends, 0.0), [0.0, 2.0], atol=1e-6)
    assert np.allclose(rates_of(ends, 1.0), [2.0, 2.0], atol=1e-6)
    assert rates_of(lambda t: 0.3, 0.0) == [0.0, 0.0]
    with raises(InputError, "centre of mass", "acceleration"):
        fb.CoMTask({0.5: up}.__getitem__).targets_at(robot, 0, 0.5)


def test_damping_is_critical_unless_it_is_given():
    """ë + kd ė + kp e = 0 with kd = 2 √kp has the double root -√kp, the fastest return without
    overshoot.
    """
    state = judges.load("go2").random_state(0)
    eom = fb.equations_of_motion(state, fb.Contacts.none())
    for make in (
        lambda **g: fb.CoMTask(np.zeros(3), **g),
        lambda **g: fb.FrameTask("FL_foot", np.zeros(3), **g),
        lambda **g: fb.OrientationTask("base", **g),
        lambda **g: fb.PostureTask(state.q, **g),
    ):
        assert np.allclose(make(kp=25.0).residual(eom).b, make(kp=25.0, kd=10.0).residual(eom).b)
        assert not np.allclose(make(kp=25.0).residual(eom).b, make(kp=25.0, kd=0.0).residual(eom).b)


def test_a_target_is_copied_when_a_task_is_made(standing):
    eom = fb.equations_of_motion(standing, fb.Contacts.none())
    target = standing.com.copy()
    task = fb.CoMTask(target)
    target += 1.0
    assert np.allclose(task.residual(eom).b, 0.0, atol=1e-9)
    forces = np.zeros(12)
    hold = fb.ForceTask(forces)
    eom = fb.equations_of_motion(standing, fb.Contacts.points(standing.robot))
    forces += 1.0
    assert np.array_equal(hold.residual(eom)(np.zeros(12)), np.zeros(12))


def test_standing_tasks_keep_the_arms_where_they_were():
    """Only the posture task holds joints that no contact needs, against gravity and a push."""
    for name, part in (("anymal_kinova", "j2s6s200"), ("talos", "arm"), ("ur5", "")):
        robot = judges.load(name)
        standing = robot.standing()
        arms = [joint.startswith(part) for joint in robot.joint_names]
        assert any(arms)
        push = fb.Push([0.0, 0.15 * robot.weight, 0.0], start=0.2, duration=0.1)
        pushes, sim = [push] if robot.is_floating else [], fb.Simulation(robot)
        run = fb.rollout(sim, judges.controller_of(name), 3.0, pushes, control_period=2e-3)
        drift = run.final.difference(standing.q)[-robot.d :]
        assert np.abs(drift[arms]).max() < DRIFT, name
