"""Exercises of lesson 08, Standing, shifting, stepping, walking."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.behaviours import support_margin
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    ShapeJudge,
    Verdict,
    function_or_verdict,
    stopped,
)
from floatbase.lessons.lesson08.helpers import (
    SWING_TIME,
    feet_of_the_trot,
    foothold,
    parts_of_foothold,
    shortest_com_shift,
    uneven_stance,
)

FOOT = "FR_foot"  # of exercise 08.2
PUSH = 0.1  # s, of exercise 08.3


# 08.1 ---------------------------------------------------------------------------------------------


@cache
def moments() -> tuple[tuple[str, fb.State, float, Array], ...]:
    """Return the arguments with which the learner's `foothold` is called."""
    stands = fb.load("go2").standing()
    v = np.zeros(stands.robot.nv)
    v[:3] = 0.4, -0.2, 0.1  # m/s
    now = fb.State(stands.robot, stands.q, v)
    return ("FR_foot", now, 0.1, np.array([0.3, 0.1])), ("RL_foot", now, 0.2, np.zeros(2))


def _footholds(weights: tuple[float, float, float] = (1, 1, 1)) -> Array:
    """Return the footholds at these moments; the weights of their three parts are 1 if right."""
    places = [np.array(weights) @ parts_of_foothold(*moment) for moment in moments()]
    heights = [feet_of_the_trot()[0][foot][2] for foot, *_ in moments()]
    return np.column_stack([places, heights])


def foothold_mistakes() -> list[Mistake]:
    """Return the mistakes of exercise 08.1."""
    right, now = _footholds(), moments()[0][1]
    left = np.array([SWING_TIME - since for _, _, since, _ in moments()])[:, None]
    by = left * now.com_velocity * [1, 1, 0]  # m, until touch-down
    home = np.array([feet_of_the_trot()[0][foot] for foot, *_ in moments()])
    return [
        ("home", home, "There is no answer yet: this is the foot's place while go2 stands."),
        ("no_body", _footholds((0, 1, 1)), "That is measured from the body. Add where the centre "
         "of mass is at touch-down."),
        ("no_step", _footholds((1, 0, 1)), "Your formula `step` is missing. Without it, an "
         "error of the velocity does not move the foot."),
        ("no_offset", _footholds((1, 1, 0)), "Both feet land at the same point. Add the foot's "
         "usual place, seen from the middle of the feet."),
        ("now", right - by, "That starts from where the centre of mass is now. The foot lands "
         "T - since later."),
        ("since", right - 2 * by + SWING_TIME * now.com_velocity * [1, 1, 0], "`since` has "
         "passed already. What is left is T - since."),
        ("height", right + [0, 0, 1] * (now.com + left * now.com_velocity - home), "That is at "
         "the height of the centre of mass. The foot's own height is home[foot][2]."),
    ]  # fmt: skip


_FOOTHOLD = NumericJudge(
    right=_footholds,
    praise="The parts: the body's future place, the pendulum's support, and the foot's own side.",
    mistakes=foothold_mistakes,
)


def judge_foothold(answer: Any) -> Verdict:
    """Judge a function that returns where a foot is to land."""
    program = function_or_verdict(answer)
    if isinstance(program, Verdict):
        return program
    try:
        return _FOOTHOLD([np.asarray(program(*moment)) for moment in moments()])
    except Exception as error:  # whatever a learner's function raises
        return stopped(error)


def foothold_examples() -> list[Example]:
    """Return examples for exercise 08.1."""
    feet = [foot for foot, *_ in moments()]
    answers = [(_footholds(), ""), *((wrong, hint) for hint, wrong, _ in foothold_mistakes())]
    return [
        *((lambda foot, *_, rows=rows: rows[feet.index(foot)], hint) for rows, hint in answers),
        (foothold, ""), (lambda foot, *_: np.zeros(2), "shape"), (lambda foot: foot, "stops"),
    ]  # fmt: skip


# 08.2 ---------------------------------------------------------------------------------------------


def com_shift() -> Array:
    """Compute the shift [mm] to the nearest point of the edge between FL and RR."""
    return 1e3 * shortest_com_shift(uneven_stance(), FOOT)


def shift_mistakes() -> list[Mistake]:
    """Return the mistakes of exercise 08.2."""
    state = uneven_stance()
    usual, contacts = state.robot.standing(), fb.Contacts.points(state.robot)
    feet = dict(zip(contacts.names, contacts.positions(state), strict=True))
    middle = np.mean(list(feet.values()), axis=0)[:2]
    way = com_shift()
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
    ]  # fmt: skip


_SHIFT = ShapeJudge(
    NumericJudge(
        right=com_shift,
        praise="This is the nearest point of the diagonal FL-RR. There RL carries nothing, and a "
        "little further on FR may lift.",
        mistakes=shift_mistakes,
        tolerance=0.02,
    ),
    {
        (3,): "The answer has two numbers: heights do not count.",
        (): "The answer has two numbers: how far forwards and how far to the left.",
    },
)


def judge_shift(answer: Any) -> Verdict:
    """Judge a shift, and say of a longer one that it works."""
    verdict, state = _SHIFT(answer), uneven_stance()
    if verdict.hint != "unknown":
        return verdict
    stand = fb.Contacts.points(state.robot).without(FOOT).positions(state)[:, :2]
    moved = state.com[:2] + np.asarray(answer, dtype=np.float64) / 1e3
    if support_margin(moved, stand) < -1e-4:  # m: an answer may be rounded to 0.1 mm
        return verdict
    text = "This works, too, but it is longer than necessary. Which point of the edge is nearest?"
    return Verdict(False, text, "longer")


def shift_examples() -> list[Example]:
    """Return examples for exercise 08.2."""
    x, y = com_shift()
    longer = [np.array(way) for way in ((1.5 * x, 1.5 * y), (x + y * y / x, 0), (0, y + x * x / y))]
    return [*_SHIFT.examples(), *((way, "longer") for way in longer)]


# 08.3 ---------------------------------------------------------------------------------------------


def _backwards() -> tuple[fb.State, float, float, float]:
    """Return a standing state of anymal_kinova, and three distances from its centre of mass [m]."""
    state = fb.load("anymal_kinova").standing()
    x = fb.Contacts.points(state.robot).positions(state)[:, 0] - state.com[0]
    return state, float(state.com[2]), float(-x.min()), float(x.max())


def hardest_push() -> float:
    """Return the push [N] that moves the capture point to the hind feet."""
    state, height, away, _ = _backwards()
    return float(state.robot.mass * np.sqrt(state.robot.gravity / height) * away / PUSH)


def push_mistakes() -> list[Mistake]:
    """Return the mistakes of exercise 08.3."""
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


EXERCISES = (
    Exercise(
        name="08.1",
        stub="def foothold(foot, now, since, desired):\n"
        '    """Where this foot is to land, (3,), m."""\n'
        "    return home[foot]  # replace: your rule",
        solution="def foothold(foot, now, since, desired):\n"
        "    lands = now.com + now.com_velocity * (T - since)\n"
        "    beside = home[foot][:2] - middle\n"
        "    x, y = lands[:2] + step(now.com_velocity[:2], desired) + beside\n"
        "    return np.array([x, y, home[foot][2]])",
        judge=judge_foothold,
        examples=foothold_examples,
        explanation="The foot lands T - since later. By then the centre of mass has moved on, and "
        "`step` says where the pendulum needs its support from there.",
        namespace=lambda: {"home": feet_of_the_trot()[0]},
    ),
    Exercise(
        name="08.2",
        stub="way = np.zeros(2)  # replace: forwards and to the left, mm",
        solution="feet = dict(zip(contacts.names, contacts.positions(uneven)))\n"
        'a, b = feet["FL_foot"][:2], feet["RR_foot"][:2]\n'
        "across = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)\n"
        "way = 1000 * ((a - uneven.com[:2]) @ across) * across",
        judge=judge_shift,
        examples=shift_examples,
        explanation="Without FR the triangle ends at the line from FL to RR. The shortest way "
        "to a line is perpendicular to it.",
        namespace=lambda: {"uneven": uneven_stance()},
    ),
    Exercise(
        name="08.3",
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
)
