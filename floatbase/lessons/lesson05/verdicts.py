"""Judges of the exercises of lesson 05."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion, torque_force_matrix
from floatbase.lessons.judges import (
    Example,
    NumericJudge,
    Verdict,
    function_or_verdict,
    minimiser_or_verdict,
)
from floatbase.lessons.lesson03 import standing_go2_eom, standing_still_beta
from floatbase.lessons.lesson05.helpers import (
    ConstantForceController,
    arm_robot_eom,
    friction_ratios,
    moving_and_goal_state,
    rotation_error,
    squeeze_forces,
    squeezed_standing_forces,
)
from floatbase.lessons.rounding import rounded
from floatbase.objectives import (
    centroidal_inertia,
    centroidal_momentum_rate,
    force_bias,
    tangential_bias,
    wrench_objective,
)

# N, world, beside the weight: the forces with which exercise 05.3 is tried, the first in simulation
DESIRED_FORCES = {"60 N forwards": (60.0, 0.0), "30 N to the left": (0.0, 30.0)}
# tolerances of exercise 05.3: ratio of tangential to normal force at a foot; N; N·m
MAX_RATIO, MISSED_FORCE, MISSED_MOMENT = 0.5, 1.0, 0.1
ROUNDING = 1e-6  # tolerance of a ratio that just equals the limit
SHORT = 0.1  # s: duration of the simulation
MOST_SLIP = 0.005  # m; soft contacts move by 2 mm without slipping
STIFFNESS, DAMPING = 100.0, 20.0  # 1/s² and 1/s: gains of exercise 05.1


# 05.1 ---------------------------------------------------------------------------------------------


def _force_by_momentum() -> Array:
    """Compute the force from the rate of momentum of all links."""
    now, goal = moving_and_goal_state()
    a = -STIFFNESS * (now.com - goal.com) - DAMPING * now.com_velocity
    qdd = np.linalg.pinv(now.com_jacobian) @ (a - now.com_drift)
    rate = centroidal_momentum_rate(now, qdd)[:3]
    return np.asarray(rate - now.robot.mass * now.robot.model.gravity.linear)


def _moment_by_links() -> Array:
    """Compute the moment from the inertia of each link and the velocity in the base frame."""
    now, goal = moving_and_goal_state()
    R, R_goal = (state.frame_pose("base").rotation for state in (now, goal))
    theta = Rotation.from_matrix(R @ R_goal.T).as_rotvec()
    acceleration = -STIFFNESS * theta - DAMPING * R @ now.v[3:6]
    moment = np.zeros(3)
    for link, pose in zip(now.robot.model.inertias, now.joint_transforms, strict=True):
        r = pose[:3, :3] @ link.lever + pose[:3, 3] - now.com
        moment += pose[:3, :3] @ link.inertia @ pose[:3, :3].T @ acceleration
        moment += link.mass * np.cross(r, np.cross(acceleration, r))
    return moment


def _force(spring: float = 1.0, damping: float = 1.0, gravity: float = 1.0) -> Array:
    """Return the force of exercise 05.1 with other signs, or without some terms."""
    now, goal = moving_and_goal_state()
    a = -spring * STIFFNESS * (now.com - goal.com) - damping * DAMPING * now.com_velocity
    return np.asarray(now.robot.mass * (a - gravity * now.robot.model.gravity.linear))


def _moment(spring: float = 1.0, damping: float = 1.0, inertia: bool = True) -> Array:
    """Return the moment of exercise 05.1 with other signs, or without some terms."""
    now, goal = moving_and_goal_state()
    turn = -spring * STIFFNESS * rotation_error(now, goal)
    turn = turn - damping * DAMPING * now.frame_velocity("base")[3:]
    return np.asarray(centroidal_inertia(now) @ turn if inertia else turn)


_FORCE = NumericJudge(
    right=_force_by_momentum,
    praise="",
    mistakes={
        "weight_alone": lambda: _force(0.0, 0.0),
        "no_gravity": lambda: _force(gravity=0.0),
        "gravity_sign": lambda: _force(gravity=-1.0),
        "spring_sign": lambda: _force(spring=-1.0),
        "damping_sign": lambda: _force(damping=-1.0),
        "no_spring": lambda: _force(spring=0.0),
        "no_damping": lambda: _force(damping=0.0),
        "no_mass": lambda: _force() / moving_and_goal_state()[0].robot.mass,
        "no_mass_on_a": lambda: (
            _force(gravity=0.0) / moving_and_goal_state()[0].robot.mass + _force(0.0, 0.0)
        ),
    },
    hints={
        "weight_alone": "This holds the robot still. Add the spring and the damper.",
        "no_gravity": "Gravity is missing. The ground must carry the weight, too.",
        "gravity_sign": "The sign of gravity is wrong. Gravity pulls down, so the ground must "
        "push up.",
        "spring_sign": "The spring pushes away from the goal. Check its sign.",
        "damping_sign": "The damper speeds the robot up. Check its sign.",
        "no_spring": "The spring is missing: -k_p e.",
        "no_damping": "The damper is missing: without it the robot swings.",
        "no_mass": "The mass is missing: these are m/s², not N.",
        "no_mass_on_a": "The mass is missing in the terms of spring and damper.",
    },
)
_MOMENT = NumericJudge(
    right=_moment_by_links,
    praise="",
    mistakes={
        "no_moment": lambda: np.zeros(3),
        "turn_sign": lambda: _moment(spring=-1.0),
        "turn_damping_sign": lambda: _moment(damping=-1.0),
        "no_turn": lambda: _moment(spring=0.0),
        "no_turn_damping": lambda: _moment(damping=0.0),
        "no_inertia": lambda: _moment(inertia=False),
    },
    hints={
        "no_moment": "The moment is still zero: nothing turns the base back.",
        "turn_sign": "The spring turns the base away from its goal. Check its sign.",
        "turn_damping_sign": "The damper speeds the rotation up. Check its sign.",
        "no_turn": "The spring is missing: -k_p θ.",
        "no_turn_damping": "The damper is missing: -k_d ω.",
        "no_inertia": "The inertia is missing: these are rad/s², not N·m.",
    },
)


def judge_wrench(answer: Any) -> Verdict:
    """Judge a function that returns the desired force and moment for a state and its goal."""
    program = function_or_verdict(answer)
    if isinstance(program, Verdict):
        return program
    try:
        given = program(*moving_and_goal_state())
    except Exception as error:  # whatever a learner's function raises
        return Verdict(False, f"Your function stops with {type(error).__name__}: {error}", "stops")
    if not isinstance(given, tuple | list | np.ndarray) or len(given) != 2:
        return Verdict(
            False, "Return two things: the force and the moment, each of shape (3,).", "two"
        )
    for judge, part in zip((_FORCE, _MOMENT), given, strict=True):
        verdict = judge(part)
        if not verdict.right:
            name = "Force" if judge is _FORCE else "Moment"
            return replace(verdict, text=f"{name}: {verdict.text}")
    return Verdict(
        True, "Newton's law for the force, Euler's for the moment: the goal of every step below."
    )


def wrench_examples() -> list[Example]:
    """Return examples for exercise 05.1."""

    def constant(force: Any, moment: Any) -> Callable[..., Any]:
        return lambda now, goal: (force, moment)

    force, moment = _force_by_momentum(), _moment_by_links()
    return [
        (constant(force, moment), ""),
        (lambda now, goal: np.array([force, moment]), ""),
        *((constant(wrong(), moment), hint) for hint, wrong in _FORCE.mistakes.items()),
        *((constant(force, wrong()), hint) for hint, wrong in _MOMENT.mistakes.items()),
        (lambda now, goal: force, "two"),
        (lambda now: force, "stops"),
        (constant([1.0], moment), "shape"),
    ]


# 05.2 ---------------------------------------------------------------------------------------------


def smallest_by_zeta() -> Array:
    """Compute the shortest τ with ζ(τ) = λ, by (9) alone."""
    zeta = fb.forces_from_torques(arm_robot_eom())
    return np.asarray(np.linalg.pinv(zeta.A) @ (squeezed_standing_forces() - zeta.b))


def torque_mistakes() -> dict[str, Callable[[], Any]]:
    """Return, for each hint, a function that computes the torques of this mistake."""

    def torques(
        offset: float = 1.0, forces: float = 1.0, back: Callable[[Array], Array] = np.linalg.pinv
    ) -> Callable[[], Any]:
        def value() -> Array:
            C, a = torque_force_matrix(arm_robot_eom())
            return back(C[:, :18]) @ (offset * a - forces * C[:, 18:] @ squeezed_standing_forces())

        return value

    def whole() -> Array:
        C, a = torque_force_matrix(arm_robot_eom())
        return np.asarray((np.linalg.pinv(C) @ a)[:18])

    def still(forces: Callable[[], Array]) -> Callable[[], Array]:
        return lambda: arm_robot_eom().h[6:] - arm_robot_eom().J[:, 6:].T @ forces()

    def standing_forces() -> Array:
        space = fb.feasible_space(arm_robot_eom())
        return space.forces(standing_still_beta(space))

    return {
        "zero": lambda: np.zeros(18),
        "whole_C": whole,
        "a_forgotten": torques(offset=0.0),
        "forces_forgotten": torques(forces=0.0),
        "forces_sign": torques(forces=-1.0),
        "a_sign": torques(offset=-1.0),
        "transpose": torques(back=np.transpose),
        "all_still": still(squeezed_standing_forces),
        "no_squeeze": still(standing_forces),
        "standing": lambda: (
            np.linalg.pinv(fb.forces_from_torques(arm_robot_eom()).A)
            @ (standing_forces() - fb.forces_from_torques(arm_robot_eom()).b)
        ),
    }


# 05.3 ---------------------------------------------------------------------------------------------


def _goal(name: str) -> Array:
    """Return the desired force of exercise 05.3 with that name, with the weight, shape (3,) [N]."""
    return np.array([*DESIRED_FORCES[name], standing_go2_eom().robot.weight])


def _goal_cost(force: Any) -> fb.Quadratic:
    """Return (22) for a force without a moment."""
    eom = standing_go2_eom()
    return wrench_objective(eom.state, eom.contacts, force, [0.0, 0.0, 0.0])


def stub_names() -> dict[str, Any]:
    """Return the names that the stub of exercise 05.3 uses."""
    eom = standing_go2_eom()
    return {
        "wrench_objective": wrench_objective,
        "force_bias": force_bias,
        "tangential_bias": tangential_bias,
        "state": eom.state,
        "contacts": eom.contacts,
        "robot": eom.robot,
    }


def judge_design(answer: Any) -> Verdict:
    """Judge a function that returns a cost on λ, by the minima for some desired forces."""
    program = function_or_verdict(answer)
    if isinstance(program, Verdict):
        return program
    eom = standing_go2_eom()
    found: dict[str, Array] = {}
    for name in DESIRED_FORCES:
        try:
            cost = program(_goal(name))
        except Exception as error:  # whatever a learner's function raises
            return Verdict(
                False, f"Your function stops with {type(error).__name__}: {error}", "stops"
            )
        forces = minimiser_or_verdict(cost, eom.k, "λ")
        if isinstance(forces, Verdict):
            return replace(forces, text=f"With {name}: {forces.text}")
        if wrong := _wrong_forces(eom, forces, _goal(name)):
            return replace(wrong, text=f"With {name}: {wrong.text}")
        found[name] = forces
    return _in_simulation(eom, found["60 N forwards"])


def _wrong_forces(eom: EquationsOfMotion, forces: Array, desired: Array) -> Verdict | None:
    """Return what is wrong with the forces of a design on paper, or None."""
    points, state = forces.reshape(-1, 3), eom.state
    moment = np.cross(eom.contacts.positions(state) - state.com, points).sum(axis=0)
    if np.linalg.norm(points.sum(axis=0) - desired) > MISSED_FORCE:
        if _is_on_torques(eom, forces, desired):
            return Verdict(
                False,
                "That is a cost on τ, which has twelve numbers, too. The answer must be a cost "
                "on λ, without the pullback.",
                "on_torques",
            )
        f_c = rounded(points.sum(axis=0), "N", digits=3)
        return Verdict(
            False,
            f"f_c is {f_c} (forwards, left, up). Does the cost depend on `force`? Then use a "
            f"smaller weight for the preference, or a better preference.",
            "force",
        )
    if np.linalg.norm(moment) > MISSED_MOMENT:
        return Verdict(
            False,
            f"The force is right, but a moment of {np.linalg.norm(moment):.2f} N·m remains.",
            "moment",
        )
    if points[:, 2].min() <= 0:
        return Verdict(False, "The wrench is right, but a foot pulls on the ground.", "pulls")
    ratios = friction_ratios(eom.contacts, forces)
    if ratios.max() > MAX_RATIO + ROUNDING:
        worst = eom.contacts.names[int(np.argmax(np.round(ratios, 4)))].split("_")[0]
        return Verdict(
            False,
            f"The wrench is right, but the tangential force at {worst} is {ratios.max():.3f} times "
            f"the normal force. Which direction of a force does your preference favour, and which "
            f"would be better?",
            "ratio",
        )
    return None


def _is_on_torques(eom: EquationsOfMotion, torques: Array, desired: Array) -> bool:
    """Return whether a minimum with twelve entries, read as torques, nearly gives the wrench."""
    points = fb.forces_from_torques(eom)(torques).reshape(-1, 3)
    return bool(np.linalg.norm(points.sum(axis=0) - desired) < 0.1 * eom.robot.weight)


def _in_simulation(eom: EquationsOfMotion, forces: Array) -> Verdict:
    """Judge the forces in a short simulation on a floor with μ = 0.5."""
    record = fb.rollout(
        fb.Simulation(eom.robot, MAX_RATIO),
        ConstantForceController(eom.robot, eom.contacts, forces),
        SHORT,
    )
    slip = record.slip().max() if record.outcome == "completed" else np.inf
    if slip > MOST_SLIP:
        return Verdict(
            False,
            "This is right on paper, but a foot slips in the simulation with μ = 0.5. Stay a "
            "little further inside the cone.",
            "slips",
        )
    speed = record.final.com_velocity[0]
    return Verdict(True, f"In MuJoCo with μ = 0.5: {speed:.2f} m/s after 0.1 s, and no foot slips.")


def inclined_design(direction: Any = None, weight: float = 1e-3) -> Callable[[Array], fb.Quadratic]:
    """Return a design that measures friction from a direction, by default that of the force."""

    def design(force: Array) -> fb.Quadratic:
        n = np.asarray(force if direction is None else direction, dtype=float)
        inclined = fb.Contacts.points(standing_go2_eom().robot, normals=n / np.linalg.norm(n))
        return _goal_cost(force) + weight * tangential_bias(inclined)

    return design


def design_examples() -> list[Example]:
    """Return examples for exercise 05.3."""
    eom = standing_go2_eom()
    share, forwards = eom.robot.weight / 4, _goal("60 N forwards")
    zeta, right = fb.forces_from_torques(eom), inclined_design()
    pasted = fb.Quadratic.from_residual(np.eye(12), right(forwards).minimiser())
    diagonal = squeeze_forces(eom.contacts)["diagonal"]
    smallest = _goal_cost(forwards).minimiser()
    pulling = fb.Quadratic.from_residual(np.eye(12), smallest + 25.0 * diagonal)

    def biased(weight: float, alpha: float = 0.1) -> Callable[[Array], fb.Quadratic]:
        return lambda force: _goal_cost(force) + weight * force_bias(eom.contacts, alpha, share)

    return [
        (right, ""), (inclined_design(weight=1e-2), ""),
        (biased(1e-3), "ratio"), (inclined_design([30.0, 0.0, eom.robot.weight]), "ratio"),
        (biased(1.0), "force"), (lambda force: pasted, "force"),
        (lambda force: force_bias(eom.contacts, 0.1, share), "force"),
        (biased(1e-3, 10.0), "moment"), (lambda force: pulling, "pulls"),
        (lambda force: right(force).pullback(zeta), "on_torques"),
        (lambda force: _goal_cost(force).pullback(zeta), "on_torques"),
        (lambda force: right(force).pullback(fb.forces_from_torques(arm_robot_eom())),
         "other_block"),
        (lambda force: force, "no_cost"), (lambda: pasted, "stops"),
    ]  # fmt: skip
