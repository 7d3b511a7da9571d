"""Python program that reproduces the settings of the playground."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import MISSING, fields
from functools import lru_cache
from typing import Any

from floatbase.errors import FloatbaseError
from floatbase.objectives import effort_weight
from floatbase.playground import build
from floatbase.playground.perturbed import Perturbation
from floatbase.playground.settings import IDEAL_BANDWIDTH, IDEAL_KP, Settings, six_digits
from floatbase.robots import Robot, load
from floatbase.simulation import Push

_DURATION = 3.0  # s simulated by the program
_PUSH_START = 0.5  # s: the robot is at rest by then


def program(settings: Settings, robot: Robot, period: float, push: Push | None = None) -> str:
    """Write a program that makes and runs the same robot for 3 s."""
    given = build.perturbation(settings, robot)
    is_perturbed = given != Perturbation() or "zeros" in settings.actual_off
    perturbation = given if is_perturbed else None
    lines = _world(settings, perturbation) + _controller(settings, robot)
    run = [f"{round(_DURATION / period) * period:.6g}"]
    if push is not None:
        force = [round(x, 3) for x in push.force.tolist()]
        frame = "" if push.frame == "base" else f", frame={push.frame!r}"
        run.append(f"[fb.Push({force}, {_PUSH_START:g}, {_literal(push.duration)}{frame})]")
    run += [f"control_period={_literal(period)}", "actuators=actuators"]
    return "\n".join(
        [
            *_imports(settings, perturbation),
            "",
            f"robot = {_load_call(robot)}",
            *lines,
            f"run = fb.rollout(sim, controller, {', '.join(run)})",
            'print(run.outcome, f"at {run.time[-1]:.2f} s")',
            "",
        ]
    )


def _imports(settings: Settings, perturbation: Perturbation | None) -> list[str]:
    """Return the import lines that these settings need."""
    lines = ["import floatbase as fb"]
    if settings.bandwidth[1] < IDEAL_BANDWIDTH:
        lines.append("from floatbase.actuators import FirstOrderLag")
    if settings.gait is not None:
        lines.append("from floatbase.behaviours import Gait, Walk")
    elif settings.steps_when_pushed:
        lines.append("from floatbase.behaviours import Gait, Stand")
    names = [
        *(["BaseMotors"] if "zeros" in settings.actual_off else []),
        *(["ModelMismatch"] if build.mismatch(settings) is not None else []),
        *(["Perturbation", "PerturbedSimulation"] if perturbation is not None else []),
        *(["nodding_rotation"] if settings.nod and _stands(settings) else []),
    ]
    return lines + ([f"from floatbase.playground import {', '.join(names)}"] if names else [])


def _stands(settings: Settings) -> bool:
    """Return whether the robot stands without taking steps."""
    return settings.gait is None and not settings.steps_when_pushed


def _world(settings: Settings, perturbation: Perturbation | None) -> list[str]:
    """Return the lines that make `sim`, `state` (the standing state in it) and `actuators`."""
    ground, hertz = _literal(settings.friction[1]), settings.bandwidth[1]
    if settings.slope[1] != 0.0:
        ground = f"fb.Ground({ground}, normal={settings.normals[1]})"
    if perturbation is None:
        lines = [f"sim = fb.Simulation(robot, {ground})"]
    else:
        lines = [f"sim = PerturbedSimulation(robot, {ground}, perturbation={_call(perturbation)})"]
    lines.append("state = sim.state")
    if hertz >= IDEAL_BANDWIDTH:
        return [*lines, "actuators = None"]
    return [
        *lines,
        f"actuators = FirstOrderLag(robot, {_literal(hertz)})",
        "hold = fb.WholeBodyController(robot, fb.Contacts.feet(robot), fb.standing_tasks(state))",
        "actuators.reset(hold(state.q, state.v).tau)",
    ]


def _controller(settings: Settings, robot: Robot) -> list[str]:
    """Return the lines that make `controller`."""
    mu, fraction = _literal(settings.friction[0]), _literal(settings.torque_fraction)
    normals = f", normals={settings.normals[0]}" if settings.slope[0] else ""
    lines = [f"contacts = fb.Contacts.feet(robot, {mu}{normals})"]
    assumed, options = build.mismatch(settings), ""
    if assumed is not None:
        lines.append(f"mismatch = {_call(assumed)}")
    if settings.facets != 4:
        options += f", facets={settings.facets}"
    if settings.torque_fraction != 1.0:
        options += f", torque_limits={fraction} * robot.torque_limits"
    if settings.min_normal_force:
        options += f", min_normal_force={_literal(settings.min_normal_force)}"
    if assumed is not None:
        options += ", modify_qp=mismatch"
    if settings.gait is not None:
        start = _literal(build.gait(settings, robot).start)
        *velocity, yaw_rate = map(_literal, settings.velocity)
        lines += [
            f"gait = Gait.{settings.gait}(robot, start={start})",
            f"controller = Walk(robot, contacts, gait, [{', '.join(velocity)}], "
            f"{yaw_rate}{options})",
        ]
    elif settings.steps_when_pushed:
        name, swing = build.recovery_gait(robot)
        lines += [
            f"gait = Gait.{name}(robot, swing={_literal(swing)})",
            f"controller = Stand(robot, contacts, gait{options})",
        ]
    else:
        lines += _standing(settings, robot)
        options += ", joint_limits=None"
        lines.append(f"controller = fb.WholeBodyController(robot, contacts, tasks{options})")
    if "zeros" in settings.actual_off:
        arguments = "controller, sim" + ("" if assumed is None else ", mismatch")
        lines.append(f"controller = BaseMotors({arguments})")
    return lines


def _standing(settings: Settings, robot: Robot) -> list[str]:
    """Return the lines that make `tasks`, and `contacts` without lifted feet."""
    motion, posture, effort = settings.weights
    weight = f", weight={_literal(six_digits(10.0 * motion))}" if motion != 1.0 else ""
    gains = ("" if settings.kp == IDEAL_KP else f", kp={_literal(settings.kp)}") + weight
    com, level = "state.com", "state.frame_pose('base').rotation"
    if any(settings.com_shift):
        com += f" + {list(settings.com_shift)}"
    if settings.nod:
        level = (
            f"nodding_rotation({level}, {_literal(settings.nod)}, {_literal(settings.start_time)})"
        )
    weight = f", weight={_literal(six_digits(1e-3 * posture))}" if posture != 1.0 else ""
    lines = [
        f"com = fb.CoMTask({com}{gains})",
        f"level = fb.OrientationTask('base', {level}{gains})",
        f"posture = fb.PostureTask(state.q{weight})",
        "tasks = [com, level, posture]",
    ]
    if effort != 1.0:
        weight = f"weight={_literal(six_digits(effort_weight(robot) * effort))}"
        lines.append(f"tasks += [fb.ForceTask({weight}), fb.TorqueTask({weight})]")
    if settings.lifted_feet:
        names = list(settings.lifted_feet)
        lines += [
            f"up = [0.0, 0.0, {_literal(build.LIFT_HEIGHT)}]",
            f"lifted = {names}",
            "tasks += [fb.FrameTask(name, state.point(name) + up) for name in lifted]",
            "contacts = contacts.without(*lifted)",
        ]
    return lines


def _call(value: Any) -> str:
    """Return the call that makes a dataclass, with the fields that differ from their defaults."""
    given = {
        field.name: getattr(value, field.name)
        for field in fields(value)
        if field.default is MISSING or getattr(value, field.name) != field.default
    }
    arguments = ", ".join(f"{name}={_literal(entry)}" for name, entry in given.items())
    return f"{type(value).__name__}({arguments})"


def _literal(value: object) -> str:
    """Return a value as Python source, a number as short as possible without losing digits."""
    short = f"{value:g}" if isinstance(value, float) else ""
    return short if short and float(short) == value else repr(value)


@lru_cache(maxsize=8)
def _load_call(robot: Robot) -> str:
    """Return the call that loads a robot."""
    with suppress(FloatbaseError):
        if load(robot.name) == robot:
            return f"fb.load({robot.name!r})"
    given = [repr(f"{robot.name}.urdf"), *([] if robot.is_floating else ["floating=False"])]
    if robot.feet:
        given.append(f"feet={[foot.frame for foot in robot.feet]}")
        if not robot.feet[0].is_flat and robot.feet[0].axis is None:  # others are found in the URDF
            given.append(f"foot_radius={robot.feet[0].radius!r}")
    return f"fb.load_urdf({', '.join(given)})"
