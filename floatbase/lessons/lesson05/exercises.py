"""Exercises of lesson 05, Steering the centre of mass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion, torque_force_matrix
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    ShapeJudge,
    Verdict,
    first_fault,
    function_or_verdict,
    minimizer_or_verdict,
    stopped,
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


def _force_mistakes() -> list[Mistake]:
    mass = moving_and_goal_state()[0].robot.mass
    return [
        ("weight_alone", _force(0.0, 0.0), "This holds the robot still. Add the spring and the "
         "damper."),
        ("no_gravity", _force(gravity=0.0), "Gravity is missing. The ground must carry the weight, "
         "too."),
        ("gravity_sign", _force(gravity=-1.0), "The sign of gravity is wrong. Gravity pulls down, "
         "so the ground must push up."),
        ("spring_sign", _force(spring=-1.0), "The spring pushes away from the goal. Check its "
         "sign."),
        ("damping_sign", _force(damping=-1.0), "The damper speeds the robot up. Check its sign."),
        ("no_spring", _force(spring=0.0), "The spring is missing: -k_p e."),
        ("no_damping", _force(damping=0.0), "The damper is missing: without it the robot swings."),
        ("no_mass", _force() / mass, "The mass is missing: these are m/s², not N."),
        ("no_mass_on_a", _force(gravity=0.0) / mass + _force(0.0, 0.0), "The mass is missing in "
         "the terms of spring and damper."),
    ]  # fmt: skip


def _moment_mistakes() -> list[Mistake]:
    return [
        ("no_moment", np.zeros(3), "The moment is still zero: nothing turns the base back."),
        ("turn_sign", _moment(spring=-1.0), "The spring turns the base away from its goal. Check "
         "its sign."),
        ("turn_damping_sign", _moment(damping=-1.0), "The damper speeds the rotation up. Check its "
         "sign."),
        ("no_turn", _moment(spring=0.0), "The spring is missing: -k_p θ."),
        ("no_turn_damping", _moment(damping=0.0), "The damper is missing: -k_d ω."),
        ("no_inertia", _moment(inertia=False), "The inertia is missing: these are rad/s², not "
         "N·m."),
    ]  # fmt: skip


_FORCE = NumericJudge(right=_force_by_momentum, praise="", mistakes=_force_mistakes)
_MOMENT = NumericJudge(right=_moment_by_links, praise="", mistakes=_moment_mistakes)


def judge_wrench(answer: Any) -> Verdict:
    """Judge a function that returns the desired force and moment for a state and its goal."""
    program = function_or_verdict(answer)
    if isinstance(program, Verdict):
        return program
    try:
        given = program(*moving_and_goal_state())
    except Exception as error:  # whatever a learner's function raises
        return stopped(error)
    if not isinstance(given, tuple | list | np.ndarray) or len(given) != 2:
        text = "Return two things: the force and the moment, each of shape (3,)."
        return Verdict(False, text, "two")
    for name, judge, part in zip(("Force", "Moment"), (_FORCE, _MOMENT), given, strict=True):
        verdict = judge(part)
        if not verdict.right:
            return replace(verdict, text=f"{name}: {verdict.text}")
    return Verdict(True, "This is Newton's law for the force and Euler's law for the moment.")


def wrench_examples() -> list[Example]:
    """Return examples for exercise 05.1."""

    def constant(force: Any, moment: Any) -> Callable[..., Any]:
        return lambda now, goal: (force, moment)

    force, moment = _force_by_momentum(), _moment_by_links()
    return [
        (constant(force, moment), ""), (lambda now, goal: np.array([force, moment]), ""),
        *((constant(wrong, moment), hint) for hint, wrong, _ in _force_mistakes()),
        *((constant(force, wrong), hint) for hint, wrong, _ in _moment_mistakes()),
        (lambda now, goal: force, "two"), (lambda now: force, "stops"),
        (constant([1.0], moment), "shape"),
    ]  # fmt: skip


# 05.2 ---------------------------------------------------------------------------------------------


def smallest_by_zeta() -> Array:
    """Compute the shortest τ with ζ(τ) = λ, by (9) alone."""
    zeta = fb.forces_from_torques(arm_robot_eom())
    return np.asarray(np.linalg.pinv(zeta.A) @ (squeezed_standing_forces() - zeta.b))


def torque_mistakes() -> list[Mistake]:
    """Return the mistakes of exercise 05.2."""
    eom, pressed = arm_robot_eom(), squeezed_standing_forces()
    space = fb.feasible_space(eom)
    (C, a), zeta = torque_force_matrix(eom), fb.forces_from_torques(eom)
    C_tau, load, inverse = C[:, :18], C[:, 18:] @ pressed, np.linalg.pinv(C[:, :18])
    standing, lever = space.forces(standing_still_beta(space)), eom.J[:, 6:].T
    return [
        ("zero", np.zeros(18), "There is no answer yet. Without torques the feet carry only "
         "16 % of the weight."),
        ("whole_C", (np.linalg.pinv(C) @ a)[:18], "The pseudo-inverse of the whole C gives the "
         "shortest (τ, λ). But λ is not free: it must be `pressed`."),
        ("a_forgotten", inverse @ -load, "a is missing, and it contains gravity."),
        ("forces_forgotten", inverse @ a, "λ is missing. Move C_λ λ to the right-hand side, then "
         "solve for τ."),
        ("forces_sign", inverse @ (a + load), "The sign of C_λ λ is wrong. It changes when the "
         "term moves to the right-hand side."),
        ("a_sign", inverse @ (-a - load), "The sign of a is wrong."),
        ("transpose", C_tau.T @ (a - load), "A transpose is not an inverse. Use the pseudo-inverse "
         "of C_τ."),
        ("all_still", eom.h[6:] - lever @ pressed, "These torques hold all joints still, including "
         "the arm. Smaller torques give the same forces."),
        ("no_squeeze", eom.h[6:] - lever @ standing, "These torques hold the robot still, but "
         "without the internal force."),
        ("standing", np.linalg.pinv(zeta.A) @ (standing - zeta.b), "These torques are for the "
         "forces of standing still. `pressed` has 20 N more between the front feet."),
    ]  # fmt: skip


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
            return stopped(error)
        forces = minimizer_or_verdict(cost, eom.k, "λ")
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
    misses = bool(np.linalg.norm(points.sum(axis=0) - desired) > MISSED_FORCE)
    f_c = rounded(points.sum(axis=0), "N", digits=3)
    fault = first_fault([
        ("on_torques", misses and _is_on_torques(eom, forces, desired), "That is a cost on τ, "
         "which has twelve numbers, too. The answer must be a cost on λ, without the pullback."),
        ("force", misses, f"f_c is {f_c} (forwards, left, up). Does the cost depend on `force`? "
         "Then use a smaller weight for the preference, or a better preference."),
        ("moment", np.linalg.norm(moment) > MISSED_MOMENT, "The force is right, but a moment of "
         f"{np.linalg.norm(moment):.2f} N·m remains."),
        ("pulls", points[:, 2].min() <= 0, "The wrench is right, but a foot pulls on the ground."),
    ])  # fmt: skip
    if fault:
        return fault
    ratios = friction_ratios(eom.contacts, forces)
    worst = eom.contacts.names[int(np.argmax(np.round(ratios, 4)))].split("_")[0]
    return first_fault([
        ("ratio", ratios.max() > MAX_RATIO + ROUNDING, "The wrench is right, but the tangential "
         f"force at {worst} is {ratios.max():.3f} times the normal force. Which direction of a "
         "force does your preference favour, and which would be better?"),
    ])  # fmt: skip


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
    speed = record.final.com_velocity[0]
    return first_fault([
        ("slips", slip > MOST_SLIP, "This is right on paper, but a foot slips in the simulation "
         "with μ = 0.5. Stay a little further inside the cone."),
    ]) or Verdict(
        True, f"In MuJoCo with μ = 0.5: {speed:.2f} m/s after 0.1 s, and no foot slips."
    )  # fmt: skip


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
    pasted = fb.Quadratic.from_residual(np.eye(12), right(forwards).minimizer())
    diagonal = squeeze_forces(eom.contacts)["diagonal"]
    smallest = _goal_cost(forwards).minimizer()
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


EXERCISES = (
    Exercise(
        name="05.1",
        stub="def desired_wrench(now, goal):\n"
        "    force = np.array([0, 0, robot.weight])  # change both\n"
        "    moment = np.zeros(3)\n"
        "    return force, moment",
        solution="from floatbase.lessons.lesson05 import rotation_error\n"
        "from floatbase.objectives import centroidal_inertia\n\n\n"
        "def desired_wrench(now, goal):\n"
        "    weight = np.array([0, 0, robot.weight])\n"
        "    a = -100 * (now.com - goal.com) - 20 * now.com_velocity\n"
        '    omega = now.frame_velocity("base")[3:]\n'
        "    turn = -100 * rotation_error(now, goal) - 20 * omega\n"
        "    return robot.mass * a + weight, centroidal_inertia(now) @ turn",
        judge=judge_wrench,
        namespace=lambda: {"robot": standing_go2_eom().robot},
        examples=wrench_examples,
        explanation="By Newton's law, m a = f_c + m g with g pointing down. The moment is the rate "
        "of the angular momentum, for locked joints and slow rotation. `desired_wrench(state, a, "
        "rate)` of floatbase.objectives computes both.",
    ),
    Exercise(
        name="05.2",
        stub="tau_pressed = np.zeros(18)  # replace: from C_tau, C_forces, a and pressed",
        solution="tau_pressed = np.linalg.pinv(C_tau) @ (a - C_forces @ pressed)",
        judge=ShapeJudge(
            NumericJudge(
                right=smallest_by_zeta,
                praise="(25) in one line: λ determines τ through the pseudo-inverse of C_τ alone.",
                mistakes=torque_mistakes,
            ),
            {
                (12,): "12 numbers are forces. anymal_kinova has 18 motors.",
                (30,): "30 numbers are (τ, λ), but λ is given.",
                (24,): "24 numbers are accelerations, or torques with six zeros for the base.",
            },
        ),
        namespace=lambda: {"pressed": squeezed_standing_forces()},
        explanation="(10) is C_τ τ + C_λ λ = a. For a given λ this is a linear system for τ, "
        "with more unknowns than equations. The pseudo-inverse gives its shortest solution. β "
        "is not needed.",
    ),
    Exercise(
        name="05.3",
        stub="def design(force):  # N, world, with the weight\n"
        "    goal = wrench_objective(state, contacts, force, np.zeros(3))\n"
        "    return goal + 1e-3 * force_bias(contacts, 0.1, robot.weight / 4)  # change it",
        solution="from floatbase.objectives import tangential_bias\n\n\n"
        "def design(force):  # N, world, with the weight\n"
        "    goal = wrench_objective(state, contacts, force, np.zeros(3))\n"
        "    direction = force / np.linalg.norm(force)  # of all forces together\n"
        "    inclined = fb.Contacts.points(robot, normals=direction)\n"
        "    return goal + 1e-3 * tangential_bias(inclined)",
        judge=judge_design,
        namespace=stub_names,
        examples=design_examples,
        explanation="(23) prefers forces without friction, and distributes the friction "
        "equally. Where friction is the goal, the direction of the total force is a better "
        "preference. Then the force at each foot has the same direction as the sum, with a "
        "ratio of 60 / 158 in the first case.",
    ),
)
