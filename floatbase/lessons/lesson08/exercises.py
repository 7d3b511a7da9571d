"""Exercises of lesson 08, Standing, shifting, stepping, walking."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import floatbase as fb
from floatbase._validation import Array
from floatbase.friction import wrench_set
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    ShapeJudge,
    Verdict,
    array_judge,
    first_fault,
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


def shift_mistakes() -> list[Mistake]:
    """Return the mistakes of exercise 08.1."""
    state = uneven_stance()
    usual, contacts = state.robot.standing(), fb.Contacts.points(state.robot)
    feet = dict(zip(contacts.names, contacts.positions(state), strict=True))
    middle = np.mean(list(feet.values()), axis=0)[:2]
    triangle = np.mean([place[:2] for name, place in feet.items() if name != FOOT], axis=0)
    way = 1e3 * shortest_com_shift(state, FOOT)
    return [
        ("zero", np.zeros(2), "There is no answer yet. Where is the centre of mass, and where may "
         "it be without FR?"),
        ("sign", -way, "The sign is wrong: this shift leads further away from the other three "
         "feet."),
        ("metres", 1e-3 * way, "The answer must be in mm. This is in metres."),
        ("usual_stance", 1e3 * shortest_com_shift(usual, FOOT), "That is the shift for the usual "
         "stance. Here RR stands further back."),
        ("usual_feet", 1e3 * shortest_com_shift(usual, FOOT, lambda _: state.com[:2]),
         "These are the feet of the usual stance. contacts.positions(uneven) gives their positions "
         "here."),
        ("order", way[::-1], "The order is wrong: first forwards, then to the left."),
        ("y_sign", way * [1.0, -1.0], "To the left is positive, like y."),
        ("x_sign", way * [-1.0, 1.0], "Forwards is positive, like x."),
        ("other_foot", 1e3 * shortest_com_shift(state, "FL_foot"), "That shift frees FL. Which two "
         "feet belong both to the triangle without FR and to the triangle without RL?"),
        ("from_middle", 1e3 * shortest_com_shift(state, FOOT, lambda _: middle),
         "This shift starts in the middle of the feet. The weight acts at the centre of mass."),
        ("to_middle", 1e3 * (triangle - state.com[:2]), "That ends in the middle of the three "
         "feet, which is safe, but longer than necessary."),
        ("straight_back", np.array([way @ way / way[0], 0.0]), "Straight back works, too, but it "
         "is longer than necessary."),
        ("straight_left", np.array([0.0, way @ way / way[1]]), "Straight to the left works, too, "
         "but it is longer than necessary."),
    ]  # fmt: skip


# 08.2 ---------------------------------------------------------------------------------------------


def _backwards() -> tuple[fb.State, float, float, float]:
    """Return a standing state of anymal_kinova, and three distances from its centre of mass [m]."""
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


def push_mistakes() -> list[Mistake]:
    """Return the mistakes of exercise 08.2."""
    state, height, hind, front = _backwards()
    go2, robot = fb.load("go2").standing(), state.robot
    g, mass = robot.gravity, robot.mass
    omega, omega_of_go2 = np.sqrt(g / height), np.sqrt(g / go2.com[2])
    from_origin = -fb.Contacts.points(robot).positions(state)[:, 0].min()
    return [
        ("zero", 0.0, "There is no answer yet. Where must the capture point stay?"),
        ("impulse", mass * omega * hind, "That is the impulse, N·s. How long does the push act?"),
        ("weight", robot.weight * omega * hind / PUSH, "That uses the weight instead of the mass."),
        ("inverse", mass / omega * hind / PUSH, "ω is √(g/h), not √(h/g)."),
        ("no_root", mass * omega**2 * hind / PUSH, "The square root is missing: ω is √(g/h)."),
        ("base_height", mass * np.sqrt(g / state.q[2]) * hind / PUSH, "h is the height of the "
         "centre of mass above the feet, not of the base."),
        ("omega_of_go2", mass * omega_of_go2 * hind / PUSH, "That is the ω of go2. The centre of "
         "mass of this robot is higher."),
        ("mass_of_go2", go2.robot.mass * omega * hind / PUSH, "That is the mass of go2."),
        ("both_of_go2", go2.robot.mass * omega_of_go2 * hind / PUSH, "Mass and ω are those of "
         "go2."),
        ("forwards", mass * omega * front / PUSH, "That is a push forwards, towards the front "
         "feet."),
        ("from_origin", mass * omega * from_origin / PUSH, "Measure from the centre of mass, not "
         "from the world's origin."),
        ("too_fine", mass * omega**2 * hind / -np.expm1(-omega * PUSH), "That is more precise than "
         "the question: it lets the ground push back while the push lasts. Treat the push as an "
         "impulse."),
    ]  # fmt: skip


# 08.3 ---------------------------------------------------------------------------------------------


@array_judge((3,))
def judge_crawl(given: Array) -> Verdict:
    """Judge a crawl in simulation."""
    swing, pause, forwards = given.tolist()
    fault = first_fault([
        ("too_short", min(swing, pause) < SLOWEST, "Swing and pause are times in seconds and must "
         f"be {SLOWEST} s or more. The third number is the speed, m/s."),
        ("backwards", forwards < 0, "The speed must not be negative: the crawl goes forwards."),
    ])  # fmt: skip
    if fault:
        return fault
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
    return first_fault([
        ("slow_and_near", far < FAR and inside < INSIDE, "The crawl is too slow and too close to "
         f"the edge: {text}. Speed and pause are two different numbers."),
        ("slow", far < FAR, f"The crawl is too slow: {text}. Speed costs little: the other numbers "
         "hardly change with it."),
        ("near_and_stamps", inside < INSIDE and pressed > PRESSED, "The crawl is too close to the "
         f"edge, and a foot stamps: {text}. Both need more time."),
        ("near", inside < INSIDE, f"The crawl is too close to the edge: {text}. The centre of mass "
         "shifts while all feet are on the ground."),
        ("stamps", pressed > PRESSED, f"A foot stamps: {text}. How fast does a foot move in a step "
         "of that length?"),
    ]) or Verdict(
        True,
        f"In simulation: {text}. Pauses give margin, and slow swings give quiet feet. The price is "
        "longer steps.",
    )  # fmt: skip


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


EXERCISES = (
    Exercise(
        name="08.1",
        stub="way = np.zeros(2)  # replace: forwards and to the left, mm",
        solution="feet = dict(zip(contacts.names, contacts.positions(uneven)))\n"
        'a, b = feet["FL_foot"][:2], feet["RR_foot"][:2]\n'
        "across = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)\n"
        "way = 1000 * ((a - uneven.com[:2]) @ across) * across",
        judge=ShapeJudge(
            NumericJudge(
                right=com_shift,
                praise="This is the nearest point of the diagonal FL-RR. There RL carries "
                "nothing, and a little further on FR may lift.",
                mistakes=shift_mistakes,
                tolerance=0.02,
            ),
            {
                (3,): "The answer has two numbers: heights do not count.",
                (): "The answer has two numbers: how far forwards and how far to the left.",
            },
        ),
        explanation="Without FR the triangle ends at the line from FL to RR. The shortest way "
        "to a line is perpendicular to it.",
        namespace=lambda: {"uneven": uneven_stance()},
    ),
    Exercise(
        name="08.2",
        stub="force = 0.0  # replace: N",
        solution='arm = fb.load("anymal_kinova")\n'
        "stands = arm.standing()\n"
        "hind = fb.Contacts.points(arm).positions(stands)[:, 0].min()\n"
        "rate = np.sqrt(arm.gravity / stands.com[2])\n"
        "force = arm.mass * rate * (stands.com[0] - hind) / 0.1",
        judge=NumericJudge(
            right=hardest_push,
            praise="F T = m ω s: mass, pendulum, and distance to the edge.",
            mistakes=push_mistakes,
            tolerance=0.005,
        ),
        explanation="The push gives the velocity v = F T / m. The capture point x + v/ω must "
        "not pass the hind feet.",
    ),
    Exercise(
        name="08.3",
        stub="design = np.array([0.3, 0.1, 0.08])  # swing, pause, s; speed, m/s",
        solution="design = np.array([0.25, 0.22, 0.14])",
        judge=judge_crawl,
        examples=crawl_examples,
        explanation="Pauses give margin, because x_c shifts during them. Slow swings give quiet "
        "feet. Speed costs little: the steps become longer.",
    ),
)
