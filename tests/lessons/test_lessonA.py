"""Lesson A: its helpers do what they say, and effects go with their causes."""

import re

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.lessons import TorqueCommand
from floatbase.lessons.lessonA import elliptic_rotation, figure_of_eight, show_tumble, tool_error


def test_a_tumble_has_the_same_acceleration_in_both_frames():
    view, mass = fb.Viewer(judges.load("go2")), judges.load("go2").mass
    try:
        fast, slow, still = (show_tumble(view, *rates) for rates in ((3, 2), (1, 2), (3, 0)))
    finally:
        view.close()
    assert fast.endswith("0.0 m/s² apart") and still.endswith("0.0 m/s² apart")
    force, less = (float(re.findall(r"base's axes \((-?\d+),", text)[0]) for text in (fast, slow))
    assert abs(force + mass * 3.0 * 2.0) < 5  # N: m ω × v, backwards, and a few newtons of the legs
    assert abs(less - force - mass * 2.0 * 2.0) < 1  # N: the text has two digits


def sideways(robot, size=1.0, phase=90):
    """How far the feet of a robot travel to the left [mm] while its base goes round an ellipse."""
    state, contacts = robot.standing(), fb.Contacts.points(robot)
    com, upright, _ = fb.standing_tasks(state)
    loops = elliptic_rotation(pitch=0.3 * size, yaw=0.35 * size, rate=0.6, loops=6, phase=phase)
    base = fb.OrientationTask(upright.frame, loops)
    controller = fb.WholeBodyController(
        robot, contacts, [com, base, fb.PostureTask(state.q, weight=1e-3)]
    )
    run = fb.rollout(fb.Simulation(robot), controller, 10.2, control_period=0.002)
    return np.array([1000 * (run.final.point(f) - state.point(f))[1] for f in contacts.names])


@pytest.mark.front_end
def test_feet_travel_because_the_base_goes_round_an_area(go2):
    """Without an area, five millimetres remain; of 17 to 22."""
    assert abs(sideways(go2, phase=0)).max() < 5.5 < 15 < abs(sideways(go2)).min()


@pytest.mark.front_end
def test_front_and_rear_feet_travel_apart_only_if_all_knees_bend_the_same_way(go2):
    front_left, front_right, rear_left, rear_right = sideways(go2, 0.5)
    assert max(front_left, front_right) < -3 and min(rear_left, rear_right) > 3
    assert sideways(judges.load("solo12"), 0.5).max() < -3  # its front and hind knees bend apart


@pytest.mark.front_end
def test_errors_without_a_part_of_h_are_those_of_the_springs():
    """Springs twice as stiff halve the error, with the same damping ratio."""
    robot = judges.load("ur5")
    path, sim = figure_of_eight(robot.standing(), 3.0), fb.Simulation(robot)

    def error(stiffness, velocity_part, gravity):
        def controller(q, v, t):
            state, rest = fb.State(robot, q, v), fb.State(robot, q)
            q_path, v_path, a_path = path(t)
            damping = 2 * np.sqrt(stiffness) * (v_path - v)
            h = gravity * rest.h + velocity_part * (state.h - rest.h)
            return TorqueCommand(state.M @ (a_path + stiffness * (q_path - q) + damping) + h)

        sim.reset(fb.State(robot, *path(0)[:2]))
        return tool_error(fb.rollout(sim, controller, 3.0, control_period=0.002), path)

    for parts in ((0, 1), (1, 0)):
        assert error(3200, *parts) / error(1600, *parts) == pytest.approx(0.5, abs=0.05)
