"""Lesson B: the bench is the package's cylinder, and effects go with their causes."""

from dataclasses import replace
from itertools import pairwise

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.actuators import Cylinders, Delay, HydraulicActuators, Hydraulics
from floatbase.lessons import TorqueCommand
from floatbase.lessons.lessonB import Bench, hold_then_turn, run_force_loop

ROBOT = judges.load("go2")
KNEE = ROBOT.joint_names.index("FL_calf_joint")
ROUNDING = 1e-9  # N·m and Pa per Pa: the same formulas in another order


def knee(hydraulics):
    """The package's actuators with another supply, the cylinders' size that of the first."""
    actuators = HydraulicActuators(ROBOT, hydraulics)
    size = ROBOT.torque_limits / Hydraulics().weakest_torque
    actuators.cylinders = Cylinders(hydraulics, size, actuators.cylinders.max_lever_angle)
    actuators.reset()
    return actuators


def test_the_bench_equals_the_knee_of_go2():
    """Turned fast, out of reach, boiling: 0.4 s."""
    bandwidth, speed, wanted, supply = 1.0, 15.0, 12.0, 60e5
    hydraulics = Hydraulics(loop_bandwidth=bandwidth, supply_pressure=supply)
    actuators, motion = knee(hydraulics), hold_then_turn(speed)
    rows = run_force_loop(Bench(motion, wanted, hydraulics), bandwidth, 0.4)
    centre = actuators.cylinders.max_lever_angle
    for row, after in pairwise(rows):
        angle, velocity = motion(row.time)
        actuators.step(np.full(12, wanted), centre + angle, np.full(12, velocity), 1e-3)
        got = actuators.torques(centre + after.angle)[KNEE]
        assert after.torque == pytest.approx(got, abs=ROUNDING * 1e2)
        assert np.allclose(
            actuators.state.pressures[:, KNEE], [after.pressure_a, after.pressure_b], rtol=ROUNDING
        )


def test_the_bench_has_the_torque_rate_of_the_cylinders():
    cylinders, angle = HydraulicActuators(ROBOT).cylinders, 0.4
    bench = Bench(lambda t: (angle, 0.0))
    geometry = cylinders.geometry(cylinders.max_lever_angle + angle)
    _, _, _, pressure_a, pressure_b, _ = bench.samples[0]
    pressures = np.array([[pressure_a], [pressure_b]]) * np.ones(12)
    for side in (1.0, -1.0):
        rates = cylinders.pressure_rates(np.full(12, side), pressures, geometry, np.zeros(12))
        leaking = cylinders.pressure_rates(np.zeros(12), pressures, geometry, np.zeros(12))
        change = geometry.lever * cylinders.force(rates - leaking)
        assert bench.torque_rate(side) == pytest.approx(side * change[KNEE], rel=1e-9)


@pytest.mark.front_end
def test_the_longest_delay_does_not_depend_on_mass_and_legs():
    """solo12 has a sixth of go2's mass."""
    for name in ("go2", "solo12"):
        robot = judges.load(name)
        tasks = [replace(task, kp=100, kd=20) for task in fb.standing_tasks(robot.standing())]
        controller = fb.WholeBodyController(robot, fb.Contacts.points(robot), tasks)
        push = [0.0, 30.0 * robot.mass / ROBOT.mass, 0.0]
        for delay, stands in ((0.065, True), (0.070, False)):
            sim = fb.Simulation(robot)
            fb.rollout(sim, controller, 0.5)
            pushes, late = [fb.Push(push, start=sim.time + 0.1)], Delay(robot, delay)
            outcome = fb.rollout(sim, controller, 3.0, pushes, actuators=late).outcome
            assert (outcome == "completed") == stands, (name, delay, outcome)


@pytest.mark.front_end
def test_each_pair_of_joints_moves_the_body_its_own_way():
    """Too much torque at the hips moves go2 right, at the thighs forwards, at the knees upwards."""
    controller = fb.WholeBodyController(
        ROBOT, fb.Contacts.points(ROBOT), fb.standing_tasks(ROBOT.standing())
    )

    class TooMuch:
        def __init__(self, joint):
            self.joints = np.arange(12) % 3 == joint

        def step(self, tau, q, v, dt):
            return tau + 0.8 * self.joints

    for joint, axis, sign in ((0, 1, -1), (1, 0, 1), (2, 2, 1)):
        record = fb.rollout(fb.Simulation(ROBOT), controller, 0.2, actuators=TooMuch(joint))
        assert sign * (record.com[-1] - record.com[0])[axis] > 0.002


@pytest.mark.front_end
def test_planned_forces_and_the_weight_of_the_legs_do_not_hold_go2_without_springs():
    """Nothing pushes go2: it falls after 6 s, and with springs it stands."""
    contacts, start = fb.Contacts.points(ROBOT), ROBOT.standing()
    plan = fb.WholeBodyController(ROBOT, contacts, fb.standing_tasks(start))(start.q, start.v)

    def outcome(kp):
        def controller(q, v, t):
            state = fb.State(ROBOT, q, v)
            J = np.vstack([state.frame_jacobian(foot)[:3, 6:] for foot in contacts.names])
            springs = kp * (start.q[7:] - q[7:]) - kp / 40 * v[6:]
            return TorqueCommand(state.h[6:] - J.T @ np.ravel(plan.forces) + springs)

        return fb.rollout(fb.Simulation(ROBOT), controller, 8.0).outcome

    assert (outcome(0.0), outcome(100.0)) == ("fell", "completed")
