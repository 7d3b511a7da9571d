"""Lesson 10: its pendulum, and the causes that it names, each taken away."""

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.behaviours import MPC, Gait, Walk, raibert_foothold
from floatbase.lessons import all_exercises
from floatbase.lessons.lesson08 import run_go2
from floatbase.lessons.lesson10 import make_controller, make_walking_controller, plan_pendulum

GAP = 0.24  # m: where the gap of the lesson begins


def test_the_closed_form_of_the_pendulum_solves_the_least_squares_problem():
    exercise, rng = all_exercises()["10.1"], np.random.default_rng(10)
    names = {"np": np, **exercise.namespace()}
    exec(exercise.solution, names)
    for n in (1, 4, 25):
        x, middles = 0.1 * rng.normal(size=2), 0.3 * rng.normal(size=n)
        assert np.allclose(plan_pendulum(x, middles), names["horizon"](x, middles), atol=1e-9)


@pytest.mark.parametrize(("n", "survives"), [(13, False), (14, True)])
def test_a_step_of_20_cm_needs_a_horizon_of_14_intervals(n, survives):
    names = all_exercises()["10.2"].namespace()
    x, feet = np.zeros(2), np.repeat([0.0, 0.2], [50, 80])
    for k in range(100):
        p = plan_pendulum(x, feet[k : k + n])[0]
        x = names["A"] @ x + names["B"] * np.clip(p, feet[k] - 0.05, feet[k] + 0.05)
    assert (abs(x[0] - 0.2) < 0.05) == survives


def mpc(gait, velocity, **options):
    robot = judges.load("go2")
    contacts = fb.Contacts.points(robot, mu=0.7)
    return MPC(robot, contacts, gait, (velocity, 0.0), acceleration=(2, 1), **options)


@pytest.mark.front_end
@pytest.mark.parametrize(("n", "bounce"), [(1, False), (1, True), (3, False), (10, False)])
def test_a_long_flight_after_a_quick_start_needs_a_horizon(n, bounce):
    gait = Gait.flying_trot(judges.load("go2"), stance=0.1, flight=0.12, start=0.2)
    run = run_go2(mpc(gait, 1.0, n=n, bounce=bounce), 2.6)
    assert run.outcome == ("fell" if n == 1 else "completed")


@pytest.mark.front_end
def test_a_push_moves_the_body_by_the_time_that_is_looked_ahead_not_by_the_intervals():
    gait = Gait.trot(judges.load("go2"), start=0.2)
    moved = [
        run_go2(mpc(gait, 0.3, n=n, dt=dt, solve_period=0.01), 1.8, [0, 200, 0], 0.6).com[-1, 1]
        for n, dt in ((10, 0.01), (3, 0.03), (10, 0.03))
    ]
    assert abs(moved[0] - moved[1]) < 0.06 < abs(moved[0] - moved[2])


@pytest.mark.front_end
@pytest.mark.parametrize("n", [1, 10])
def test_no_horizon_survives_a_push_if_footholds_cannot_change(n):
    walk = make_controller(n)
    options = {"n": n, "adjustment": lambda plan, path, com, velocity, t: {}}
    still = MPC(walk.robot, walk.contacts, Gait.trot(walk.robot, start=0.0), **options)
    outcomes = [run_go2(each, 2.0, [0, 100, 0], start=0.2).outcome for each in (walk, still)]
    assert outcomes == ["completed", "fell"]


@pytest.mark.front_end
@pytest.mark.parametrize("make", [make_controller, make_walking_controller])
def test_half_a_period_later_the_other_pair_of_feet_is_weak(make):
    for start, weak in ((0.2, 135.0), (0.45, 45.0)):
        for angle in np.deg2rad([45.0, 135.0]):
            push = 300.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
            outcome = run_go2(make(), 2.5, push, start).outcome
            assert (outcome == "fell") == np.isclose(angle, np.deg2rad(weak))


def across(kind, width, limit=None):
    """Whether a trot crosses a gap, by its own rule or by one that leaves the bottom out."""
    robot = judges.load("go2")
    ground = fb.Ground.gap(width, depth=0.3, start=GAP)
    begin, end = GAP - 0.065, GAP + width + 0.065

    def beside(foot, touchdown, walk):
        x, y = raibert_foothold(foot, touchdown, walk)
        near = begin if x < GAP + width / 2 else end
        return np.array([near if begin < x < end and abs(near - x) <= limit else x, y])

    options = {"ground": ground} if limit is None else {"foothold": beside}
    contacts, gait = fb.Contacts.points(robot, mu=0.7), Gait.trot(robot, start=0.2)
    walk = kind(robot, contacts, gait, (0.4, 0.0), **options)
    run = fb.rollout(fb.Simulation(robot, ground), walk, 3.0, control_period=2e-3)
    return run.outcome == "completed" and run.foot_positions[:, :, 2].min() > -0.01


@pytest.mark.front_end
@pytest.mark.parametrize("kind", [Walk, MPC])
def test_a_trot_crosses_a_gap_if_its_footholds_leave_the_bottom_out_and_may_move_far_enough(kind):
    assert not across(kind, 0.2)
    assert not across(kind, 0.2, limit=0.15)
    assert across(kind, 0.2, limit=0.2)


@pytest.mark.front_end
def test_a_gap_within_the_limit_of_15_cm_is_crossed_only_if_its_bottom_has_no_level_place():
    assert across(Walk, 0.12) and not across(Walk, 0.16)
