"""Motor drivers that follow the plan of a controller."""

import judges
import numpy as np
from messages import raises

import floatbase as fb
from floatbase.actuators import JointServo
from floatbase.behaviours import Gait, Walk
from floatbase.errors import InputError
from floatbase.lessons import ConstantTorques

PERIOD = 0.005  # s: 200 Hz
LOAD = 3.0  # kg, unknown to the controllers


def standing():
    robot = judges.load("go2")
    tasks = fb.standing_tasks(robot.standing())
    return robot, fb.WholeBodyController(robot, fb.Contacts.feet(robot, mu=0.6), tasks)


def run(controller, actuators, load, duration):
    robot = controller.robot
    sim = fb.Simulation(robot.with_payload("base", load, [0.0, 0.0, 0.0]) if load else robot)
    sim.reset(robot.standing())
    return fb.rollout(sim, controller, duration, control_period=PERIOD, actuators=actuators)


def sinking(record):
    """How far below the standing height the base is in the second half of a run [m]."""
    return record.robot.standing().q[2] - record.q[len(record) // 2 :, 2].mean()


def test_go2_stands_and_trots_at_its_height_under_an_unknown_load():
    robot, controller = standing()
    walk = Walk(robot, controller.contacts, Gait.trot(robot, start=0.2), (0.3, 0.0))
    for commanded in (controller, walk):
        servo = JointServo(robot, stiffness=80.0, damping=2.0)
        alone, with_servo = (run(commanded, each, LOAD, 1.5) for each in (None, servo))
        assert with_servo.outcome == "completed"
        assert sinking(alone) > 0.015
        assert sinking(with_servo) < 0.005


def test_the_springs_add_almost_no_torque_without_a_load():
    robot, controller = standing()
    servo = JointServo(robot, stiffness=80.0, damping=2.0, leak=0.0)
    record = run(controller, servo, 0.0, 0.5)
    assert np.abs(record.tau - record.tau_desired).max() < 0.01 * min(robot.torque_limits)


def test_targets_integrate_the_plan_and_are_never_far_from_the_measurement():
    robot, controller = standing()
    state = robot.random_state(3, 0.02)
    command = controller(state.q, state.v)
    servo = JointServo(robot, np.full(robot.d, 20.0), 0.5, leak=0.0)
    servo.receive(command)
    q, v, t = state.q[7:], state.v[6:], 0.02
    for _ in range(20):
        targets = servo.targets(q, v, t / 20)
    acceleration = command.qdd[6:]
    assert np.allclose(targets.position, q + t * v + 0.5 * t**2 * acceleration)
    assert np.allclose(targets.velocity, v + t * acceleration)
    for _ in range(1000):  # the joints do not move
        targets = servo.targets(q, v, 0.01)
    assert np.all(20.0 * np.abs(targets.position - q) <= np.array(robot.torque_limits) + 1e-9)
    assert np.all(0.5 * np.abs(targets.velocity - v) <= np.array(robot.torque_limits) + 1e-9)
    servo.reset()
    servo.receive(command)
    assert np.allclose(servo.targets(q, v, 1e-9).position, q)


def test_torques_stay_within_the_limits_of_the_drivers():
    robot, controller = standing()
    q = robot.standing().q[7:]
    servo = JointServo(robot, 40.0, 1.0, torque_limits=2.0)
    servo.receive(controller(robot.standing().q, np.zeros(robot.nv)))
    assert np.abs(servo.step(np.zeros(robot.d), q, np.zeros(robot.d), 0.001)).max() == 2.0


def test_a_servo_refuses_a_step_without_a_command_and_one_without_accelerations():
    robot, _ = standing()
    servo = JointServo(robot, 1.0, 1.0)
    with raises(InputError, "receive"):
        servo.step(np.zeros(12), np.zeros(12), np.zeros(12), 0.001)
    with raises(InputError, "qdd"):
        fb.rollout(fb.Simulation(robot), ConstantTorques(np.zeros(12)), 0.01, actuators=servo)
