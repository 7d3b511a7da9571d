"""`Jump`: its plan, its flight and its landing, and jumps that motors cannot do."""

from functools import cache

import judges
import numpy as np
import pytest
from messages import raises

import floatbase as fb
from floatbase.behaviours import Jump, JumpPlan
from floatbase.errors import InputError

PERIOD = 2e-3  # s


@cache
def jumped(name: str, height: float, distance: float) -> tuple[fb.Rollout, Jump]:
    robot = judges.load(name)
    jump = Jump(robot, fb.Contacts.feet(robot, mu=0.6), height, distance, start=0.05)
    return fb.rollout(fb.Simulation(robot), jump, 1.6, control_period=PERIOD), jump


CASES = [
    ("go2", 0.1, 0.0),
    ("go2", 0.2, 0.2),
    ("solo12", 0.1, 0.0),
    ("anymal_kinova", 0.15, 0.1),
    ("talos", 0.03, 0.0),
]


@pytest.mark.parametrize(("name", "height", "distance"), CASES)
def test_a_jump_reaches_its_height_and_distance(name, height, distance):
    run, _ = jumped(name, height, distance)
    assert run.outcome == "completed"
    rise = run.com[:, 2].max() - run.robot.standing().com[2]
    assert rise == pytest.approx(height, abs=0.01 + 0.05 * height)
    feet = run.foot_positions
    moved = (feet[-1] - feet[0]).mean(axis=0)
    assert moved[0] == pytest.approx(distance, abs=0.02)
    assert moved[1] == pytest.approx(0.0, abs=0.02)
    assert (feet[:, :, 2] - feet[0, :, 2]).min(axis=1).max() > height / 2.0  # all feet in the air
    tilt = np.arccos(1.0 - 2.0 * (run.q[:, 3] ** 2 + run.q[:, 4] ** 2))
    assert np.rad2deg(tilt.max()) < 30.0
    assert np.rad2deg(tilt[-1]) < 1.0
    assert np.linalg.norm(run.v[-1, :3]) < 0.4  # m/s: it rises slowly
    assert np.all(np.abs(run.tau) <= run.robot.torque_limits * (1.0 + 1e-9))


@pytest.mark.parametrize(
    ("impulse", "ground"), [((2.4, 0, 0), None), ((0, 2.4, 0), None), ((0, 0, 6), fb.Ground())]
)
def test_a_push_in_flight_is_no_landing(impulse, ground, go2):
    """Without a known ground, a push upwards cannot be told from a landing."""
    jump = Jump(go2, fb.Contacts.feet(go2, mu=0.6), 0.22, 0.0, start=0.05, ground=ground)
    push = fb.Push(np.array(impulse) / 0.1, start=jump.plan.apex + 0.02, duration=0.1)
    run = fb.rollout(fb.Simulation(go2), jump, 1.2, [push], PERIOD)
    assert run.outcome == "completed"


def test_the_same_jump_can_be_repeated():
    run, jump = jumped("go2", 0.1, 0.0)
    again = fb.rollout(fb.Simulation(run.robot), jump, 0.3, control_period=PERIOD)
    assert np.array_equal(again.tau, run.tau[: len(again)])
    assert jump.phase == "crouch"


@pytest.mark.parametrize(
    ("name", "height", "distance", "words"),
    [
        ("go2", 0.6, 0.0, ("speed", 15.7)),
        ("solo12", 0.3, 0.0, ("torque", 2.7)),
        ("talos", 0.05, 0.0, ("speed", 7)),
        ("go2", 0.1, 2.0, ("friction", 0.42)),
        ("go2", -0.1, 0.0, ("height", -0.1)),
    ],
)
def test_a_jump_that_motors_or_friction_cannot_do_is_refused(name, height, distance, words):
    robot = judges.load(name)
    with raises(InputError, *words):
        Jump(robot, fb.Contacts.feet(robot, mu=0.6), height, distance)


def test_a_jump_needs_a_foot(go2):
    with raises(InputError, "contacts"):
        Jump(go2, fb.Contacts.feet(go2).only(), 0.1)


@pytest.mark.parametrize(
    ("rise", "known"), [(0.1, True), (-0.2, True), (0.05, False), (-0.1, False)]
)
def test_a_jump_lands_on_ground_of_another_height(rise, known, go2):
    contacts = fb.Contacts.feet(go2, mu=0.6)
    edge = contacts.positions(go2.standing())[:, 0].max() + 0.03
    ground = fb.Ground.stairs(1, rise, start=edge)
    jump = Jump(go2, contacts, 0.2, 0.5, start=0.05, ground=ground if known else None)
    run = fb.rollout(fb.Simulation(go2, ground), jump, 2.2, control_period=PERIOD)
    assert run.outcome == "completed"
    assert jump.phase == "landing"
    feet = run.foot_positions
    assert feet[-1, :, 2] - feet[0, :, 2] == pytest.approx(rise, abs=0.005)
    assert run.com[-1, 2] - run.com[0, 2] == pytest.approx(rise, abs=0.01)
    distance = (feet[-1] - feet[0])[:, 0].mean()
    # a jump that does not know the ground lands earlier or later than planned
    assert distance == pytest.approx(0.5, abs=0.02 if known else 0.08)
    tilt = np.arccos(1.0 - 2.0 * (run.q[-1, 3] ** 2 + run.q[-1, 4] ** 2))
    assert np.rad2deg(tilt) < 1.0


def test_a_jump_plans_the_flight_to_the_height_of_the_ground():
    plan = JumpPlan.of(0.2, 0.5, 0.1, 0.3, 9.81, rise=0.1)
    t = plan.touchdown - plan.take_off
    assert plan.velocity[1] * t - 9.81 * t**2 / 2.0 == pytest.approx(0.1)
    assert plan.velocity[1] * (plan.apex - plan.take_off) / 2.0 == pytest.approx(0.2)
    with raises(InputError, "height", 0.2, 0.19):
        JumpPlan.of(0.2, 0.5, 0.1, 0.3, 9.81, rise=0.19)


def test_a_jump_refuses_to_land_in_a_gap(go2):
    contacts = fb.Contacts.feet(go2, mu=0.6)
    gap = fb.Ground.gap(0.3, start=0.25)
    with raises(InputError, "distance", 0.4, -0.5):
        Jump(go2, contacts, 0.15, 0.4, ground=gap)
    with raises(InputError, "ground", "height"):
        Jump(go2, contacts, 0.15, ground=0.3)


@pytest.mark.parametrize("limits", [12.0, np.full(12, 12.0)])
def test_a_dry_run_compares_with_the_given_torque_limits(limits, go2):
    contacts = fb.Contacts.feet(go2, mu=0.6)
    with raises(InputError, "torque", 12, 19):  # it needs 19 N·m, and go2 has 35 N·m in a knee
        Jump(go2, contacts, 0.15, 0.1, torque_limits=limits)
    Jump(go2, contacts, 0.15, 0.1, torque_limits=20.0)
