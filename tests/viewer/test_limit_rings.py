"""Rings at joints near a position limit and at joints whose limit is active."""

from contextlib import closing
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from messages import refused
from numpy.testing import assert_allclose, assert_array_equal

import floatbase as fb
from floatbase.control import JointLimits
from floatbase.errors import InputError
from floatbase.viewer.export.recording import joint_limits_at
from floatbase.viewer.scene.colours import ALARM, WARNING
from floatbase.viewer.scene.threejs import colour_number

from .test_recording import tracks

JOINT = "FL_calf_joint"


def at_fraction(robot, joint, fraction):
    """Return the standing state with a joint at a fraction of its range."""
    i, limits, q = robot.joint_names.index(joint), JointLimits.of(robot), robot.standing().q.copy()
    q[robot.nq - robot.d + i] = (1.0 - fraction) * limits.lower[i] + fraction * limits.upper[i]
    return fb.State(robot, q)


def rings(paths):
    """Return the kind of each joint's ring."""
    parts = (path.split("/") for path in paths if "_limit/" in path)
    return {joint: kind for kind, joint in parts}


def owners(command):
    """Return the joints with an active limit, from the multipliers."""
    ends = ("position limit", "velocity limit")
    return {label.owner for label in command.active if label.kind.endswith(ends)}


@pytest.fixture(scope="module")
def commands():
    """Commands of the controller in `stretched`."""
    return []


@pytest.fixture(scope="module")
def stretched(go2, commands):
    """A run in which the robot rises until its knees are at their limits."""
    standing, contacts = go2.standing(), fb.Contacts.points(go2, mu=0.7)
    rise = fb.CoMTask(standing.com + [0.0, 0.0, 0.3])
    tasks = [rise if isinstance(t, fb.CoMTask) else t for t in fb.standing_tasks(standing)]
    controller = fb.WholeBodyController(go2, contacts, tasks)

    def record(q, v, t):
        commands.append(controller(q, v, t))
        return commands[-1]

    return fb.rollout(fb.Simulation(go2), record, 0.3)


@pytest.mark.parametrize(
    ("fraction", "is_near"),
    [(-0.01, True), (0.04, True), (0.06, False), (0.5, False), (0.94, False), (0.96, True)],
)
def test_a_joint_near_a_limit_has_a_ring(viewer, go2, fraction, is_near):
    state = at_fraction(go2, JOINT, fraction)
    viewer.show(state)
    assert rings(viewer.renderer.picture) == ({JOINT: "near_limit"} if is_near else {})
    viewer.show(state, joint_limits=False)
    assert rings(viewer.renderer.picture) == {}


@pytest.mark.parametrize("robot", ["go2", "talos"], indirect=True)
def test_a_ring_is_around_the_axis_of_its_joint(robot):
    with closing(fb.Viewer(robot)) as view:
        for joint in robot.joint_names[:7]:
            state = at_fraction(robot, joint, 0.99)
            matrix = view.show(state).renderer.picture[f"near_limit/{joint}"].matrix
            index, turn = robot.model.getJointId(joint), np.zeros(robot.nv)
            turn[robot.model.idx_vs[index]] = 0.1
            turned = fb.State(robot, pin.integrate(robot.model, state.q, turn))
            before, after = (at.joint_transforms[index] for at in (state, turned))
            axis = pin.log3(after[:3, :3] @ before[:3, :3].T) / 0.1
            assert_allclose(matrix[:3, 3], before[:3, 3], atol=1e-9)
            assert_allclose(matrix[:3, 2] / np.linalg.norm(matrix[:3, 2]), axis, atol=1e-6)


def test_a_ring_is_vermilion_while_the_controllers_limit_is_active(viewer, stretched, commands):
    seen = set()
    for i in range(0, len(stretched), 10):
        command = commands[i]
        viewer.show(stretched.state(i), command.contacts, qdd=command.qdd)
        drawn = rings(viewer.renderer.picture)
        assert {j for j, kind in drawn.items() if kind == "active_limit"} == owners(command)
        seen |= set(drawn.values())
        for joint, kind in drawn.items():
            colour = ALARM if kind == "active_limit" else WARNING
            material = viewer.renderer.picture[f"{kind}/{joint}"].shape.data["materials"][0]
            assert material["color"] == colour_number(colour)
    assert seen == {"near_limit", "active_limit"}


def test_rings_appear_in_a_recording_when_limits_are_active(viewer, stretched, commands):
    viewer.play(stretched, rate=100.0)
    moving, hidden = tracks(viewer), 0
    for joint in {joint for command in commands for joint in owners(command)}:
        times, visible = moving[f"active_limit/{joint}", ".visible"]
        rows = np.round(times / 1e-3).astype(int)
        expected = [joint in owners(commands[i]) for i in rows]
        assert_array_equal(visible[:, 0].astype(bool), expected)
        hidden += expected.count(False)
    assert hidden


def test_a_rollout_has_the_planned_accelerations(go2, stretched, commands):
    assert_array_equal(stretched.planned_qdd, [command.qdd for command in commands])
    torques = SimpleNamespace(tau=np.zeros(go2.d))
    run = fb.rollout(fb.Simulation(go2), lambda q, v, t: torques, 0.01)
    assert run.planned_qdd is not None and run.planned_qdd.shape == (len(run), go2.nv)
    assert np.isnan(run.planned_qdd).all() and run.joint_limits is None


def test_active_rings_follow_the_limits_of_the_controller(viewer, go2):
    standing, contacts = go2.standing(), fb.Contacts.points(go2)
    rise = fb.CoMTask(standing.com + [0.0, 0.0, 0.05], kp=400.0)
    tasks = [rise, *fb.standing_tasks(standing)[1:]]
    tight = JointLimits.of(go2, acceleration=np.full(go2.d, 1.0))
    for limits, expected in ((tight, {"active_limit"}), (None, set())):
        controller = fb.WholeBodyController(go2, contacts, tasks, joint_limits=limits)
        run = fb.rollout(fb.Simulation(go2), controller, 0.01)
        assert run.joint_limits is limits
        viewer.show(run.state(0), **joint_limits_at(run, 0))
        assert set(rings(viewer.renderer.picture).values()) == expected


def test_limits_may_be_given_and_arguments_that_do_not_fit_are_refused(viewer, go2):
    standing, limits = go2.standing(), JointLimits.of(go2)
    upper = limits.upper.copy()
    upper[2] = standing.q[7 + 2] + 0.01
    viewer.show(standing, joint_limits=replace(limits, upper=upper))
    assert rings(viewer.renderer.picture) == {JOINT: "near_limit"}
    one_sided = replace(limits, lower=np.full(12, -np.inf), upper=upper)
    viewer.show(standing, joint_limits=one_sided)
    assert rings(viewer.renderer.picture) == {}
    for wrong, *named in (
        (lambda: viewer.show(standing, joint_limits="robot"), "joint_limits", "robot"),
        (lambda: viewer.show(standing, joint_limits=JointLimits.of(fb.load("ur5"))), 6, 12),
        (lambda: viewer.show(standing, qdd=np.zeros(12)), "qdd", 12, 18),
        (lambda: viewer.show(standing, qdd=np.full(18, np.nan)), "qdd", np.nan),
    ):
        refused(wrong, InputError, *named)
