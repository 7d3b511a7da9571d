"""A robot: its numbers, its feet, its actuation matrix, the postures it stands in."""

import xml.etree.ElementTree as ElementTree

import example_robot_data
import judges
import numpy as np
import pinocchio as pin
import pytest
from messages import raises
from numpy.testing import assert_array_equal

import floatbase as fb
from floatbase.control import AnalyticController
from floatbase.errors import InputError
from floatbase.lessons import joint_servo


@pytest.fixture(params=judges.ROBOTS)
def robot(request):
    return judges.load(request.param)


@pytest.fixture(params=judges.FLOATING)
def floating(request):
    return judges.load(request.param)


def test_the_catalogue_holds_the_robots_of_the_course_with_their_descriptions():
    assert {"go2", "solo12", "solo8", "anymal_kinova", "talos", "ur5"} <= set(fb.catalogue())
    assert all(len(text) > 10 for text in fb.catalogue().values())


def test_a_floating_base_adds_six_velocities_that_no_motor_drives(robot):
    assert robot.nv - robot.d == (6 if robot.is_floating else 0)
    tau = np.random.default_rng(0).normal(size=robot.d)
    generalised = robot.S @ tau
    assert np.array_equal(generalised[: robot.nv - robot.d], np.zeros(robot.nv - robot.d))
    assert np.array_equal(generalised[robot.nv - robot.d :], tau)


def test_the_mass_is_the_sum_of_the_links_of_the_urdf(robot):
    root = ElementTree.fromstring(robot.urdf)
    masses = [float(mass.get("value")) for mass in root.findall("link/inertial/mass")]
    assert robot.mass == pytest.approx(sum(masses), rel=1e-9)
    assert robot.weight == pytest.approx(9.81 * sum(masses), rel=1e-9)


def test_the_joint_of_each_torque_is_named_in_the_order_of_tau(robot):
    tau = np.zeros(robot.d)
    for i, joint in enumerate(robot.joint_names):
        tau[i] = 1.0
        at = robot.model.idx_vs[robot.model.getJointId(joint)]
        assert (robot.S @ tau)[at] == 1.0
        tau[i] = 0.0


def test_torque_limits_are_positive_and_equal_the_urdfs_unless_another_source_is_named(robot):
    assert np.all(robot.torque_limits > 0)
    assert robot.torque_limits.shape == (robot.d,)
    joints = {j.get("name"): j for j in ElementTree.fromstring(robot.urdf).findall("joint")}
    urdf = [float(joints[name].find("limit").get("effort")) for name in robot.joint_names]
    limits = "torque limits" if "torque limits" in robot.sources else "torque limit"
    if robot.sources[limits] == "URDF":
        assert np.allclose(robot.torque_limits, urdf)
    else:
        assert np.all(robot.torque_limits < urdf)


def test_a_standing_robot_has_every_foot_on_the_ground_and_rests(floating):
    state = floating.standing()
    judge = judges.mujoco_of(floating.name).move_to(state)
    for foot in floating.feet:
        body = judge.body(foot.frame)
        R, p = judge.data.xmat[body].reshape(3, 3), judge.data.xpos[body]
        placement = floating.model.frames[floating.frame_id(foot.frame)].placement
        for local in foot.points:
            point = p + R @ (placement.rotation @ local + placement.translation)
            assert point[2] - foot.radius == pytest.approx(0.0, abs=1e-9)
    assert not np.any(state.v)


def test_a_standing_robot_has_its_centre_of_mass_over_its_feet(floating):
    from scipy.spatial import ConvexHull

    state = floating.standing()
    polygon = judges.stance(floating).positions(state)[:, :2]
    hull = ConvexHull(polygon)
    assert np.all(hull.equations @ np.append(state.com[:2], 1.0) < -0.01)


def test_a_robot_stands_at_the_requested_height(floating):
    usual = floating.standing()
    state = floating.standing(height=0.97 * usual.q[2])
    assert state.q[2] == pytest.approx(0.97 * usual.q[2], abs=1e-9)
    assert np.allclose(judges.stance(floating).positions(state)[:, 2], 0.0, atol=1e-9)


def test_a_low_stance_keeps_the_joint_limits_or_the_error_names_the_limit():
    """Without limits go2 would lie there with its hips 0.07 rad beyond theirs, and talos squat by
    1.5 rad too much.
    """
    go2, talos = judges.load("go2"), judges.load("talos")
    low = go2.standing(height=0.0)
    assert np.allclose(judges.stance(go2).positions(low)[:, 2], 0.0, atol=1e-9)
    assert np.all(low.q[7:] >= go2.model.lowerPositionLimit[7:])
    assert np.all(low.q[7:] <= go2.model.upperPositionLimit[7:])
    with raises(InputError, 0.3, "leg_left_4_joint", 2.62):
        talos.standing(height=0.3)


def test_a_reference_posture_beyond_a_limit_is_moved_by_a_whole_turn_where_that_suffices():
    theirs, robot = example_robot_data.load("kinova"), fb.load("kinova")
    data = theirs.model.createData()
    pin.framesForwardKinematics(theirs.model, data, theirs.q0)
    elbow = robot.model.idx_qs[robot.model.getJointId("j2s6s200_joint_3")]
    assert theirs.q0[elbow] < robot.model.lowerPositionLimit[elbow] <= robot.posture[elbow]
    for frame in robot.frames:
        placed = data.oMf[theirs.model.getFrameId(frame)]
        assert robot.standing().frame_pose(frame).isApprox(placed, 1e-9)


def test_a_robot_without_joints_falls_under_every_controller():
    robot = fb.load("hector", feet=[])
    state, contacts = robot.standing(), fb.Contacts.none()
    for controller in (
        fb.WholeBodyController(robot, contacts, fb.standing_tasks(state)),
        AnalyticController(robot, contacts, state),
    ):
        command = controller(state.q, state.v)
        assert command.tau.shape == (0,)
        assert np.allclose(command.qdd, [0.0, 0.0, -9.81, 0.0, 0.0, 0.0])
    assert joint_servo(state)(state.q, state.v, 0.0).tau.shape == (0,)


def test_a_seed_may_be_any_whole_number(go2):
    for seed in (3.0, np.int64(3), np.random.default_rng(3)):
        assert_array_equal(go2.random_state(seed).q, go2.random_state(3).q)


def test_joints_of_standing_and_random_states_keep_their_limits(robot):
    model = robot.model
    for state in [robot.standing(), *judges.states(robot.name, 10, spread=0.5)]:
        for joint in range(1, model.njoints):
            if model.nqs[joint] == 1:
                at = model.idx_qs[joint]
                lower, upper = model.lowerPositionLimit[at], model.upperPositionLimit[at]
                assert lower - 1e-9 <= state.q[at] <= upper + 1e-9


def test_random_states_are_the_same_for_the_same_seed_and_differ_for_others(robot):
    assert np.array_equal(robot.random_state(3).q, robot.random_state(3).q)
    assert np.array_equal(robot.random_state(3).v, robot.random_state(3).v)
    assert not np.allclose(robot.random_state(3).q, robot.random_state(4).q)
    assert not np.allclose(robot.random_state(3).v, robot.random_state(4).v)
