"""App. B: the pure delay is a shift, the first-order lag its closed form; both take their place in
a rollout.
"""

import judges
import numpy as np
import pytest
from messages import raises, refused
from waiting import until

import floatbase as fb
from floatbase.actuators import Delay, FirstOrderLag
from floatbase.errors import InputError
from floatbase.simulation import LiveSimulation

ROBOT = judges.load("go2")
STILL = np.zeros(12)
ROUNDING = 1e-12  # of torques near 1 N·m: sums and powers of a few hundred numbers
WANTED = np.random.default_rng(4).normal(size=(40, 12))  # N·m, other torques in every step


def got(late: Delay | FirstOrderLag, wanted: np.ndarray, dt: float = 1e-3) -> np.ndarray:
    """The torques of each step, shape (n, 12), N·m."""
    return np.array([late.step(tau, STILL, STILL, dt) for tau in wanted])


# delay


@pytest.mark.parametrize("steps", [0, 1, 7, 40])
def test_a_delay_of_whole_steps_shifts_the_torques_and_changes_no_digit(steps):
    late = Delay(ROBOT, steps * 1e-3)
    assert np.array_equal(got(late, WANTED), np.vstack([np.zeros((steps, 12)), WANTED])[:40])


def test_a_delay_of_a_quarter_step_mixes_the_last_torques_with_the_new_ones():
    old = np.vstack([np.zeros(12), WANTED[:-1]])
    expected = 0.25 * old + 0.75 * WANTED
    assert np.allclose(got(Delay(ROBOT, 0.25e-3), WANTED), expected, atol=ROUNDING)


@pytest.mark.parametrize("delay", [0.7e-3, 3e-3, 1e-2 / 3.0])
def test_the_length_of_the_steps_changes_nothing_but_the_grid(delay):
    """Four steps of 0.25 ms have the mean of one of 1 ms, with four different torques."""
    fine = got(Delay(ROBOT, delay), np.repeat(WANTED, 4, axis=0), 0.25e-3)
    expected = got(Delay(ROBOT, delay), WANTED)
    assert np.allclose(fine.reshape(40, 4, 12).mean(axis=1), expected, atol=ROUNDING)


def test_a_delay_stays_as_long_as_it_was_after_ten_thousand_steps():
    late, dt = Delay(ROBOT, 0.02), 1e-3 / 3.0
    for _ in range(10_000):
        late.step(STILL, STILL, STILL, dt)
    came = got(late, np.ones((100, 12)), dt)[:, 0]
    # s: missing under a step of 1; 1 ns a step
    assert np.sum(1.0 - came) * dt == pytest.approx(0.02, abs=1e-7)


# first-order lag


@pytest.mark.parametrize("bandwidth", [0.5, 3.0, 50.0])
def test_a_lags_step_response_is_its_closed_form(bandwidth):
    times = 1e-3 * np.arange(1, 301)
    closed = 12.0 * (1.0 - np.exp(-2.0 * np.pi * bandwidth * times))
    answer = got(FirstOrderLag(ROBOT, bandwidth), np.full((300, 12), 12.0))
    assert np.allclose(answer.T, closed, atol=12.0 * ROUNDING)


# both


@pytest.mark.parametrize("late", [Delay(ROBOT, 5e-3), FirstOrderLag(ROBOT, 5.0)])
def test_a_reset_puts_torques_under_way_or_none(late):
    held = np.linspace(-20.0, 20.0, 12)
    got(late, WANTED)
    late.reset(held, STILL)
    assert np.allclose(got(late, np.tile(held, (10, 1))), held, atol=ROUNDING)
    late.reset()
    assert not np.any(got(late, np.zeros((10, 12))))


def test_torques_on_their_way_cannot_be_changed_from_outside():
    late, wanted = Delay(ROBOT, 1e-3), np.ones(12)
    late.step(wanted, STILL, STILL, 1e-3)
    wanted[:] = 9.0
    assert np.array_equal(late.step(STILL, STILL, STILL, 1e-3), np.ones(12))
    lag = FirstOrderLag(ROBOT, 1.0)
    lag.step(wanted, STILL, STILL, 1e-3)
    assert not lag.tau.flags.writeable


def test_a_rollout_through_a_delay_gets_the_torques_of_earlier_ticks():
    sim, controller = fb.Simulation(ROBOT), judges.controller_of("go2")
    late = Delay(ROBOT, 4e-3)
    late.reset(controller(sim.q, sim.v).tau, sim.q[7:])
    rollout = fb.rollout(sim, controller, 0.05, actuators=late)
    assert rollout.outcome == "completed"
    assert np.array_equal(rollout.tau[4:], rollout.tau_desired[:-4])
    assert np.array_equal(rollout.tau[:4], np.tile(rollout.tau_desired[0], (4, 1)))


def test_go2_stands_live_through_a_lag():
    sim = fb.Simulation(ROBOT)
    controller = judges.controller_of("go2")
    lag = FirstOrderLag(ROBOT, 20.0)
    lag.reset(controller(sim.q, sim.v).tau)
    records: list[fb.Rollout] = []
    live = LiveSimulation(sim, controller, records.append, actuators=lag)
    live.start()
    until(lambda: bool(records))
    live.close()
    assert records and not np.array_equal(records[0].tau, records[0].tau_desired)


def test_a_delay_of_many_seconds_is_refused():
    refused(lambda: Delay(ROBOT, 11.0), InputError, "delay", 11)


def test_actuators_of_another_robot_are_refused():
    sim, late = fb.Simulation(ROBOT), Delay(judges.load("solo12"), 0.0)
    with raises(InputError, "actuators", "solo12", "go2"):
        fb.rollout(sim, judges.controller_of("go2"), 0.01, actuators=late)
