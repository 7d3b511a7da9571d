"""A run in the background: it goes on, it takes pushes, and whatever stops it is said."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.simulation.live import Live

ROBOT = judges.load("go2")
CONTROLLER = fb.WholeBodyController(ROBOT, fb.Contacts.points(ROBOT), fb.standing_tasks(ROBOT.standing()))


@pytest.fixture
def slices() -> list[fb.Rollout]:
    return []


@pytest.fixture
def run(slices: list[fb.Rollout]) -> Iterator[Live]:
    live = Live(fb.Simulation(ROBOT), CONTROLLER, slices.append)
    yield live
    live.close()


def until(condition: Callable[[], bool], seconds: float = 15.0) -> None:
    stop = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < stop, "waited in vain"
        time.sleep(0.01)


def test_it_runs_pauses_and_goes_on_where_it_was(run: Live, slices: list[fb.Rollout]) -> None:
    run.start()
    until(lambda: len(slices) > 3)
    run.pause()
    time.sleep(0.2)
    count = len(slices)
    time.sleep(0.2)
    assert len(slices) == count
    assert run.status == "paused"
    run.start()
    until(lambda: len(slices) > count)
    assert slices[count].time[0] == pytest.approx(slices[count - 1].time[-1] + 0.002)


def test_a_push_moves_the_robot(run: Live, slices: list[fb.Rollout]) -> None:
    run.start()
    run.push([0.0, 40.0, 0.0])
    until(lambda: any(abs(s.final.com[1]) > 2e-3 for s in slices))


@pytest.mark.parametrize("error", [ValueError("a slip of the pen"), np.linalg.LinAlgError("singular")])
def test_a_bug_in_a_controller_is_said_and_the_run_can_be_mended(run: Live, slices: list[fb.Rollout], error: Exception) -> None:
    def broken(q: np.ndarray, v: np.ndarray, t: float) -> fb.Command:
        raise error

    run.use(broken)
    run.start()
    until(lambda: run.status != "running")
    assert str(error) in run.status
    assert run.error is error
    run.use(CONTROLLER)
    run.start()
    until(lambda: len(slices) > 1)


def test_pushes_asked_for_before_a_reset_are_forgotten(run: Live, slices: list[fb.Rollout]) -> None:
    for _ in range(5):
        run.push([0.0, 200.0, 0.0])
    run.reset()
    until(lambda: len(slices) > 3)
    assert all(not s.pushes for s in slices[:3])
