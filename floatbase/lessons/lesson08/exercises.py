"""Exercises of lesson 08, Standing, shifting, stepping, walking."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import floatbase as fb
from floatbase._validation import Array
from floatbase.friction import wrench_set
from floatbase.lessons.exercises import (
    Example,
    Exercise,
    NumericJudge,
    ShapeJudge,
    Verdict,
    array_or_verdict,
    lasting_or_verdict,
)
from floatbase.lessons.lesson08.helpers import (
    CRAWL_DURATION,
    run_crawl,
    shortest_com_shift,
    smallest_support_margin,
    uneven_stance,
)

FOOT = "FR_foot"  # of exercise 08.1
CLEARANCE = 0.05  # m, of exercise 08.2
PUSH = 0.1  # s, of exercise 08.3
FAR, INSIDE, PRESSED = 600.0, 32.0, 80.0  # mm, mm and N: what exercise 08.4 asks for
SLOWEST = 0.05  # s: shorter swings and pauses are a few ticks


# 08.1 ---------------------------------------------------------------------------------------------


def _shift() -> Array:
    """From the support region of the feet that stay, by its nearest point, mm."""
    state = uneven_stance()
    corners = wrench_set(state, fb.Contacts.points(state.robot).without(FOOT)).support_region()
    ways = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        part = np.clip((state.com[:2] - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        ways.append(a + part * (b - a) - state.com[:2])
    return 1e3 * min(ways, key=lambda way: float(np.linalg.norm(way)))


def _shifts() -> dict[str, Callable[[], Any]]:
    state = uneven_stance()
    feet = dict(
        zip(
            fb.Contacts.points(state.robot).names,
            fb.Contacts.points(state.robot).positions(state),
            strict=True,
        )
    )
    middle = np.mean(list(feet.values()), axis=0)[:2]
    triangle = np.mean([place[:2] for name, place in feet.items() if name != FOOT], axis=0)

    def along(axis: int) -> Array:
        way = 1e3 * shortest_com_shift(state, FOOT)
        return np.eye(2)[axis] * (way @ way) / way[axis]

    usual = state.robot.standing()
    return {
        "zero": lambda: np.zeros(2),
        "sign": lambda: -1e3 * shortest_com_shift(state, FOOT),
        "metres": lambda: shortest_com_shift(state, FOOT),
        "usual_stance": lambda: 1e3 * shortest_com_shift(usual, FOOT),
        "usual_feet": lambda: 1e3 * shortest_com_shift(usual, FOOT, lambda _: state.com[:2]),
        "order": lambda: 1e3 * shortest_com_shift(state, FOOT)[::-1],
        "y_sign": lambda: 1e3 * shortest_com_shift(state, FOOT) * [1.0, -1.0],
        "x_sign": lambda: 1e3 * shortest_com_shift(state, FOOT) * [-1.0, 1.0],
        "other_foot": lambda: 1e3 * shortest_com_shift(state, "FL_foot"),
        "from_middle": lambda: 1e3 * shortest_com_shift(state, FOOT, lambda _: middle),
        "to_middle": lambda: 1e3 * (triangle - state.com[:2]),
        "straight_back": lambda: along(0),
        "straight_left": lambda: along(1),
    }


# 08.2 ---------------------------------------------------------------------------------------------


def _bump() -> Array:
    """From its conditions: rest at u = 0 and 1, the clearance at u = 1/2."""
    powers = np.arange(7)

    def row(u: float, order: int) -> Array:
        factor = np.prod([powers - i for i in range(order)], axis=0) if order else np.ones(7)
        made: Array = factor * np.where(powers >= order, u ** np.maximum(powers - order, 0), 0.0)
        return made

    rows = [row(u, order) for u in (0.0, 1.0) for order in range(3)] + [row(0.5, 0)]
    return np.linalg.solve(rows, [0.0] * 6 + [CLEARANCE])


_BUMPS: Mapping[str, Callable[[], Any]] = {
    "zero": lambda: np.zeros(7),
    "parabola": lambda: CLEARANCE * np.array([0, 4, -4, 0, 0, 0, 0]),
    "of_the_lesson": lambda: CLEARANCE * np.array([0, 0, 16, -32, 16, 0, 0]),
    "stays_up": lambda: CLEARANCE * np.array([0, 0, 0, 10, -15, 6, 0]),
    "height": lambda: CLEARANCE * np.array([0, 0, 0, 1, -3, 3, -1]),
    "height_1": lambda: np.array([0, 0, 0, 64, -192, 192, -64]),
    "millimetres": lambda: 1e3 * CLEARANCE * np.array([0, 0, 0, 64, -192, 192, -64]),
    "order": lambda: CLEARANCE * np.array([-64, 192, -192, 64, 0, 0, 0]),
    "sign": lambda: -CLEARANCE * np.array([0, 0, 0, 64, -192, 192, -64]),
}


# 08.3 ---------------------------------------------------------------------------------------------


def _backwards() -> tuple[fb.State, float, float, float]:
    """anymal_kinova standing; how high its centre of mass is, and how far hind and front feet are
    from it along x, m.
    """
    state = fb.load("anymal_kinova").standing()
    x = fb.Contacts.points(state.robot).positions(state)[:, 0] - state.com[0]
    return state, float(state.com[2]), float(-x.min()), float(x.max())


@cache
def _hardest() -> float:
    """From a pendulum above the hind feet whose motion is integrated: the push after which it just
    does not pass them, N.
    """
    state, height, away, _ = _backwards()
    rate = state.robot.gravity / height

    def end(force: float) -> float:
        start = [away, -force * PUSH / state.robot.mass]
        run = solve_ivp(lambda _, y: [y[1], rate * y[0]], (0.0, 2.0), start, rtol=1e-10, atol=1e-12)
        return float(run.y[0, -1])

    return float(brentq(end, 0.0, 10.0 * state.robot.weight, xtol=1e-9))


def _pushes() -> dict[str, Callable[[], Any]]:
    def push(
        mass: str = "mass",
        height: str = "com",
        edge: str = "hind",
        power: float = 1.0,
        duration: float = PUSH,
    ) -> Callable[[], float]:
        def value() -> float:
            state, com, hind, front = _backwards()
            h = com if height == "com" else float(state.q[2])
            x = fb.Contacts.points(state.robot).positions(state)[:, 0]
            s = {"hind": hind, "front": front, "origin": -x.min(), "side": 0.0}[edge]
            m = state.robot.mass if mass == "mass" else state.robot.weight
            return float(m * s * np.sqrt(state.robot.gravity / h) ** power / duration)

        return value

    def of_go2(mass: bool = False, omega: bool = False) -> Callable[[], float]:
        def value() -> float:
            state, h, s, _ = _backwards()
            go2 = fb.load("go2").standing()
            m = (go2 if mass else state).robot.mass
            return float(m * s * np.sqrt(state.robot.gravity / (go2.com[2] if omega else h)) / PUSH)

        return value

    def long() -> float:
        state, h, s, _ = _backwards()
        omega = np.sqrt(state.robot.gravity / h)
        return float(state.robot.mass * omega**2 * s / -np.expm1(-omega * PUSH))

    return {
        "zero": lambda: 0.0,
        "impulse": push(duration=1.0),
        "weight": push(mass="weight"),
        "inverse": push(power=-1.0),
        "no_root": push(power=2.0),
        "base_height": push(height="base"),
        "omega_of_go2": of_go2(omega=True),
        "mass_of_go2": of_go2(mass=True),
        "both_of_go2": of_go2(mass=True, omega=True),
        "forwards": push(edge="front"),
        "from_origin": push(edge="origin"),
        "too_fine": long,
    }


# 08.4 ---------------------------------------------------------------------------------------------


def _judge_crawl(answer: Any) -> Verdict:
    """A crawl, judged on the physics."""
    given = array_or_verdict(answer, (3,))
    if isinstance(given, Verdict):
        return given
    swing, pause, forwards = given.tolist()
    if min(swing, pause) < SLOWEST:
        return Verdict(
            False,
            f"Swing and pause are times in seconds, {SLOWEST} s or more; the third number is the "
            f"speed, m/s.",
            "too_short",
        )
    if forwards < 0:
        return Verdict(False, "Forwards, please.", "backwards")
    record = lasting_or_verdict(lambda: run_crawl(swing, pause, forwards))
    if isinstance(record, Verdict):
        return record
    far = 1e3 * float((record.com[-1] - record.com[0])[0])
    inside, pressed = 1e3 * smallest_support_margin(record), float(record.measured[:, 2::3].max())
    told = (
        f"{far:.0f} mm in {CRAWL_DURATION:g} s, at least {inside:.0f} mm inside, at most "
        f"{pressed:.0f} N at a foot"
    )
    if far < FAR and inside < INSIDE:
        return Verdict(
            False,
            f"Too slow, and too near to the edge: {told}. Speed and pause are two different "
            f"numbers.",
            "slow_and_near",
        )
    if far < FAR:
        return Verdict(
            False,
            f"Too slow: {told}. The speed costs little; look how little the others change with it.",
            "slow",
        )
    if inside < INSIDE and pressed > PRESSED:
        return Verdict(
            False,
            f"Too near to the edge, and a foot stamps: {told}. Both want more time.",
            "near_and_stamps",
        )
    if inside < INSIDE:
        return Verdict(
            False,
            f"Too near to the edge: {told}. The centre of mass shifts while all feet stand.",
            "near",
        )
    if pressed > PRESSED:
        return Verdict(
            False,
            f"A foot stamps: {told}. How fast does a foot fly for a step of that length?",
            "stamps",
        )
    return Verdict(
        True,
        f"On the physics: {told}. Pauses buy margin, slow swings quiet feet; the price is longer "
        f"steps.",
    )


def _crawls() -> list[Example]:
    return [
        ((0.3, 0.25, 0.12), ""), ((0.3, 0.1, 0.08), "slow_and_near"), ((0.3, 0.25, 0.08), "slow"),
        ((0.3, 0.1, 0.13), "near"),
        ((0.15, 0.1, 0.15), "near_and_stamps"), ((0.15, 0.3, 0.13), "stamps"),
        ((2.0, 0.1, 0.4), "falls"),
        ((300.0, 250.0, -0.1), "backwards"),
        ((0.01, 0.2, 0.1), "too_short"),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="08.1",
        statement="RR stands 6 cm further back. The shortest shift of x_c, (2,), mm, forwards and "
        "to the left, after which "
        "FR can be lifted.",
        stub="way = np.zeros(2)  # replace: forwards and to the left, mm",
        solution="feet = dict(zip(contacts.names, contacts.positions(uneven)))\n"
        'a, b = feet["FL_foot"][:2], feet["RR_foot"][:2]\n'
        "across = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)\n"
        "way = 1000 * ((a - uneven.com[:2]) @ across) * across",
        judge=ShapeJudge(
            NumericJudge(
                right=_shift,
                praise="The nearest point of the diagonal FL-RR: there RL carries nothing, and a "
                "bit further FR may lift.",
                mistakes=_shifts(),
                hints={
                    "zero": "There is nothing there yet: where is the centre of mass, and where "
                    "may it be without FR?",
                    "sign": "The sign: this way leads further away from the other three feet.",
                    "metres": "In mm, please; these are metres.",
                    "usual_stance": "That is the way for the usual stance; here RR stands further "
                    "back.",
                    "usual_feet": "The feet are those of the usual stance; "
                    "contacts.positions(uneven) tells where they stand "
                    "here.",
                    "order": "The order: first forwards, then to the left.",
                    "y_sign": "To the left is positive, as y is.",
                    "x_sign": "Forwards is positive, as x is.",
                    "other_foot": "That way frees FL. Which two feet does FR's triangle share with "
                    "the other one?",
                    "from_middle": "It starts in the middle of the feet. The weight acts at the "
                    "centre of mass.",
                    "to_middle": "That ends in the middle of the three feet: safe, and longer than "
                    "it must be.",
                    "straight_back": "Straight back it works, too, and it is longer than it must "
                    "be.",
                    "straight_left": "Straight to the left it works, too, and it is longer than it "
                    "must be.",
                },
                tolerance=0.02,
            ),
            {
                (3,): "Two numbers: heights do not count.",
                (): "Two numbers: how far forwards and how far to the left.",
            },
        ),
        explanation="Without FR the triangle ends at the line from FL to RR. The shortest way to a "
        "line is across it.",
        namespace=lambda: {"uneven": uneven_stance()},
    ),
    Exercise(
        name="08.2",
        statement="The coefficients of u⁰ to u⁶, (7,), m, of a bump that is at rest at u = 0 and "
        "1, without acceleration "
        "there, and 0.05 m high half-way.",
        stub="coefficients = np.zeros(7)  # replace: coefficients of u⁰, u¹, …, u⁶, in m",
        solution="coefficients = 0.05 * 64 * np.array([0, 0, 0, 1, -3, 3, -1])  # 64 u³ (1 - u)³",
        judge=ShapeJudge(
            NumericJudge(
                right=_bump,
                praise="64 u³ (1 - u)³: a factor of three at each end for position, velocity and "
                "acceleration.",
                mistakes=_BUMPS,
                hints={
                    "zero": "There is nothing there yet: it stays on the ground.",
                    "parabola": "A parabola: it is not at rest at either end.",
                    "of_the_lesson": "This is the lesson's own bump: its acceleration jumps at "
                    "both ends.",
                    "stays_up": "This goes up and stays there: at u = 1 the foot must be down "
                    "again.",
                    "height": "The shape is right and the height is not: how much is u³ (1 - u)³ "
                    "half-way?",
                    "height_1": "The shape is right; its height is 1. It should be 0.05 m.",
                    "millimetres": "In metres, please: this is in mm.",
                    "order": "The order: the first number belongs to u⁰, the last to u⁶.",
                    "sign": "The sign: this foot digs.",
                },
            ),
            {
                (
                    5,
                ): "Five numbers end at u⁴: with three conditions at each end and one half-way it "
                "takes seven.",
                (
                    6,
                ): "Six numbers end at u⁵: with three conditions at each end and one half-way it "
                "takes seven.",
            },
        ),
        explanation="A root of third order at u = 0 and at u = 1 takes away position, velocity and "
        "acceleration there.",
    ),
    Exercise(
        name="08.3",
        statement="anymal_kinova stands and is pushed backwards for 0.1 s: the largest force, N, "
        "by the rule of the "
        "capture point, the push taken as an impulse.",
        stub="force = 0.0  # replace: N",
        solution='arm = fb.load("anymal_kinova")\n'
        "stands = arm.standing()\n"
        "hind = fb.Contacts.points(arm).positions(stands)[:, 0].min()\n"
        "rate = np.sqrt(arm.gravity / stands.com[2])\n"
        "force = arm.mass * rate * (stands.com[0] - hind) / 0.1",
        judge=NumericJudge(
            right=_hardest,
            praise="F T = m ω s: mass, pendulum, and the way to the edge.",
            mistakes=_pushes(),
            hints={
                "zero": "There is nothing there yet: where must the capture point stay?",
                "impulse": "That is the impulse, N·s. Over how long a time does the push give it?",
                "weight": "That is its weight in place of its mass.",
                "inverse": "ω is √(g/h), not √(h/g).",
                "no_root": "ω is √(g/h): the root is missing.",
                "base_height": "h is the height of the centre of mass above the feet, not that of "
                "the base.",
                "omega_of_go2": "That ω is go2's; this robot's centre of mass is higher.",
                "mass_of_go2": "That mass is go2's.",
                "both_of_go2": "Mass and ω are go2's.",
                "forwards": "That is a push forwards, against the front feet.",
                "from_origin": "Measure from the centre of mass, not from the world's origin.",
                "too_fine": "That is finer than what is asked: it lets the ground push back while "
                "the push lasts. Take an "
                "impulse.",
            },
            tolerance=0.005,
        ),
        explanation="The push gives the velocity v = F T / m; the capture point x + v/ω must not "
        "pass the hind feet.",
    ),
    Exercise(
        name="08.4",
        statement="A crawl, (swing, pause, speed), s, s and m/s: at least 600 mm in 6 s, x_c at "
        "least 32 mm inside the feet "
        "that stand, and never more than 80 N at a foot.",
        stub="design = np.array([0.3, 0.1, 0.08])  # swing, pause, s; speed, m/s",
        solution="design = np.array([0.3, 0.25, 0.12])",
        judge=_judge_crawl,
        examples=_crawls,
        explanation="Margin comes from pauses, in which x_c shifts; quiet feet come from slow "
        "swings. Speed costs little: "
        "the steps become longer.",
    ),
)
