"""Robots as data for a web page: the model of the physics, and the problem arrays of the tick.

Everything that a control of the page changes has its name and its place in the arrays. The places
are found by comparison: the arrays are packed again with another value, and what differs depends on
that value.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from floatbase._validation import Array
from floatbase.behaviours import WEIGHT_SHIFT_TIME, Gait, Walk
from floatbase.behaviours.walk import compiled_targets, plan
from floatbase.behaviours.walk.gait import TIME_TOLERANCE
from floatbase.behaviours.walk.gait_limits import speed_fractions
from floatbase.behaviours.walk.posture import MIN_SIDE_FRACTION, WalkingPosture
from floatbase.behaviours.walk.stance_controllers import StanceControllers
from floatbase.control import JointLimits, WholeBodyController
from floatbase.control.tick import CompiledTick, dynamics, tick
from floatbase.dynamics import Contacts, EquationsOfMotion
from floatbase.errors import InputError
from floatbase.live.physics import model_data
from floatbase.live.settings import SETTINGS
from floatbase.objectives import CoMTask, FrameTask, standing_tasks
from floatbase.qp import QP
from floatbase.robots import Robot, State
from floatbase.simulation import Simulation

ROBOTS = ("go2", "solo12", "talos")
MU = SETTINGS["friction"].first  # initial friction coefficient, assumed and actual
FACETS = (4, 8, 16)
TIMESTEP = 1e-3  # s
LIFT_HEIGHT = 0.04  # m above the ground, of a lifted foot
# the fraction of the way from the middle of all feet to that of three feet that the centre of mass
# moves before the fourth foot is lifted
_SHIFT_FRACTION = 0.8
# largest velocity forwards [m/s] and yaw rate [rad/s] in the page, by gait: all robots can follow
MOST = {"trot": (0.6, 0.8), "walk": (0.2, 0.15)}
# of the plans of a walk
_WALK_CONSTANTS = {
    "timeTolerance": TIME_TOLERANCE,
    "nPhases": plan.PLANNED_PHASES,
    "horizon": plan.PLAN_HORIZON,
    "settlingTime": plan.TOUCHDOWN_SETTLING_TIME,
    "shiftTime": plan.WEIGHT_SHIFT_TIME,
    "deadZone": plan.DCM_DEAD_ZONE,
    "pathShift": plan.PATH_SHIFT_THRESHOLD,
    "sideFraction": MIN_SIDE_FRACTION,
}
_SIZES: Any = vars(tick)["size"]  # names of the entries of the tick's `sizes`
_TOLERANCE = 1e-12  # relative, of numbers that depend linearly on a value


def robot_data(robot: Robot) -> dict[str, Any]:
    """Return a robot and the problems of its stances as data for the page's engine."""
    if not robot.is_floating or robot.nq != robot.nv + 1:
        raise InputError(
            f"{robot.name} has a fixed base, or joints without limits. The page needs a floating "
            f"base and joints with limits."
        )
    sim = Simulation(robot, MU, TIMESTEP)
    sim.reset(robot.standing())
    feet = Contacts.feet(robot)
    return {
        "name": robot.name,
        "nq": robot.nq,
        "nv": robot.nv,
        "d": robot.d,
        "mass": robot.mass,
        "weight": robot.weight,
        "gravity": robot.gravity,
        "mu": MU,
        "facets": FACETS,
        "jointNames": list(robot.joint_names),
        "torqueLimits": robot.torque_limits.tolist(),
        "legs": {name: list(feet.only(name).point_names) for name in feet.names},
        **model_data(sim),
        "problems": {
            **{
                name: _standing_problem(robot, lifted, facets)
                for name, lifted, facets in _variants(robot)
            },
            **_walking_problems(robot),
        },
        "walking": _walking_data(robot),
    }


def robot_json(robot: Robot, more: Mapping[str, Any] | None = None) -> str:
    """Return `robot_data` as JSON text that JavaScript reads, infinite numbers included."""
    text = json.dumps(robot_data(robot) | dict(more or {}), separators=(",", ":"))
    # JSON has no infinity, but JavaScript reads a number that is too large as one
    return text.replace("Infinity", "1e999")


def controller(
    robot: Robot,
    mu: float = MU,
    lifted: str | None = None,
    facets: int = FACETS[0],
    torque_fraction: float = 1.0,
    modify_qp: Callable[[QP, EquationsOfMotion], QP] | None = None,
) -> WholeBodyController:
    """Make the controller that the page runs, in Python."""
    standing = robot.standing()
    tasks: list[Any] = list(standing_tasks(standing))
    if lifted is not None:
        tasks[0] = replace(tasks[0], position=_three_feet_com(standing, lifted))
        tasks.append(FrameTask(lifted, standing.point(lifted) + [0.0, 0.0, LIFT_HEIGHT]))
    return WholeBodyController(
        robot,
        _stance(robot, mu, lifted),
        tasks,
        facets=facets,
        torque_limits=torque_fraction * robot.torque_limits,
        joint_limits=JointLimits.of(robot),  # the page does not change how hard joints may brake
        modify_qp=modify_qp,
    )


def _variants(robot: Robot) -> Iterator[tuple[str, str | None, int]]:
    """Yield name, lifted foot and number of facets of each problem."""
    three = [foot.frame for foot in robot.feet] if len(robot.feet) == 4 else []
    for lifted in (None, *three):
        for facets in FACETS:
            yield f"{lifted or 'all'}/{facets}", lifted, facets


def _stance(robot: Robot, mu: float, lifted: str | None) -> Contacts:
    """Return the contacts of all feet, without a lifted one."""
    feet = Contacts.feet(robot, mu)
    return feet if lifted is None else feet.without(lifted)


def _three_feet_com(standing: State, lifted: str) -> Array:
    """Return the target of the centre of mass with one foot lifted, shape (3,) [m]."""
    feet = Contacts.feet(standing.robot)
    middle = feet.positions(standing).mean(axis=0)
    shift = feet.without(lifted).positions(standing).mean(axis=0) - middle
    return standing.com + _SHIFT_FRACTION * shift * [1.0, 1.0, 0.0]


def _standing_problem(robot: Robot, lifted: str | None, facets: int) -> dict[str, Any]:
    """Return the problem of standing on all feet, or on all but a lifted one."""
    made = controller(robot, lifted=lifted, facets=facets)
    problem = _problem_data(made, lambda mu: _stance(robot, mu, lifted))
    places = _target_places(made)
    target = [problem["inputs"][at] for at in places["com"]]
    problem["parameters"] |= places
    return problem | {"lifted": lifted, "comTarget": target}


def _problem_data(made: WholeBodyController, stance: Callable[[float], Contacts]) -> dict[str, Any]:
    """Return the problem arrays of a controller, and the places of what the controls set."""
    compiled = _compiled(made)
    sizes, ints, floats = compiled.pack(made.problem)
    inputs = compiled.default_inputs
    n_rows = made.limits.facets + 1  # of a cone
    n_floats, n_ints = tick.workspace_sizes(sizes, inputs.packed.size)

    def packed_with(mu: float = MU, torque_fraction: float = 1.0) -> Array:
        limits = replace(
            made.limits, torque_limits=torque_fraction * np.array(made.limits.torque_limits)
        )
        return compiled.pack(replace(made.problem, contacts=stance(mu), limits=limits))[2]

    return {
        "sizes": sizes.tolist(),
        "ints": ints.tolist(),
        "floats": floats.tolist(),
        "inputs": inputs.packed.tolist(),
        "workspace": [n_floats, n_ints],
        "resultSize": compiled.empty_result(inputs).size,
        "k": made.contacts.k,
        "points": list(made.contacts.point_names),
        # the integers begin with a row of 6 for each joint, then one of 9 for each contact: its
        # seventh number says that the controller ignores the contact's force
        "legs": {
            name: 6 * int(sizes[_SIZES.N_JOINTS]) + 9 * i + 6
            for i, name in enumerate(made.contacts.names)
        },
        "flags": {
            "sameRows": _SIZES.SAME_ROWS,
            "underactuated": _SIZES.UNDERACTUATED,
            "cones": _SIZES.HAS_CONES,
        },
        "rows": compiled.row_owners,
        "parameters": {
            "mu": _friction_places(packed_with, MU),
            "torque": _linear_places(lambda fraction: packed_with(torque_fraction=fraction), 1.0),
            # the tables end with cones, torque limits, joint limits (6, d) and three numbers
            "cones": floats.size - 3 - 7 * made.robot.d - 5 * made.contacts.n_points * n_rows,
            # minimum and maximum normal forces follow the targets
            "bounds": compiled.layout.size,
            "torqueLimits": floats.size - 3 - 7 * made.robot.d,
            # the tables begin with `Model.terms` and the links, of which the first is the world
            "gravity": 2,
            "velocityForces": dynamics.VELOCITY_FACTOR,
            "drift": dynamics.DRIFT_FACTOR,
            "baseMass": dynamics.N_TERMS + (dynamics.MASS + 1) + dynamics.MASS,
        },
    }


def _compiled(made: WholeBodyController) -> CompiledTick:
    """Return the compiled step of a controller whose objects are all built in."""
    assert made.compiled is not None
    return made.compiled


def _linear_places(packed: Callable[[float], Array], value: float) -> dict[str, Any]:
    """Return where numbers depend linearly on a value, and how: base + slope × value."""
    at, first, second, third = _three_packed(packed, value)
    slope = (second - first) / (0.5 * value)
    base = first - slope * value
    _check(base + slope * 2.0 * value, third)
    return {"at": at.tolist(), "base": base.tolist(), "slope": slope.tolist()}


def _friction_places(packed: Callable[[float], Array], mu: float) -> dict[str, Any]:
    """Return where numbers depend on μ: linear ones, and lengths √(base + slope μ²) of rows."""
    at, first, second, third = _three_packed(packed, mu)
    slope = (second - first) / (0.5 * mu)
    base = first - slope * mu
    linear = np.isclose(base + slope * 2.0 * mu, third, rtol=_TOLERANCE, atol=_TOLERANCE)
    squared_slope = (second**2 - first**2) / (1.25 * mu**2)
    squared = first**2 - squared_slope * mu**2
    _check(np.sqrt(squared + squared_slope * 4.0 * mu**2)[~linear], third[~linear])
    return {
        "at": at[linear].tolist(),
        "base": base[linear].tolist(),
        "slope": slope[linear].tolist(),
        "lengthAt": at[~linear].tolist(),
        "lengthBase": squared[~linear].tolist(),
        "lengthSlope": squared_slope[~linear].tolist(),
    }


def _three_packed(packed: Callable[[float], Array], value: float) -> tuple[Any, ...]:
    """Return which numbers depend on a value, and these numbers at 1, 1.5 and 2 times the value."""
    first, second, third = (packed(factor * value) for factor in (1.0, 1.5, 2.0))
    at = np.flatnonzero(first != third)
    return at, first[at], second[at], third[at]


def _check(found: Array, expected: Array) -> None:
    """Assert that numbers follow the rule by which the page will compute them."""
    assert np.allclose(found, expected, rtol=_TOLERANCE, atol=_TOLERANCE)


def _target_places(made: WholeBodyController) -> dict[str, Any]:
    """Return where the targets of the centre of mass and of a lifted foot are among the inputs."""
    compiled = _compiled(made)

    def places(kind: type[CoMTask] | type[FrameTask]) -> list[int]:
        (at,) = [each.entries for each in compiled.layout.tasks if isinstance(each.task, kind)]
        return list(range(at.start, at.start + 3))  # the position comes first

    found: dict[str, Any] = {"com": places(CoMTask)}
    if any(isinstance(each.task, FrameTask) for each in compiled.layout.tasks):
        found["lift"] = places(FrameTask)[2]
        found["liftedHeight"] = float(compiled.default_inputs.packed[found["lift"]])
    return found


def gaits(robot: Robot) -> dict[str, Gait]:
    """Return the gaits of a robot in the page, by name; empty without four point feet."""
    if len(robot.feet) != 4:
        return {}
    return {
        "trot": Gait.trot(robot, start=WEIGHT_SHIFT_TIME),
        "walk": Gait.walk(robot, start=WEIGHT_SHIFT_TIME),
    }


def _walks(robot: Robot, facets: int) -> dict[str, Walk]:
    """Return a walk with each gait, at its largest speed."""
    contacts = Contacts.feet(robot, MU)
    return {
        name: Walk(robot, contacts, gait, (MOST[name][0], 0.0), MOST[name][1], facets=facets)
        for name, gait in gaits(robot).items()
    }


def _walking_problems(robot: Robot) -> dict[str, Any]:
    """Return the problems of all stances of all gaits."""
    problems = {}
    for facets in FACETS:
        for walk in _walks(robot, facets).values():
            for stance, made in walk.controllers.items():
                problem = _problem_data(made, partial(_standing_feet, robot, stance))
                layout, names = _compiled(made).layout, made.contacts.names
                entries = {name: entries.start for name, entries in layout.names.items()}
                problem["entries"] = {
                    "com": entries["centre of mass"],
                    "base": entries["orientation of base"],
                    "feet": {
                        foot.frame: entries[f"position of {foot.frame}"]
                        for foot in robot.feet
                        if foot.frame not in names
                    },
                    # the largest normal forces follow the targets and the least normal forces
                    "largestForce": layout.size + len(names),
                }
                problems[f"walk/{'+'.join(stance)}/{facets}"] = problem
    return problems


def _standing_feet(robot: Robot, stance: tuple[str, ...], mu: float) -> Contacts:
    """Return the contacts of the feet of a stance."""
    return Contacts.feet(robot, mu).only(*stance)


def _walking_data(robot: Robot) -> dict[str, Any] | None:
    """Return what the page's plan of a walk needs to know, None for a robot that only stands."""
    walks = _walks(robot, FACETS[0])
    if not walks:
        return None
    assert all(walk.speed_fraction == 1.0 for walk in walks.values())
    posture = WalkingPosture(Contacts.feet(robot, MU), robot.standing())
    options = walks["trot"].options
    return {
        "constants": _WALK_CONSTANTS,
        # where the numbers of a plan are in the arrays of `compiled_targets`
        "layout": {name: value for name, value in vars(compiled_targets).items() if name.isupper()},
        "feet": {foot: nominal.tolist() for foot, nominal in posture.nominal_feet.items()},
        "comHeight": float(posture.state.com[2]),
        "groundHeight": posture.ground_height,
        "baseRotation": posture.rotation("base").ravel().tolist(),
        "reach": options.reach,
        "clearance": options.clearance,
        "acceleration": options.acceleration.tolist(),
        "ramp": options.ramp,
        "fullLoad": StanceControllers(posture, options).full_loads,
        "gaits": {
            name: _gait_data(walk, posture) | {"most": MOST[name]} for name, walk in walks.items()
        },
    }


def _gait_data(walk: Walk, posture: WalkingPosture) -> dict[str, Any]:
    """Return the gait of a walk, and the fraction of its velocity in the first period."""
    gait, options = walk.gait, walk.options
    motion = np.array([*walk.velocity, walk.yaw_rate])
    fractions = speed_fractions(gait, posture, options.reach, motion, options.acceleration[0])
    return {
        "offsets": dict(gait.offsets),
        "period": gait.period,
        "swing": gait.swing,
        "firstFraction": fractions[0],
    }
