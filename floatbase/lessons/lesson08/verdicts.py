"""Judges of the exercises of lesson 08."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import floatbase as fb
from floatbase._validation import Array
from floatbase.friction import wrench_set
from floatbase.lessons.judges import (
    Example,
    Verdict,
    array_judge,
    lasting_or_verdict,
)
from floatbase.lessons.lesson08.helpers import (
    CRAWL_DURATION,
    crawl,
    run_crawl,
    shortest_com_shift,
    smallest_support_margin,
    uneven_stance,
)

FOOT = "FR_foot"  # of exercise 08.1
PUSH = 0.1  # s, of exercise 08.2
FAR, INSIDE, PRESSED = 600.0, 32.0, 80.0  # mm, mm and N: requirements of exercise 08.3
SLOWEST = 0.05  # s: shorter swings and pauses are only a few control steps


# 08.1 ---------------------------------------------------------------------------------------------


def com_shift() -> Array:
    """Compute the shift [mm] to the nearest point of the support region of the other feet."""
    state = uneven_stance()
    corners = wrench_set(state, fb.Contacts.points(state.robot).without(FOOT)).support_region()
    ways = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        part = np.clip((state.com[:2] - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        ways.append(a + part * (b - a) - state.com[:2])
    return 1e3 * min(ways, key=lambda way: float(np.linalg.norm(way)))


def shift_mistakes() -> dict[str, Callable[[], Any]]:
    """Return, for each hint, a function that computes the shift of this mistake."""
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


def _backwards() -> tuple[fb.State, float, float, float]:
    """Return anymal_kinova standing and three lengths [m]."""
    state = fb.load("anymal_kinova").standing()
    x = fb.Contacts.points(state.robot).positions(state)[:, 0] - state.com[0]
    return state, float(state.com[2]), float(-x.min()), float(x.max())


@cache
def hardest_push() -> float:
    """Return the largest push [N] after which a pendulum above the hind feet does not pass them."""
    state, height, away, _ = _backwards()
    rate = state.robot.gravity / height

    def end(force: float) -> float:
        start = [away, -force * PUSH / state.robot.mass]
        run = solve_ivp(lambda _, y: [y[1], rate * y[0]], (0.0, 2.0), start, rtol=1e-10, atol=1e-12)
        return float(run.y[0, -1])

    return float(brentq(end, 0.0, 10.0 * state.robot.weight, xtol=1e-9))


def push_mistakes() -> dict[str, Callable[[], Any]]:
    """Return, for each hint, a function that computes the force of this mistake."""

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


# 08.3 ---------------------------------------------------------------------------------------------


@array_judge((3,))
def judge_crawl(given: Array) -> Verdict:
    """Judge a crawl in simulation."""
    swing, pause, forwards = given.tolist()
    if min(swing, pause) < SLOWEST:
        return Verdict(
            False,
            f"Swing and pause are times in seconds and must be {SLOWEST} s or more. The third "
            f"number is the speed, m/s.",
            "too_short",
        )
    if forwards < 0:
        return Verdict(
            False, "The speed must not be negative: the crawl goes forwards.", "backwards"
        )
    record = lasting_or_verdict(lambda: run_crawl(swing, pause, forwards))
    if isinstance(record, Verdict):
        return record
    if (fraction := crawl(swing, pause, forwards).speed_fraction) < 1.0:
        return Verdict(
            False,
            f"The legs are too short for steps of this length, so the robot crawls at only "
            f"{fraction * forwards:.2f} m/s. A step is the speed times the period of the gait.",
            "too_long_steps",
        )
    far = 1e3 * float((record.com[-1] - record.com[0])[0])
    inside, pressed = 1e3 * smallest_support_margin(record), float(record.measured[:, 2::3].max())
    text = (
        f"{far:.0f} mm in {CRAWL_DURATION:g} s, margin at least {inside:.1f} mm, at most "
        f"{pressed:.1f} N at a foot"
    )
    if far < FAR and inside < INSIDE:
        return Verdict(
            False,
            f"The crawl is too slow and too close to the edge: {text}. Speed and pause are two "
            f"different numbers.",
            "slow_and_near",
        )
    if far < FAR:
        return Verdict(
            False,
            f"The crawl is too slow: {text}. Speed costs little: the other numbers hardly change "
            f"with it.",
            "slow",
        )
    if inside < INSIDE and pressed > PRESSED:
        return Verdict(
            False,
            f"The crawl is too close to the edge, and a foot stamps: {text}. Both need more time.",
            "near_and_stamps",
        )
    if inside < INSIDE:
        return Verdict(
            False,
            f"The crawl is too close to the edge: {text}. The centre of mass shifts while all feet "
            f"are on the ground.",
            "near",
        )
    if pressed > PRESSED:
        return Verdict(
            False,
            f"A foot stamps: {text}. How fast does a foot move in a step of that length?",
            "stamps",
        )
    return Verdict(
        True,
        f"In simulation: {text}. Pauses give margin, and slow swings give quiet feet. The price is "
        f"longer steps.",
    )


def crawl_examples() -> list[Example]:
    """Return examples for exercise 08.3."""
    return [
        ((0.25, 0.22, 0.14), ""), ((0.3, 0.1, 0.08), "slow_and_near"), ((0.3, 0.25, 0.08), "slow"),
        ((0.3, 0.1, 0.13), "near"),
        ((0.15, 0.1, 0.15), "near_and_stamps"), ((0.15, 0.3, 0.13), "stamps"),
        ((2.0, 0.1, 0.4), "too_long_steps"),
        ((300.0, 250.0, -0.1), "backwards"),
        ((0.01, 0.2, 0.1), "too_short"),
    ]  # fmt: skip
