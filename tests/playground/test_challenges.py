"""Challenges have solutions, are not won by waiting, and notice changes of locked settings."""

from collections.abc import Callable

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.playground import CHALLENGES, PERIOD, Challenge, Judge, Session

GO2 = judges.load("go2")
SLICE = 1.0 / 30.0  # s
BY_TITLE = {challenge.title: challenge for challenge in CHALLENGES}

Act = Callable[[Session], "fb.Push | None"]


def change(**changes: object) -> Act:
    def act(session: Session) -> None:
        if session.change(**changes):
            session.sim.reset()
            session.after_reset()

    return act


def push(force: float, towards: float) -> Act:
    angle = np.deg2rad(towards)
    vector = force * np.array([np.cos(angle), np.sin(angle), 0.0])
    return lambda session: fb.Push(vector, session.sim.time)


LIFT_TWO, LIFT_ONE = change(lifted_feet=("FR_foot", "RL_foot")), change(lifted_feet=("FL_foot",))
SOLUTIONS: dict[str, list[tuple[float, Act]]] = {
    "Stand on two feet": [(0.0, change(com_shift=(-0.02, 0.0, 0.0))), (0.5, LIFT_TWO)],
    "Survive 300 N": [(0.0, change(steps_when_pushed=True)), (0.3, push(300.0, 90.0))],
    "Down an icy slope": [(0.0, change(slope=(20.0, 20.0), friction=(0.2, 0.2)))],
    "On an edge": [(0.0, change(friction=(0.1, 0.7))), (0.5, push(60.0, 45.0))],
    "Infeasible": [(0.2, change(torque_fraction=0.1, min_normal_force=60.0))],
    "Quick foot": [(0.0, change(com_shift=(-0.05, -0.03, 0.0))), (1.0, LIFT_ONE)],
    "Feet that travel": [(0.0, change(nod=0.3))],
    "On ice": [(0.0, change(friction=(0.05, 0.05))), (0.5, push(10.0, 0.0))],
    "How many facets?": [(0.0, change(facets=13))],
    "The weakest side": [(0.3, push(190.0, 90.0))],
}


def play(challenge: Challenge, script: list[tuple[float, Act]], seconds: float = 8.0) -> Judge:
    """Run a challenge slice by slice, as the page does."""
    session, judge = Session(GO2, challenge.start), challenge.judge()
    waiting, pushes = list(script), []
    while session.sim.time < seconds and not judge.won:
        while waiting and session.sim.time >= waiting[0][0]:
            made = waiting.pop(0)[1](session)
            if made is not None:
                pushes.append(made)
        acting = [p for p in pushes if session.sim.time < p.start + p.duration]
        duration = max(1, round(SLICE / PERIOD)) * PERIOD
        record = fb.rollout(
            session.sim, session.controller, duration, acting, PERIOD, actuators=session.actuators
        )
        session.observe(record)
        judge.observe(record, session)
        if record.outcome != "completed":
            error = "" if record.error is None else f": {record.error}"
            judge.run_ended(f"{record.outcome}{error}", session)
            break
    return judge


@pytest.mark.parametrize("challenge", CHALLENGES, ids=lambda challenge: challenge.title)
def test_a_challenge_can_be_solved(challenge):
    judge = play(challenge, SOLUTIONS[challenge.title])
    assert judge.won and judge.message.startswith("Solved"), judge.message


@pytest.mark.parametrize("challenge", CHALLENGES, ids=lambda challenge: challenge.title)
def test_waiting_does_not_win(challenge):
    judge = play(challenge, [], 3.0)
    assert not judge.won and judge.message


@pytest.mark.parametrize("title", [each.title for each in CHALLENGES if "mass" in each.locked])
def test_a_changed_locked_setting_is_noticed(title):
    judge = play(BY_TITLE[title], [(0.0, change(mass=(1.0, 0.9))), *SOLUTIONS[title]], 2.0)
    assert not judge.won and "mass" in judge.message


NEARLY = {
    "Stand on two feet": [(0.5, LIFT_TWO)],
    "Survive 300 N": [(0.0, change(steps_when_pushed=True)), (0.3, push(290.0, 90.0))],
    "Down an icy slope": [(0.0, change(friction=(0.7, 0.2)))],
    "Quick foot": [(0.5, LIFT_ONE)],
    "On ice": [(0.5, push(8.0, 0.0))],
    "How many facets?": [(0.0, change(facets=14))],
    "The weakest side": [(0.3, push(215.0, 0.0))],
    "Feet that travel": [(0.0, change(gait="trot", velocity=(0.2, 0.0, 0.0)))],
}


@pytest.mark.parametrize("title", NEARLY)
def test_a_near_solution_does_not_win(title):
    challenge = BY_TITLE[title]
    judge = play(challenge, NEARLY[title], 4.0)
    assert not judge.won, judge.message


TROT = change(gait="trot", velocity=(0.4, 0.0, 0.0))
WEAK = change(torque_fraction=0.5)
LIGHT = change(lifted_feet=("FR_foot", "RL_foot"), mass=(0.9, 0.9))
AS_BEFORE = change(mass=(1.0, 1.0))
CHEATS = {
    "on rough ground": ("On ice", [(0.0, change(friction=(0.7, 1.0))), (0.5, push(10.0, 0.0))]),
    "on level ground": (
        "Down an icy slope",
        [(0.0, change(slope=(0.0, 0.0), friction=(0.7, 1.0))), (0.1, TROT)],
    ),
    "pushed three times": (
        "The weakest side",
        [(0.3, push(215.0, 0.0)), (0.45, push(150.0, 0.0)), (0.6, push(150.0, 0.0))],
    ),
    "on weak motors": ("The weakest side", [(0.0, WEAK), (0.3, push(190.0, 90.0))]),
    "a slider through all numbers": (
        "How many facets?",
        [(0.1 * i, change(facets=3 + i)) for i in range(14)],
    ),
    "less weight for a while": (
        "Stand on two feet",
        [(0.0, change(com_shift=(-0.02, 0.0, 0.0))), (0.5, LIGHT), (1.2, AS_BEFORE)],
    ),
}


@pytest.mark.parametrize("how", CHEATS)
def test_a_trick_does_not_win(how):
    title, script = CHEATS[how]
    judge = play(BY_TITLE[title], script, 7.0)
    assert not judge.won, judge.message


@pytest.mark.parametrize("title", BY_TITLE)
def test_a_judge_watches_a_robot_whose_stance_changes(title):
    lower = change(lifted_feet=())
    judge = play(BY_TITLE[title], [(0.1, push(12.0, 0.0)), (0.3, LIFT_ONE), (0.6, lower)], 0.9)
    assert judge.message


def test_a_push_of_300_n_counts_in_every_direction_but_not_a_very_short_one():
    judge, session = (BY_TITLE["Survive 300 N"].judge(), Session(GO2))
    record = fb.rollout(session.sim, session.controller, 0.008, control_period=4e-3)
    for angle in np.deg2rad(np.arange(-180.0, 181.0, 5.0)):
        judge.pushes = [fb.Push(300.0 * np.array([np.cos(angle), np.sin(angle), 0.0]))]
        judge.observe(record, session)
        assert judge.message.startswith("Standing")
    judge.pushes = [fb.Push([300.0, 0.0, 0.0], duration=0.05)]
    assert judge.largest_push is None
