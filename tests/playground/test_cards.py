"""Each challenge has a solution, is not solved by waiting, and has a judge that sees what may not be changed."""

from __future__ import annotations

from collections.abc import Callable

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.playground import CARDS, Card, Judge, Session, Settings

GO2 = judges.load("go2")
SLICE = 1.0 / 30.0  # s

Act = Callable[[Session], "fb.Push | None"]


def change(**changes: object) -> Act:
    def act(session: Session) -> None:
        if session.change(**changes):
            session.sim.reset()
            session.restart()

    return act


def push(force: float, towards: float) -> Act:
    angle = np.deg2rad(towards)
    return lambda session: fb.Push(force * np.array([np.cos(angle), np.sin(angle), 0.0]), session.sim.time)


SOLUTIONS: dict[str, list[tuple[float, Act]]] = {
    "Stand on two feet": [(0.0, change(shift=(-0.02, 0.0, 0.0))), (0.5, change(lifted=("FR_foot", "RL_foot")))],
    "Survive 300 N": [(0.0, change(catches=True)), (0.3, push(300.0, 90.0))],
    "Down an icy slope": [(0.0, change(slope=(20.0, 20.0), friction=(0.2, 0.2)))],
    "On an edge": [(0.0, change(friction=(0.1, 0.7))), (0.5, push(60.0, 45.0))],
    "No answer": [(0.2, change(torque=0.1, least_force=60.0))],
    "Quick foot": [(0.0, change(shift=(-0.05, -0.03, 0.0))), (1.0, change(lifted=("FL_foot",)))],
    "Feet that travel": [(0.0, change(nod=0.3))],
    "On ice": [(0.0, change(friction=(0.05, 0.05))), (0.5, push(10.0, 0.0))],
    "How many facets?": [(0.0, change(facets=13))],
    "The weakest side": [(0.3, push(190.0, 90.0))],
}


def play(card: Card, script: list[tuple[float, Act]], seconds: float = 8.0) -> Judge:
    """Run a card as the page does, slice by slice, without a page."""
    session, judge = Session(GO2, card.start), card.judge()
    waiting, pushes = list(script), []
    while session.sim.time < seconds and not judge.won:
        while waiting and session.sim.time >= waiting[0][0]:
            made = waiting.pop(0)[1](session)
            if made is not None:
                pushes.append(made)
                judge.pushed(made)
        acting = [p for p in pushes if session.sim.time < p.start + p.duration]
        duration = max(1, round(SLICE / session.period)) * session.period
        record = fb.rollout(
            session.sim, session.controller, duration, acting, control_period=session.period, actuators=session.actuators
        )
        session.see(record)
        judge.see(record, session)
        if record.outcome != "completed":
            judge.ended(record.outcome if record.error is None else f"{record.outcome}: {record.error}", session)
            break
    return judge


def test_there_are_ten() -> None:
    assert [card.title for card in CARDS] == list(SOLUTIONS) and len(CARDS) == 10


@pytest.mark.parametrize("card", CARDS, ids=lambda card: card.title)
def test_a_card_can_be_solved(card: Card) -> None:
    judge = play(card, SOLUTIONS[card.title])
    assert judge.won and judge.says.startswith("Solved"), judge.says


@pytest.mark.parametrize("card", CARDS, ids=lambda card: card.title)
def test_nobody_wins_by_waiting(card: Card) -> None:
    judge = play(card, [], 3.0)
    assert not judge.won and judge.says


@pytest.mark.parametrize("card", [card for card in CARDS if "mass" in card.fixed], ids=lambda card: card.title)
def test_what_may_not_be_changed_is_seen(card: Card) -> None:
    judge = play(card, [(0.0, change(mass=(1.0, 0.9))), *SOLUTIONS[card.title]], 2.0)
    assert not judge.won and "mass may not be changed" in judge.says


NEARLY = {
    "Stand on two feet": [(0.5, change(lifted=("FR_foot", "RL_foot")))],
    "Survive 300 N": [(0.0, change(catches=True)), (0.3, push(290.0, 90.0))],
    "Down an icy slope": [(0.0, change(friction=(0.7, 0.2)))],
    "Quick foot": [(0.5, change(lifted=("FL_foot",)))],
    "On ice": [(0.5, push(8.0, 0.0))],
    "How many facets?": [(0.0, change(facets=14))],
    "The weakest side": [(0.3, push(215.0, 0.0))],
    "Feet that travel": [(0.0, change(gait="trot", velocity=(0.2, 0.0, 0.0)))],
}


@pytest.mark.parametrize("title", NEARLY)
def test_nearly_is_not_enough(title: str) -> None:
    card = next(card for card in CARDS if card.title == title)
    judge = play(card, NEARLY[title], 4.0)
    assert not judge.won, judge.says


def test_a_start_is_a_setting_that_the_card_itself_allows() -> None:
    for card in CARDS:
        assert isinstance(card.start, Settings) and all(hasattr(card.start, name) for name in card.fixed)
