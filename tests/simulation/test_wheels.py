"""Robots on wheels in MuJoCo: they stand, drive and are pushed, and their records agree."""

import re
from functools import cache

import judges
import numpy as np
import pytest

import floatbase as fb

RADIUS, SPEED = 0.08, 0.5


@cache
def wheeled(spread: float = 0.0) -> fb.Robot:
    """A go2 with a driven wheel at each foot, whose legs lean outwards by an angle [rad]."""
    urdf = judges.load("go2").urdf
    wheel_joint = (
        r'_foot_joint" type="continuous"><axis xyz="0 0 1"/><limit effort="20" velocity="50"/>'
        r'<origin xyz="\1" rpy="-1.5707963268 0 0"'
    )
    urdf, n = re.subn(
        r'_foot_joint" type="fixed"[^>]*>\s*<origin xyz="([^"]*)" rpy="0 0 0"', wheel_joint, urdf
    )
    cylinder = f'<cylinder radius="{RADIUS}" length="0.04"/>'
    urdf, m = re.subn('<mesh filename="[^"]*foot_convex.stl" />', cylinder, urdf)
    assert n == m == 4
    posture = {"*_thigh_joint": 0.8, "*_calf_joint": -1.6}
    legs = {"*L_hip_joint": spread, "*R_hip_joint": -spread}
    return fb.load_urdf(urdf, posture=posture | legs, package_dirs=judges.load("go2").package_dirs)


@pytest.mark.parametrize("kind", ["wheels", "driven balls"])
def test_a_quadruped_drives_at_the_demanded_speed_and_a_push_does_not_stop_it(kind):
    robot = wheeled()
    wheels = [joint.endswith("_foot_joint") for joint in robot.joint_names]
    state, v = robot.standing(), np.r_[np.zeros(6), np.where(wheels, SPEED / RADIUS, 0.0)]
    contacts = fb.Contacts.feet(robot)
    if kind == "driven balls":
        contacts = fb.Contacts(
            [fb.dynamics.PointContact(name, radius=RADIUS) for name in contacts.names]
        )
    forwards = np.array([SPEED, 0.0, 0.0])
    tasks = [
        fb.CoMTask(lambda t: (state.com + forwards * t, forwards, np.zeros(3))),
        fb.OrientationTask(),
        fb.PostureTask(lambda t: (state.integrate(v * t), v[6:], np.zeros(robot.d))),
    ]
    controller = fb.WholeBodyController(robot, contacts, tasks)
    push = fb.Push([0.0, 30.0, 0.0], start=0.8, duration=0.1)
    run = fb.rollout(fb.Simulation(robot), controller, 2.0, [push])
    assert run.outcome == "completed"
    assert run.final.com_velocity == pytest.approx(forwards, abs=0.01)
    # the wheels roll: what they slide is less than a hundredth of the way
    way = run.com[-1, 0] - run.com[0, 0]
    assert run.slip().min() > 0.9 * way and run.slip(include_rolling=False).max() < 0.01 * way


def test_leaning_wheels_stand_on_their_rims_and_the_record_agrees_with_the_model():
    robot = wheeled(0.3)
    state, contacts = robot.standing(), fb.Contacts.feet(robot)
    assert np.abs(contacts.positions(state)[:, 2]).max() < 1e-10
    sim = fb.Simulation(robot)
    run = fb.rollout(sim, fb.WholeBodyController(robot, contacts, fb.standing_tasks(state)), 1.0)
    assert run.outcome == "completed" and run.slip(include_rolling=False).max() < 2e-3
    expected = contacts.positions(run.state(-1))
    assert np.abs(run.foot_positions[-1] - expected).max() < 1e-6
    touching = {sim.model.geom(contact.geom[1]).name: contact.pos for contact in sim.data.contact}
    assert np.abs([touching[name] for name in contacts.point_names] - expected).max() < 1e-3
    assert np.abs(run.measured[-1] - run.planned[-1]).max() < 1e-3 * robot.weight
    forces = run.measured[-1].reshape(-1, 3)
    assert np.all(np.hypot(*forces[:, :2].T) < contacts.mus * forces[:, 2])
