"""Tasks for relative poses, axes and the centre of pressure, by finite differences.

The finite differences use only positions from Pinocchio's forward kinematics.
"""

from functools import partial

import judges
import numpy as np
import pinocchio as pin
from messages import raises, refused

import floatbase as fb
from floatbase.errors import InputError, UnknownNameError
from floatbase.friction import centre_of_pressure
from floatbase.objectives import AxisTask, CentreOfPressureTask, RelativePoseTask

robot = judges.every_robot
UP = np.array([0.0, 0.0, 1.0])
STEP = 1e-5  # s


def world_pose(state: fb.State, frame: str) -> np.ndarray:
    """Return the homogeneous matrix of a frame."""
    model, data = state.robot.model, state.robot.model.createData()
    pin.framesForwardKinematics(model, data, state.q)
    return np.array(data.oMf[state.robot.frame_id(frame)].homogeneous)


def relative_pose(frame: str, reference: str, state: fb.State) -> np.ndarray:
    return np.linalg.inv(world_pose(state, reference)) @ world_pose(state, frame)


def test_the_relative_pose_residual_is_the_relative_acceleration_less_the_desired_one(robot):
    for seed, state in enumerate(judges.states(robot.name, 4)):
        rng = np.random.default_rng(seed)
        robot, eom = state.robot, fb.equations_of_motion(state, judges.stance(state.robot))
        frame, reference = robot.frames[-1], str(rng.choice(robot.frames[:-1]))
        pose = partial(relative_pose, frame, reference)
        qdd, error = rng.normal(size=eom.nv), 0.5 * rng.normal(size=6)
        velocity, feed = rng.normal(size=(2, 6))
        target = np.eye(4)
        target[:3, 3] = pose(state)[:3, 3] - error[:3]
        target[:3, :3] = judges.rotation(-error[3:]) @ pose(state)[:3, :3]
        ahead, behind = (pose(judges.along(state, state.v, t))[:3, :3] for t in (STEP, -STEP))
        moving = judges.derivative(lambda s, f=pose: f(s)[:3, 3], state, state.v)
        rate = np.r_[moving, judges.turn_between(ahead, behind) / (2.0 * STEP)]
        linear = judges.acceleration_of(lambda s, f=pose: f(s)[:3, 3], state, qdd)
        angular = judges.turning_acceleration_of(lambda s, f=pose: f(s)[:3, :3], state, qdd)
        expected = np.r_[linear, angular] - (feed - 7.0 * error - 3.0 * (rate - velocity))
        all_three = (pin.SE3(target), velocity, feed)
        for given in (all_three, (lambda t, given=all_three: given,)):
            task = RelativePoseTask(frame, reference, *given, kp=7.0, kd=3.0)
            assert np.allclose(task.residual(eom)(qdd), expected, atol=5e-5)


def test_the_axis_residual_is_its_acceleration_on_the_sphere_less_the_desired_one(robot):
    for seed, state in enumerate(judges.states(robot.name, 4)):
        rng = np.random.default_rng(seed)
        eom = fb.equations_of_motion(state, judges.stance(state.robot))
        frame = state.robot.frames[-1]
        axis, direction, omega, alpha = rng.normal(size=(4, 3))
        qdd = rng.normal(size=eom.nv)

        def pointing(s: fb.State, frame: str = frame, axis: np.ndarray = axis) -> np.ndarray:
            return np.asarray(world_pose(s, frame)[:3, :3] @ axis / np.linalg.norm(axis))

        n, d = pointing(state), direction / np.linalg.norm(direction)
        rate = judges.derivative(pointing, state, state.v)
        acceleration = judges.acceleration_of(pointing, state, qdd)
        d_rate = np.cross(omega, d)
        d_acceleration = np.cross(alpha, d) + np.cross(omega, d_rate)
        normal = np.cross(d, n) / np.linalg.norm(np.cross(d, n))
        desired = np.cross(d, d_acceleration) - 7.0 * np.arccos(d @ n) * normal
        desired -= 3.0 * (np.cross(n, rate) - np.cross(d, d_rate))
        expected = np.cross(n, acceleration) - (desired - n * (n @ desired))
        all_three = (direction, omega, alpha)
        for given in (all_three, (lambda t, given=all_three: given,)):
            residual = AxisTask(frame, axis, *given, kp=7.0, kd=3.0).residual(eom)
            assert np.allclose(residual(qdd), expected, atol=5e-5)
            assert np.allclose(n @ residual.A, 0.0, atol=1e-12)  # rotation about it is free


def test_an_axis_opposite_to_its_direction_turns_by_half_a_turn_and_one_along_it_not_at_all():
    state = judges.load("go2").standing()
    eom = fb.equations_of_motion(state, fb.Contacts.none())
    n = state.frame_pose("base").rotation @ UP
    for direction, angle in ((n, 0.0), (-n, np.pi)):
        b = AxisTask("base", UP, direction, kp=1.0).residual(eom).b
        assert np.isclose(np.linalg.norm(b), angle, atol=1e-7) and abs(b @ n) < 1e-12


def test_the_pressure_residual_is_zero_at_the_centre_of_pressure_and_linear_in_the_forces():
    for robot_name in ("go2", "talos"):
        robot = judges.load(robot_name)
        state, contacts = robot.standing(), judges.stance(robot)
        eom = fb.equations_of_motion(state, contacts)
        rng = np.random.default_rng(0)
        n = eom.k // 3
        forces = np.column_stack([rng.normal(0.0, 20.0, (n, 2)), rng.uniform(1.0, 200.0, n)])
        centre = centre_of_pressure(state, contacts, forces)
        shift = np.array([0.03, -0.02, 0.0])
        total = forces[:, 2].sum()
        moment = [shift[1] * total, -shift[0] * total]
        for target, expected in ((centre, [0.0, 0.0]), (centre - shift, moment)):
            for given in (target, lambda t, target=target: target):
                residual = CentreOfPressureTask(given).residual(eom)
                assert np.allclose(residual(forces.ravel()), expected, atol=1e-9 * total)
                assert not np.any(residual.b)


def test_wrong_arguments_are_reported():
    eye = np.eye(4)
    refused(lambda: RelativePoseTask("base", "base", eye), InputError, "base")
    refused(lambda: RelativePoseTask("FL_foot", "base", 2.0 * eye), InputError, "pose")
    refused(lambda: RelativePoseTask("FL_foot", "base", np.diag([1, 1, -1, 1])), InputError)
    refused(lambda: AxisTask("base", np.zeros(3), UP), InputError, "axis")
    refused(lambda: AxisTask("base", UP, np.zeros(3)), InputError, "direction")
    robot = judges.load("go2")
    for task in (
        RelativePoseTask("FL_foot", "tail", eye),
        RelativePoseTask("tail", "base", eye),
        AxisTask("tail", UP, UP),
    ):
        with raises(UnknownNameError, "tail"):
            fb.WholeBodyController(robot, judges.stance(robot), [task])
