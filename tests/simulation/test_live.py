"""Runs in the background: they continue, take pushes, and report why they stopped."""

import copy
import threading
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import judges
import numpy as np
import pytest
from numpy.testing import assert_allclose
from waiting import until

import floatbase as fb
from floatbase.control import Command
from floatbase.errors import SimulationError
from floatbase.simulation import LiveSimulation
from floatbase.viewer import PUSH_DISPLAY_TIME
from floatbase.viewer.export.recording import push_at

ROBOT = judges.load("go2")


@cache
def controller() -> fb.WholeBodyController:
    return fb.WholeBodyController(
        ROBOT, fb.Contacts.points(ROBOT), fb.standing_tasks(ROBOT.standing())
    )


@pytest.fixture
def slices() -> list[fb.Rollout]:
    return []


@pytest.fixture
def run(slices: list[fb.Rollout]) -> Iterator[LiveSimulation]:
    live = LiveSimulation(
        fb.Simulation(ROBOT), controller(), slices.append, push_memory=PUSH_DISPLAY_TIME
    )
    yield live
    live.close()


def test_it_runs_pauses_and_goes_on_where_it_was(run, slices):
    run.start()
    until(lambda: len(slices) > 3)
    run.close()  # pauses, and waits for the last slice
    count = len(slices)
    assert run.status == "paused"
    run.start()
    until(lambda: len(slices) > count)
    assert slices[count].time[0] == pytest.approx(slices[count - 1].time[-1] + 0.002)


@pytest.mark.parametrize(
    "error", [ValueError("a slip of the pen"), np.linalg.LinAlgError("singular")]
)
def test_an_error_in_a_controller_is_reported_and_the_run_can_go_on_with_another(
    run, slices, error
):
    def broken(q: np.ndarray, v: np.ndarray, t: float) -> Command:
        raise error

    run.set_controller(broken)
    assert run.controller is broken
    run.start()
    until(lambda: run.status != "running")
    assert run.status == "stopped" and str(error) in run.reason
    assert run.error is error
    run.set_controller(controller())
    run.start()
    until(lambda: len(slices) > 1)


class Held:
    """A `show` that holds the run in the middle of a slice after `hold`, for certain timing."""

    def __init__(self) -> None:
        self.slices: list[fb.Rollout] = []
        self.go_on, self.inside = threading.Event(), threading.Event()
        self.go_on.set()
        self.outcome: str | None = None

    def __call__(self, record: fb.Rollout) -> None:
        self.slices.append(record)
        if self.outcome in (None, record.outcome):
            self.inside.set()
            assert self.go_on.wait(15.0)

    def hold(self, outcome: str | None = None) -> None:
        """Hold the next slice with the given outcome, or with any."""
        self.outcome = outcome
        self.inside.clear()
        self.go_on.clear()


@pytest.fixture
def held() -> Held:
    return Held()


@pytest.fixture
def held_run(held: Held) -> Iterator[LiveSimulation]:
    live = LiveSimulation(fb.Simulation(ROBOT), controller(), held)
    yield live
    held.go_on.set()
    live.close()


@pytest.mark.parametrize("after", [[], [(0.0, 30.0)]])
def test_a_reset_forgets_the_pushes_before_it_and_none_after_it(held_run, held, after):
    held.hold()
    held_run.start()
    assert held.inside.wait(15.0)
    for _ in range(5):
        held_run.push([0.0, 200.0, 0.0])
    held_run.reset()
    for _, force in after:
        held_run.push([0.0, force, 0.0])
    count = len(held.slices)
    held.go_on.set()
    until(lambda: len(held.slices) > count + 3)
    first = held.slices[count]
    assert first.time[0] == 0.0
    assert [(push.start, push.force[1]) for push in first.pushes] == after


HARD = ([0.0, 0.0, -1200.0], 0.3)  # N, s: a downward push that no controller withstands


def test_the_same_push_after_a_fall_has_the_same_result_every_time(run, slices):
    falls = []
    for _ in range(5):
        count = len(slices)
        run.push(*HARD)
        until(lambda: run.status != "running")
        run.close()
        assert run.status == "fell"
        last = next(i for i, record in enumerate(slices) if i >= count and record.outcome == "fell")
        falls.append(slices[count : last + 1])  # without those after the fall
    for fall in falls:
        assert fall[0].time[0] == 0.0
        assert [(p.start, *p.force) for p in fall[0].pushes] == [(0.0, *HARD[0])]
        assert fall[-1].time[-1] == falls[0][-1].time[-1]
        assert_allclose(fall[-1].final.q, falls[0][-1].final.q, atol=1e-9)


def test_a_push_is_not_lost_however_late_the_thread_comes_to_the_reset(run, slices):
    """The next thread waits for the last one, which is held here while it reports the fall."""
    go_on = threading.Event()
    run.on_status(lambda status: status == "fell" and go_on.wait(15.0))
    run.push(*HARD)
    until(lambda: run.status == "fell")
    count = len(slices)
    run.start()  # resets; the push is requested before the thread can have reset
    run.push([0.0, 30.0, 0.0])
    go_on.set()
    until(lambda: len(slices) > count)
    assert [p.force[1] for p in slices[count].pushes] == [30.0]


def test_a_reset_or_a_pause_that_crosses_a_fall_is_kept(held_run, held):
    def fall() -> None:
        held.hold("fell")
        held_run.push(*HARD)
        assert held.inside.wait(15.0)

    def go_on() -> float:
        """Return the time at which the next slice begins."""
        count = len(held.slices)
        held.go_on.set()
        until(lambda: len(held.slices) > count)
        return float(held.slices[count].time[0])

    fall()
    held_run.reset()
    assert (go_on(), held_run.status) == (0.0, "running")

    fall()
    held_run.pause()
    held.go_on.set()
    until(lambda: held_run.status == "fell")

    fall()
    held_run.pause()
    held_run.start()
    assert (go_on(), held_run.status) == (0.0, "running")


def threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "floatbase-live"]


def test_a_pause_ends_the_thread_and_a_close_has_ended_it(run, slices):
    before = len(threads())
    run.start()
    until(lambda: len(slices) > 0)
    run.pause()
    until(lambda: len(threads()) == before)
    run.start()
    run.close()
    assert len(threads()) == before


def test_it_runs_after_a_start_that_crosses_a_close(run, slices):
    for _ in range(10):
        run.start()
        closing = threading.Thread(target=run.close)
        closing.start()
        run.start()
        closing.join()
        if run.status == "running":
            count = len(slices)
            until(lambda count=count: len(slices) > count)
        run.close()
        assert run.status == "paused"
    # one thread at a time
    assert all(late.time[0] > early.time[-1] for early, late in pairwise(slices))


def test_each_change_of_status_is_reported(run, slices):
    told: list[str] = []
    run.on_status(told.append)
    run.start()
    run.start()
    until(lambda: len(slices) > 0)
    run.pause()
    run.push(*HARD)
    run.start()
    until(lambda: run.status == "fell")
    assert told == ["running", "paused", "running", "fell"]


def test_a_forgotten_run_pauses_by_itself(slices):
    run = LiveSimulation(fb.Simulation(ROBOT), controller(), slices.append, idle_timeout=0.2)
    run.start()
    until(lambda: run.status == "idle")
    assert slices
    before = slices[-1].time[-1]
    run.start()  # continues from there
    until(lambda: run.status == "idle" and slices[-1].time[-1] > before)
    run.close()


def test_a_push_is_on_record_until_it_has_been_seen(run, slices):
    run.push([0.0, 20.0, 0.0], duration=0.1)
    run.start()
    until(lambda: bool(slices) and slices[-1].time[-1] > 1.0)
    run.pause()
    shown = [(s.time[-1], push_at(s, -1, PUSH_DISPLAY_TIME)) for s in slices]
    assert {push is not None for t, push in shown if t < 0.1 + PUSH_DISPLAY_TIME - 0.01} == {True}
    assert {push is not None for t, push in shown if t > 0.1 + PUSH_DISPLAY_TIME + 0.01} == {False}
    assert not any(push_at(s, -1) for s in slices if s.time[-1] > 0.1)


def test_actuators_stand_between_and_begin_anew_with_the_robot(slices):
    class Delay:
        """Actuators that give the torques desired one step earlier."""

        resets = steps = 0
        last = controller()(ROBOT.standing().q, np.zeros(ROBOT.nv)).tau

        def reset(self) -> None:
            self.resets += 1

        def step(self, tau: np.ndarray, q: np.ndarray, v: np.ndarray, dt: float) -> np.ndarray:
            self.last, now = tau, self.last
            self.steps += 1
            return now

    delay, sim = Delay(), fb.Simulation(ROBOT)
    options = {"actuators": delay, "after_reset": delay.reset}
    run = LiveSimulation(sim, controller(), slices.append, **options)
    run.start()
    until(lambda: len(slices) > 3)
    run.close()
    assert delay.steps == sum(len(s) for s in slices) * 2  # steps of the physics, two for each tick
    desired = 0.5 * (slices[0].tau_desired[-1] + slices[1].tau_desired[0])
    assert_allclose(slices[1].tau[0], desired, atol=1e-9)
    run.reset()
    until(lambda: delay.resets == 1)
    run.close()


def test_another_world_controller_and_period_are_taken_between_slices(run, slices):
    run.start()
    until(lambda: len(slices) > 2)
    ice, seen = fb.Simulation(ROBOT, 0.3), list[threading.Thread]()

    def change() -> None:
        seen.append(threading.current_thread())
        run.set_controller(controller(), sim=ice, control_period=5e-3)

    run.call_soon(change)
    until(lambda: run.sim is ice)
    count = len(slices)  # the present slice may have begun before
    until(lambda: len(slices) > count + 1 and slices[-1].time[-1] > 0.1)
    assert np.allclose(np.diff(slices[-1].time), 5e-3)
    assert seen[0] is not threading.main_thread()


def test_an_error_in_a_change_is_reported(run, slices):
    def fail() -> None:
        raise ValueError("no such world")

    run.start()
    run.call_soon(fail)
    until(lambda: run.status != "running")
    assert "no such world" in run.reason
    run.reset()
    until(lambda: run.status == "running" and len(slices) > 1)


def test_a_second_thread_cannot_use_a_simulation_that_runs():
    sim = fb.Simulation(judges.load("go2"))
    refused: list[Exception] = []

    def use() -> None:
        for call in (sim.reset, lambda: sim.step(np.zeros(12))):
            try:
                call()
            except Exception as error:
                refused.append(error)

    def controller(q: object, v: object, t: float) -> SimpleNamespace:
        thread = threading.Thread(target=use)
        thread.start()
        thread.join()
        return SimpleNamespace(tau=np.zeros(12))

    fb.rollout(sim, controller, sim.timestep)
    assert [type(error) for error in refused] == [SimulationError] * 2
    assert sim.time == sim.timestep
    use()
    assert len(refused) == 2 and copy.copy(sim).time == sim.timestep
