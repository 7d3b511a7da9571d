"""Exercises of lesson 01, "What is a floating base?"."""

from __future__ import annotations

from functools import cache

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    ShapeJudge,
    Verdict,
    array_judge,
    first_fault,
    format_vector,
)
from floatbase.lessons.lesson01.pictures import PRESSING_POSTURE
from floatbase.objectives import centroidal_momentum_rate
from floatbase.robots import PLATE_SIZE, with_floating_base


def _actuation_of_solo8(belt: float = 1.0, torque: int = 1) -> Array:
    """Return S, column by column, from the angles by which the joints turn the motors."""
    robot = fb.load("solo8")
    turns = np.hstack([np.zeros((robot.d, 6)), np.eye(robot.d)])
    turns[torque, 6 + (torque - 1 if torque % 2 else torque + 1)] = belt
    return turns.T


def _held_width() -> float:
    """Return the width [m] of the plate at whose rear edge the force of the floor acts."""
    state = _on_the_plate()
    wrench = (state.h - state.frame_jacobian("tool0")[:3].T @ np.array([-120.0, 0.0, 0.0]))[:6]
    about_the_floor = wrench[4] + state.point("base_link")[2] * wrench[0]
    return float(2 * about_the_floor / wrench[2])


@cache
def _on_the_plate() -> fb.State:
    return with_floating_base(fb.load("ur5", posture=PRESSING_POSTURE), plate=True).standing()


def _by_levers(
    press: float = 120.0, weight: float = 0.0, below: float = 0.0, ahead: float | None = None
) -> float:
    """Return the width at which push and weight have equal moments about the rear edge [m]."""
    state = _on_the_plate()
    height, weight = state.point("tool0")[2] - below, weight or state.robot.weight
    return float(2 * (press * height / weight - (state.com[0] if ahead is None else ahead)))


def _in_proportion() -> float:
    """Return the width if the largest push were proportional to the width [m]."""
    twice = 2 * _on_the_plate().com[0]
    return float(PLATE_SIZE[0] * (_by_levers() + twice) / (PLATE_SIZE[0] + twice))


@array_judge((4, 3), (12,))
def _judge_thrust(f: Array) -> Verdict:
    """Judge thrusts at the four feet of a standing go2."""
    f = f.reshape(4, 3)
    state = fb.load("go2").standing()
    eom = fb.equations_of_motion(state, fb.Contacts.points(state.robot))
    # by the momentum that follows from (4), not by sums of forces and moments
    without_gravity = np.array([0.0, 0.0, state.robot.weight, 0.0, 0.0, 0.0])
    rate = centroidal_momentum_rate(state, eom.acceleration(np.zeros(12), f)) + without_gravity
    moment = ", ".join(f"{x + 0.0:.1f}" for x in np.round(rate[3:], 1))
    return first_fault([
        ("sign", abs(rate[2] + 200.0) < 0.2, "The magnitude is right, but the sign is wrong: these "
         "thrusters push the robot down."),
        ("force", abs(rate[:3] - [0.0, 0.0, 200.0]).max() > 0.2, "The forces add up to "
         f"{format_vector(rate[:3])} N, but they should add up to (0, 0, 200) N."),
        ("moment", abs(rate[3:]).max() > 0.02, f"The force is right, but there is a moment of "
         f"({moment}) N·m about the centre of mass, which turns the robot as a whole."),
    ]) or Verdict(
        True,
        "Straight up without turning. There are six conditions for twelve numbers, so there are "
        "many other answers.",
    )  # fmt: skip


def _thrusts() -> list[Example]:
    """Return examples: front and rear share the force according to the centre of mass."""
    state = fb.load("go2").standing()
    feet = fb.Contacts.points(state.robot).positions(state) - state.com
    front, rear = abs(feet[0, 0]), abs(feet[2, 0])
    f = 100.0 / (front + rear) * np.outer([rear, rear, front, front], [0.0, 0.0, 1.0])
    right = [(f, ""), (f.ravel(), "")]
    return [*right, (-f, "sign"), (2 * f, "force"), (f[:, [2, 1, 0]], "force"), (f[::-1], "moment")]


def _actuation_mistakes() -> list[Mistake]:
    S, without_belt = _actuation_of_solo8(), _actuation_of_solo8(belt=0.0)
    every_leg = S + sum(_actuation_of_solo8(torque=knee) - without_belt for knee in (3, 5, 7))
    return [
        ("no_belt", without_belt, "This is S with a motor in every joint. Which "
         "other row does the motor with the belt act on?"),
        ("belt_reversed", _actuation_of_solo8(torque=0), "Here the hip motor acts on the knee as "
         "well. Columns belong to motors, and rows to joints."),
        ("belt_sign", _actuation_of_solo8(belt=-1.0), "The sign of the belt is wrong. The motor "
         "turns in the same direction when the hip moves and when the knee moves."),
        ("every_leg", every_leg, "Every leg has a belt here. Only the front left leg has one."),
        ("moved_to_hip", S - np.outer(np.eye(14)[7], np.eye(8)[1]),
         "The belt still drives the knee. Its motor acts on the hip and on the knee."),
        ("base_last", np.roll(S, -6, axis=0), "The base comes first in q, as "
         "in (2). Here its rows come last."),
        ("zeros", np.zeros((14, 8)), "All entries are zero, so no motor drives anything. Where "
         "does each torque act?"),
        ("sign", -S, "The sign is wrong. Should a positive torque push its "
         "joint backwards?"),
    ]  # fmt: skip


def _width_mistakes() -> list[Mistake]:
    return [
        ("half", _held_width() / 2, "That is the distance from the middle to the rear edge. The "
         "plate extends as far to the front."),
        ("height_from_base", _by_levers(below=PLATE_SIZE[1]), "The plate tips about an edge on the "
         "floor. Measure the height of the tool from the floor, not from the base."),
        ("com_in_middle", _by_levers(ahead=0.0), "Where does the weight act? The centre of mass is "
         "not above the middle of the plate."),
        ("com_sign", _by_levers(ahead=-_on_the_plate().com[0]), "The centre of mass is ahead of "
         "the middle, and the plate tips about its rear edge. Does that help or not?"),
        ("plate_as_is", PLATE_SIZE[0], "That is the present width, and with 120 N this plate tips "
         "over."),
        ("in_proportion", _in_proportion(), "The largest push is not proportional to the width of "
         "the plate: part of the lever arm exists without a plate."),
        ("half_press", _by_levers(60.0), "That is enough for 60 N. The arm is to press with 120 "
         "N."),
        ("mass", _by_levers(weight=_on_the_plate().robot.mass), "That uses the mass instead of the "
         "weight. A force needs one more factor."),
        ("exchanged", _by_levers(_on_the_plate().robot.weight, weight=120.0),
         "Height and distance from the edge are interchanged. Which lever arm belongs to the push, "
         "and which to the weight?"),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="01.1",
        stub="S_solo8 = np.eye(8)  # replace this: stack what is missing, and add the belt",
        solution="S_solo8 = np.vstack([np.zeros((6, 8)), np.eye(8)])\n"
        "S_solo8[6, 1] = 1.0  # the knee motor also acts on the hip",
        judge=ShapeJudge(
            shapes={
                (8, 8): "S maps 8 torques to all rows of the equations of motion. How many rows "
                "does a base add, and where?",
                (8, 14): "This is the transpose of the answer. S maps 8 torques to 14 rows.",
                (9, 8): "A base adds more than one row: three for its position and three for its "
                "orientation.",
                (18, 12): "That is the S of go2, which has three joints in each leg. solo8 has "
                "two.",
                (15, 8): "15 counts the four numbers of the quaternion. The rows of (4) "
                "correspond to velocities, and a rotation has three.",
            },
            judge=NumericJudge(
                right=_actuation_of_solo8,
                praise="Six rows without a motor, then one row for each joint. The belt adds one "
                "entry.",
                mistakes=_actuation_mistakes,
            ),
        ),
        explanation="(2) puts the six numbers of the base before the joints, so (3) puts six "
        "zeros before the torques. The knee motor turns when the hip or the knee moves, so its "
        "column has two ones.",
    ),
    Exercise(
        name="01.2",
        stub="thrust = np.tile([0.0, 0.0, 50.0], (4, 1))  # N: four equal thrusts are a first "
        "guess",
        solution="moments = [np.cross(np.eye(3), -lever).T for lever in levers]\n"
        "G = np.vstack([np.tile(np.eye(3), 4), np.hstack(moments)])\n"
        "thrust = np.linalg.lstsq(G, [0, 0, 200, 0, 0, 0], rcond=None)[0].reshape(4, 3)",
        judge=ShapeJudge(
            _judge_thrust,
            {
                (3, 4): "This is the transpose. The answer needs one row for each "
                "foot, with three columns."
            },
        ),
        examples=_thrusts,
        explanation="Forces and moments are linear in the thrusts: six equations for twelve "
        "numbers. Least squares gives the smallest thrusts that satisfy them. Lesson 05 calls "
        "the two halves of this matrix G_f and G_τ, (20) and (21).",
    ),
    Exercise(
        name="01.3",
        stub="width = 0.4  # m: replace this number by an expression",
        solution='lever = at_rest.point("tool0")[2]\nwidth = 2 * (120 * lever / standing.weight - '
        "at_rest.com[0])",
        judge=NumericJudge(
            right=_held_width,
            praise="A harder push needs a wider plate. A walking robot cannot widen its plate. "
            "Instead, it puts a foot in the right place in time.",
            mistakes=_width_mistakes,
        ),
        explanation="Moments about the rear edge: 120 N × height = weight × (half the width + "
        "distance of the centre of mass ahead of the middle).",
    ),
)
