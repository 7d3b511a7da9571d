"""Judges of the exercises of lesson 05."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion, torque_force_matrix
from floatbase.lessons.judges import Example, Verdict, minimiser_or_verdict
from floatbase.lessons.lesson03 import standing_go2_eom, standing_still_beta
from floatbase.lessons.lesson05.helpers import (
    ConstantForceController,
    arm_robot_eom,
    friction_ratios,
    squeeze_forces,
    squeezed_standing_forces,
    three_feet_eom,
)
from floatbase.lessons.rounding import rounded
from floatbase.objectives import (
    centroidal_momentum_rate,
    com_wrench_map,
    force_bias,
    tangential_bias,
    wrench_objective,
)

UPWARDS = np.array([0.5, 0.0, 1.0])  # m/s², world: the acceleration of exercise 05.2
FORWARDS = 60.0  # N, of exercise 05.4
# tolerances of exercise 05.4: ratio of tangential to normal force at a foot; N; N·m
MOST_LEAN, MISSED_FORCE, MISSED_MOMENT = 0.5, 1.0, 0.1
ROUNDING = 1e-6  # tolerance of a ratio that just equals the limit
SHORT = 0.1  # s: duration of the simulation
MOST_SLIP = 0.005  # m; soft contacts move by 2 mm without slipping


def moments_by_jacobian() -> Array:
    """Compute G_τ from the base rows of J: moments about the base, moved to the CoM."""
    state, J = three_feet_eom().state, three_feet_eom().J
    pose = state.frame_pose("base")
    at_base = pose.rotation @ J[:, 3:6].T
    return at_base + _blocks([pose.translation - state.com] * 3)


def _blocks(levers: Any, order: float = 1.0) -> Array:
    """Return one matrix of a cross product for each lever, side by side."""
    return order * np.hstack([np.cross(lever, np.eye(3)).T for lever in levers])


def moment_mistakes() -> dict[str, Callable[[], Any]]:
    """Return, for each hint, a function that computes the matrix of this mistake."""

    def moments(
        about: Callable[[fb.State], Any], factor: float = 1.0, feet: Any = (0, 1, 2)
    ) -> Callable[[], Array]:
        def value() -> Array:
            state = three_feet_eom().state
            return factor * _blocks(
                three_feet_eom().contacts.positions(state)[list(feet)] - about(state)
            )

        return value

    def com(state: fb.State) -> Any:
        return state.com

    return {
        "zero": lambda: np.zeros((3, 9)),
        "sign": moments(com, -1.0),
        "about_base": moments(lambda state: state.frame_pose("base").translation),
        "about_origin": moments(lambda state: np.zeros(3)),
        "millimetres": moments(com, 1000.0),
        "reversed": moments(com, feet=(2, 1, 0)),
        "order": moments(com, feet=(1, 0, 2)),
    }


def force_by_momentum() -> Array:
    """Compute the force from the rate of momentum of all links.

    Any q̈ with the desired acceleration of the centre of mass will do.
    """
    state = standing_go2_eom().state
    rate = centroidal_momentum_rate(state, np.linalg.pinv(state.com_jacobian) @ UPWARDS)[:3]
    return np.asarray(rate - state.robot.mass * state.robot.model.gravity.linear)


def force_mistakes() -> dict[str, Callable[[], Any]]:
    """Return, for each hint, a function that computes the force of this mistake."""
    robot = standing_go2_eom().robot
    m, weight = robot.mass, np.array([0.0, 0.0, robot.weight])
    g = weight / m
    return {
        "weight_alone": lambda: weight,
        "no_gravity": lambda: m * UPWARDS,
        "gravity_sign": lambda: m * UPWARDS - weight,
        "weight_twice": lambda: m * UPWARDS + 2 * weight,
        "no_mass": lambda: UPWARDS + g,
        "no_mass_on_a": lambda: UPWARDS + weight,
        "g_without_mass": lambda: m * UPWARDS + g,
        "weight_times_a": lambda: robot.weight * UPWARDS + weight,
    }


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


def _cost_60(eom: EquationsOfMotion) -> fb.Quadratic:
    return wrench_objective(
        eom.state, eom.contacts, [FORWARDS, 0.0, eom.robot.weight], [0.0, 0.0, 0.0]
    )


def stub_names() -> dict[str, Any]:
    """Return the names that the stub of exercise 05.4 uses."""
    eom = standing_go2_eom()
    return {
        "cost60": _cost_60(eom),
        "force_bias": force_bias,
        "tangential_bias": tangential_bias,
        "contacts": eom.contacts,
        "robot": eom.robot,
    }


def judge_design(answer: Any) -> Verdict:
    """Judge a cost on λ by its minimum, on paper and in simulation."""
    eom = standing_go2_eom()
    forces = minimiser_or_verdict(answer, eom.k, "λ")
    if isinstance(forces, Verdict):
        return forces
    return _wrong_forces(eom, forces) or _on_physics(eom, forces)


def _wrong_forces(eom: EquationsOfMotion, forces: Array) -> Verdict | None:
    """Return what is wrong with the forces of a design on paper, or None."""
    points, state = forces.reshape(-1, 3), eom.state
    force = points.sum(axis=0) - [FORWARDS, 0.0, eom.robot.weight]
    moment = np.cross(eom.contacts.positions(state) - state.com, points).sum(axis=0)
    if np.linalg.norm(force) > MISSED_FORCE:
        if _is_on_torques(eom, forces):
            return Verdict(
                False,
                "That is a cost on τ, which has twelve numbers, too. The answer must be a cost "
                "on λ, without the pullback.",
                "on_torques",
            )
        f_c = rounded(points.sum(axis=0), "N", digits=3)
        better = "Use a smaller weight for the preference, or a better preference."
        return Verdict(
            False,
            f"The preference spoils the goal: f_c is {f_c} (forwards, left, up). {better}",
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
    lean = friction_ratios(eom.contacts, forces)
    if lean.max() > MOST_LEAN + ROUNDING:
        worst = eom.contacts.names[int(np.argmax(np.round(lean, 4)))].split("_")[0]
        prefers = (
            "Which direction of a force does your preference favour, and which would be better?"
        )
        return Verdict(
            False,
            f"The wrench is right, but the tangential force at {worst} is {lean.max():.2f} times "
            f"the normal force. {prefers}",
            "leans",
        )
    return None


def _is_on_torques(eom: EquationsOfMotion, torques: Array) -> bool:
    """Return whether a minimum with twelve entries, read as torques, nearly gives the wrench."""
    points = fb.forces_from_torques(eom)(torques).reshape(-1, 3)
    return bool(
        np.linalg.norm(points.sum(axis=0) - [FORWARDS, 0.0, eom.robot.weight])
        < 0.1 * eom.robot.weight
    )


def _on_physics(eom: EquationsOfMotion, forces: Array) -> Verdict:
    """Judge the forces in a short simulation on a floor with μ = 0.5."""
    record = fb.rollout(
        fb.Simulation(eom.robot, MOST_LEAN),
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


def _leaning(direction: Any, weight: float = 1e-3) -> fb.Quadratic:
    """Return the cost with the friction measured from a direction other than the normal."""
    eom = standing_go2_eom()
    normals = np.asarray(direction) / np.linalg.norm(direction)
    return _cost_60(eom) + weight * tangential_bias(fb.Contacts.points(eom.robot, normals=normals))


def design_examples() -> list[Example]:
    """Return examples for exercise 05.4."""
    eom = standing_go2_eom()
    cost, share, force = (
        _cost_60(eom),
        eom.robot.weight / 4,
        np.array([FORWARDS, 0.0, eom.robot.weight]),
    )
    right, smallest = _leaning(force), cost.minimiser()
    by_hand = np.linalg.pinv(com_wrench_map(eom.state, eom.contacts).A) @ [*force, 0, 0, 0]
    by_hand[0::3] += [-7.8, -7.8, 7.8, 7.8]
    diagonal = squeeze_forces(eom.contacts)["diagonal"]
    return [
        (right, ""), (fb.Quadratic.from_residual(np.eye(12), by_hand), ""),
        (cost + 1e-3 * force_bias(eom.contacts, 0.1, share), "leans"),
        (_leaning([30.0, 0.0, eom.robot.weight]), "leans"),
        (cost + force_bias(eom.contacts, 0.1, share), "force"),
        (force_bias(eom.contacts, 0.1, share), "force"),
        (cost + 1e-3 * force_bias(eom.contacts, 10.0, share), "moment"),
        (fb.Quadratic.from_residual(np.eye(12), smallest + 25.0 * diagonal), "pulls"),
        (cost.pullback(fb.forces_from_torques(eom)), "on_torques"),
        (right.pullback(fb.forces_from_torques(eom)), "on_torques"),
        (cost.pullback(fb.forces_from_torques(arm_robot_eom())), "other_block"),
    ]  # fmt: skip
