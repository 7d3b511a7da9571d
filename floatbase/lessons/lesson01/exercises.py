"""Exercises of lesson 01, "What is a floating base?"."""

from __future__ import annotations

from functools import cache

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import fixed_frame
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    Example,
    NumericJudge,
    ShapeJudge,
    Verdict,
    array_judge,
    format_vector,
)
from floatbase.lessons.lesson01.pictures import PRESSING_POSTURE
from floatbase.objectives import centroidal_momentum_rate
from floatbase.robots import PLATE_SIZE, with_floating_base


@cache
def _pressing_arm() -> tuple[fb.State, Array, Array]:
    """Return the pressing arm without bolts, the tool's position from the base, and f_r."""
    state = with_floating_base(fb.load("ur5", posture=PRESSING_POSTURE)).standing()
    return state, state.point("tool0") - state.point("base_link"), np.array([-60.0, 0.0, 0.0])


def _bolts_moment() -> Array:
    """Compute the moment of the bolts from the constraint forces of (7).

    The moment is from the wrench of the welded base with the wall's force, minus that without the
    force.
    """
    state, _, force = _pressing_arm()
    J = state.frame_jacobian("tool0")[:3]
    eom = fb.equations_of_motion(state, fb.Contacts([fixed_frame("base_link")]))
    wrench = np.linalg.lstsq(eom.J.T, -J.T @ force + eom.S @ (J.T @ force)[6:], rcond=None)[0]
    return np.asarray(wrench[3:])


def _about_the_centre_of_mass() -> Array:
    state, _, force = _pressing_arm()
    return -np.cross(state.point("tool0") - state.com, force)


def _with_the_weight() -> Array:
    state, tool, force = _pressing_arm()
    lever = state.com - state.point("base_link")
    return -np.cross(tool, force) + np.cross(lever, [0.0, 0.0, state.robot.weight])


def _actuation_of_solo8() -> Array:
    """Return S, column by column: what (3) gives for one torque at a time."""
    robot = fb.load("solo8")
    columns = [np.concatenate([np.zeros(6), one]) for one in np.eye(robot.d)]
    return np.column_stack(columns)


def _carried_by_friction() -> float:
    """Return the largest horizontal force on a standing go2 within cones of μ = 0.7."""
    robot = fb.load("go2")
    contacts = fb.Contacts.points(robot, mu=0.7)
    return float(contacts.mus.max()) * sum(inertia.mass for inertia in robot.model.inertias) * 9.81


def _held_width() -> float:
    """Return the width of the plate whose rear edge is where the force of the floor acts [m].

    The base rows for q̈ = 0 give the force and moment of the plate on the base. The centre of
    pressure follows from them.
    """
    state = _on_the_plate()
    wrench = (state.h - state.frame_jacobian("tool0")[:3].T @ np.array([-120.0, 0.0, 0.0]))[:6]
    about_the_floor = wrench[4] + state.point("base_link")[2] * wrench[0]
    return float(2 * about_the_floor / wrench[2])


@cache
def _on_the_plate() -> fb.State:
    return with_floating_base(fb.load("ur5", posture=PRESSING_POSTURE), plate=True).standing()


def _by_levers(
    press: float = 120.0,
    *,
    weight: float | None = None,
    below: float = 0.0,
    ahead: float | None = None,
) -> float:
    """Return the width at which push and weight have equal moments about the rear edge [m].

    The parameters change one quantity at a time, for known mistakes: press and weight [N], below:
    part of the tool's height that does not count [m], ahead: distance of the weight from the middle
    [m].
    """
    state = _on_the_plate()
    height, weight = (
        state.point("tool0")[2] - below,
        state.robot.weight if weight is None else weight,
    )
    return float(2 * (press * height / weight - (state.com[0] if ahead is None else ahead)))


def _in_proportion() -> float:
    """Return the width if the largest push were proportional to the width [m]."""
    twice = 2 * _on_the_plate().com[0]
    return float(PLATE_SIZE[0] * (_by_levers() + twice) / (PLATE_SIZE[0] + twice))


@array_judge((4, 3), (12,))
def _judge_thrust(f: Array) -> Verdict:
    """Judge thrusts at the four feet of a standing go2.

    The thrusts must add up to 200 N straight up, without a moment about the centre of mass.
    """
    f = f.reshape(4, 3)
    state = fb.load("go2").standing()
    eom = fb.equations_of_motion(state, fb.Contacts.points(state.robot))
    # by the momentum that follows from (4), not by sums of forces and moments
    rate = centroidal_momentum_rate(state, eom.acceleration(np.zeros(12), f)) + [
        0.0,
        0.0,
        state.robot.weight,
        0.0,
        0.0,
        0.0,
    ]
    if abs(rate[2] + 200.0) < 0.2:
        return Verdict(
            False,
            "The magnitude is right, but the sign is wrong: these thrusters push the robot down.",
            "sign",
        )
    if abs(rate[:3] - [0.0, 0.0, 200.0]).max() > 0.2:
        return Verdict(
            False,
            f"The forces add up to {format_vector(rate[:3])} N, but they should add up to "
            f"(0, 0, 200) N.",
            "force",
        )
    if abs(rate[3:]).max() > 0.02:
        where = ", ".join(f"{x + 0.0:.1f}" for x in np.round(rate[3:], 1))
        return Verdict(
            False,
            f"The force is right, but there is a moment of ({where}) N·m about the centre of mass, "
            f"which turns the robot.",
            "moment",
        )
    return Verdict(
        True,
        "Straight up without turning. There are six conditions for twelve numbers, so there are "
        "many other answers.",
    )


def _thrusts() -> list[Example]:
    """Return examples: front and rear share the force according to the centre of mass."""
    state = fb.load("go2").standing()
    feet = fb.Contacts.points(state.robot).positions(state) - state.com
    front, rear = abs(feet[0, 0]), abs(feet[2, 0])
    f = 100.0 / (front + rear) * np.outer([rear, rear, front, front], [0.0, 0.0, 1.0])
    right = [(f, ""), (f.ravel(), "")]
    return [*right, (-f, "sign"), (2 * f, "force"), (f[:, [2, 1, 0]], "force"), (f[::-1], "moment")]


EXERCISES = (
    Exercise(
        name="01.1",
        statement="The wall pushes on the arm with f_r at `tool`, both given in the frame of "
        "the base. With which moment, shape (3,), N·m, do the bolts balance it? The weight, "
        "which the bolts carry anyway, does not count.",
        stub="bolts_moment = np.zeros(3)  # N·m: replace this, using tool and f_r",
        solution="bolts_moment = -np.cross(tool, f_r)",
        judge=NumericJudge(
            right=_bolts_moment,
            praise="The bolts balance the wall: force and moment, each with the opposite sign.",
            mistakes={
                "walls_moment": lambda: -_bolts_moment(),
                "about_com": _about_the_centre_of_mass,
                "weight_too": _with_the_weight,
                "zero": lambda: np.zeros(3),
                "height_alone": lambda: np.array([0.0, 60.0 * _pressing_arm()[1][2], 0.0]),
                "elementwise": lambda: _pressing_arm()[1] * _pressing_arm()[2],
                "minus_force": lambda: -_pressing_arm()[2],
                "force_itself": lambda: _pressing_arm()[2],
            },
            hints={
                "walls_moment": "This is the moment of the wall about the base. The bolts "
                "balance it. Check the sign, or the order of the cross product.",
                "about_com": "This moment is about the centre of mass, but the bolts are at the "
                "base.",
                "weight_too": "This includes the moment of the weight. Only the wall counts here.",
                "zero": "Zero would mean that nothing balances the wall. Which lever arm and "
                "which force are needed?",
                "height_alone": "This uses only the height of the tool. The tool is also 11 cm "
                "to the side, and that is a lever arm, too.",
                "elementwise": "* multiplies element by element. A moment is the cross product "
                "of lever arm and force.",
                "minus_force": "This is a force. A moment needs a lever arm: how far from the "
                "base does the force act?",
                "force_itself": "This is f_r itself. A moment needs a lever arm, and the bolts "
                "act in the opposite direction.",
            },
        ),
        explanation="At rest, the moments about the base add up to zero: tool × f_r + τ_b = 0.",
    ),
    Exercise(
        name="01.2",
        statement="solo8 has two joints in each of its four legs. Write its actuation matrix S of "
        "(3).",
        stub="S_solo8 = np.eye(8)  # replace this: stack what is missing",
        solution="S_solo8 = np.vstack([np.zeros((6, 8)), np.eye(8)])",
        judge=ShapeJudge(
            shapes={
                (
                    8,
                    8,
                ): "S maps 8 torques to all rows of the equations of motion. How many rows does "
                "a base add, and where?",
                (8, 14): "This is the transpose of the answer. S maps 8 torques to 14 rows.",
                (
                    9,
                    8,
                ): "A base adds more than one row: three for its position and three for its "
                "orientation.",
                (18, 12): "That is the S of go2, which has three joints in each leg. solo8 has "
                "two.",
                (
                    15,
                    8,
                ): "15 counts the four numbers of the quaternion. The rows of (4) correspond to "
                "velocities, and a rotation has three.",
            },
            judge=NumericJudge(
                right=_actuation_of_solo8,
                praise="Six rows without a motor, then one row for each motor.",
                mistakes={
                    "base_last": lambda: np.roll(_actuation_of_solo8(), -6, axis=0),
                    "zeros": lambda: np.zeros((14, 8)),
                    "sign": lambda: -_actuation_of_solo8(),
                },
                hints={
                    "base_last": "The base comes first in q, as in (2). Here its rows come last.",
                    "zeros": "All entries are zero, so no motor drives anything. Where does "
                    "each torque act?",
                    "sign": "The sign is wrong. Should a positive torque push its joint backwards?",
                },
            ),
        ),
        explanation="(2) puts the six numbers of the base before the joints, so (3) puts six zeros "
        "before the torques.",
    ),
    Exercise(
        name="01.3",
        statement="go2 stands on a level floor with μ = 0.7 and is pulled sideways, low enough "
        "not to tip over. What is the largest horizontal force, in N, that the floor can "
        "balance while the robot stays at rest?",
        stub="most = 1000.0  # N: replace this number by an expression",
        solution="most = 0.7 * go2.mass * 9.81",
        judge=NumericJudge(
            right=_carried_by_friction,
            tolerance=2e-3,  # g may be 9.8
            praise="The force of the bolts had no bound. This force is at most friction times "
            "weight, as long as the robot does not jump.",
            mistakes={
                "g_is_10": lambda: 10 * _carried_by_friction() / 9.81,
                "weight": lambda: _carried_by_friction() / 0.7,
                "one_foot": lambda: _carried_by_friction() / 4,
                "four_weights": lambda: 4 * _carried_by_friction(),
                "mass": lambda: _carried_by_friction() / 9.81,
                "divided": lambda: _carried_by_friction() / 0.49,
                "pyramid": lambda: _carried_by_friction() / np.sqrt(2.0),
                "mu_twice": lambda: 0.7 * _carried_by_friction(),
            },
            hints={
                "g_is_10": "That uses g = 10 m/s². The simulation uses 9.81 m/s².",
                "weight": "That is the weight. A horizontal force has to come from friction.",
                "one_foot": "That is the limit of one foot. Four feet share the force.",
                "four_weights": "All four feet together carry the weight once, not four times.",
                "mass": "That is the friction coefficient times the mass, in kg. A force needs "
                "one more factor.",
                "divided": "Multiply the normal force by μ; do not divide by it.",
                "pyramid": "That is the limit of the controller's four-sided pyramid. The "
                "floor's limit is the round cone, which is larger.",
                "mu_twice": "The friction force is at most μ times the normal force. Multiply "
                "by μ only once.",
            },
        ),
        examples=lambda: [(0.7 * fb.load("go2").mass * 9.8, "")],
        explanation="The friction force at each foot is at most μ times its normal force, and "
        "the normal forces add up to the weight.",
    ),
    Exercise(
        name="01.4",
        statement="A design: go2 floats in its standing posture with a thruster at every foot. "
        "Choose the forces, shape (4, 3), N, world, in the order of `contacts.names`. Together "
        "they must push straight up with 200 N, without any moment. Row i of `levers` is x_i - "
        "x_c.",
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
        name="01.5",
        statement="The arm on its plate is to press with 120 N. How wide, in m, must the square "
        'plate be, at least? `at_rest` has .com and .point("tool0"), and `standing.weight` is '
        "the weight. The plate has no weight. Everything else stays the same.",
        stub="width = 0.4  # m: replace this number by an expression",
        solution='lever = at_rest.point("tool0")[2]\nwidth = 2 * (120 * lever / standing.weight - '
        "at_rest.com[0])",
        judge=NumericJudge(
            right=_held_width,
            praise="A harder push needs a wider plate. A walking robot cannot widen its plate; "
            "it puts a foot in the right place in time.",
            mistakes={
                "half": lambda: _held_width() / 2,
                "height_from_base": lambda: _by_levers(below=PLATE_SIZE[1]),
                "com_in_middle": lambda: _by_levers(ahead=0.0),
                "com_sign": lambda: _by_levers(ahead=-_on_the_plate().com[0]),
                "plate_as_is": lambda: PLATE_SIZE[0],
                "in_proportion": (_in_proportion),
                "half_press": lambda: _by_levers(60.0),
                "mass": lambda: _by_levers(weight=_on_the_plate().robot.mass),
                "exchanged": lambda: _by_levers(_on_the_plate().robot.weight, weight=120.0),
            },
            hints={
                "half": "That is the distance from the middle to the rear edge. The plate "
                "extends as far to the front.",
                "height_from_base": "The plate tips about an edge on the floor. Measure the "
                "height of the tool from the floor, not from the base.",
                "com_in_middle": "Where does the weight act? The centre of mass is not above "
                "the middle of the plate.",
                "com_sign": "The centre of mass is ahead of the middle, and the plate tips "
                "about its rear edge. Does that help or not?",
                "plate_as_is": "That is the present width, and with 120 N this plate tips over.",
                "in_proportion": "The largest push is not proportional to the width of the "
                "plate: part of the lever arm exists without a plate.",
                "half_press": "That is enough for 60 N. The arm is to press with 120 N.",
                "mass": "That uses the mass instead of the weight. A force needs one more factor.",
                "exchanged": "Height and distance from the edge are interchanged. Which lever "
                "arm belongs to the push, and which to the weight?",
            },
        ),
        explanation="Moments about the rear edge: 120 N × height = weight × (half the width + "
        "distance of the centre of mass ahead of the middle).",
    ),
)
