"""`push_recovery`: the largest push that a controller survives in each direction, and what theory
says beside it.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import ceil
from typing import Any

import cloudpickle
import numpy as np

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_positive,
    cached_property,
    read_only,
    signature_error,
)
from floatbase.dynamics import Contacts
from floatbase.errors import InfeasibleError, InputError, SimulationError
from floatbase.friction import WrenchSet, wrench_set
from floatbase.robots import State
from floatbase.simulation.physics import Push, Simulation
from floatbase.simulation.record import Rollout
from floatbase.simulation.rollout import Controller, rollout
from floatbase.simulation.sweep import sweep

_MIN_DIRECTIONS = 3  # directions: fewer are no closed line
_FACETS = 16  # of the polyhedra in the friction cones: they leave out 2 % of them
# of the robot's weight: a push that is survived beyond it is not carried by the ground
_MAX_FORCE_IN_WEIGHTS = 100.0
# least cosine between direction and an edge's normal: less is an edge along the direction, never
# met
_MIN_COSINE = 1e-9


@dataclass(frozen=True, eq=False)
class PushRecovery(Value):
    """The largest push that was survived in each of n directions, and theory's curves beside it.
    All pushes are in N.

    directions: (n,) rad, of the pushes, in the world's horizontal plane, from x towards y.
    pushes: (n,) N, survived; a push that is `resolution` larger was not.
    resolution: N, spacing of the pushes that are tried.
    duration: s, of each push.
    frame: the frame that was pushed.
    state, contacts: the robot and its stance, as the simulation began, before anything pushed.

    `floatbase.viewer.plots.push_recovery_plots` plots it, and draws it on the ground below the
    robot.
    """

    directions: Array
    pushes: Array
    resolution: float
    duration: float
    frame: str
    state: State
    contacts: Contacts

    def __post_init__(self) -> None:
        directions = as_array("directions", self.directions, (None,), "rad")
        object.__setattr__(self, "directions", directions)
        object.__setattr__(self, "pushes", as_array("pushes", self.pushes, directions.shape, "N"))

    @cached_property
    def unit_vectors(self) -> Array:
        """The directions as horizontal vectors, shape (n, 3), world."""
        return _unit_vectors(self.directions)

    @cached_property
    def static_bound(self) -> Array:
        """(20)(21)(28) The largest push that the stance bears for ever without moving, shape (n,),
        N.

        The contact forces must carry the weight and hold against the push, all inside their
        friction cones: `WrenchSet.max_scaling`. 0 where the stance cannot carry the weight alone,
        even if a push would help it to.
        """
        wrenches = wrench_set(self.state, self.contacts, facets=_FACETS)
        lever = self.state.frame_pose(self.frame).translation - wrenches.reference_point
        weight_wrench = np.array([0.0, 0.0, wrenches.weight, 0.0, 0.0, 0.0])
        if not wrenches.contains(weight_wrench):
            return read_only(np.zeros(len(self.directions)))
        return read_only(
            [
                _max_scaling(wrenches, -np.concatenate([d, np.cross(lever, d)]), weight_wrench)
                for d in self.unit_vectors
            ]
        )

    @cached_property
    def capture_point_bound(self) -> Array:
        """The push of `duration` T that ends with the capture point on the border of the support
        region, shape (n,), N.

        The linear inverted pendulum of height h, ω = √(g/h), pushed at the centre of mass, at rest
        at first. As long as its capture point ξ = x + ẋ/ω is in the support region, a robot can
        stop without a step. During the push F the best that it can do is to stand on the border, at
        distance s: ξ̇ = ω (ξ - s) + F / (m ω), so F = m ω² s / (1 - exp(-ω T)). A short push is an
        impulse F T = m ω s; a long one is steady, F h = m g s. What a robot does with its angular
        momentum, and with its height, is left out. The ground is level.
        """
        robot, com = self.state.robot, self.state.com
        height = com[2] - self.contacts.positions(self.state)[:, 2].mean()
        omega = np.sqrt(robot.gravity / height)
        region = wrench_set(self.state, self.contacts).support_region()
        distance = _distance_to_border(region, com[:2], self.unit_vectors[:, :2])
        return read_only(distance * robot.mass * omega**2 / -np.expm1(-omega * self.duration))

    def __repr__(self) -> str:
        span = f"{self.pushes.min():g} to {self.pushes.max():g} N for {self.duration:g} s"
        count = f"{len(self.directions)} directions"
        return (
            f"PushRecovery({self.state.robot.name}, {count}, {span}, in steps of "
            f"{self.resolution:g} N)"
        )


def push_recovery(
    controller: Controller | Callable[[], Any],
    *,
    directions: int = 16,
    duration: float = 0.1,
    frame: str = "base",
    start: float = 0.2,
    observation_time: float = 1.5,
    initial_force: float | None = None,
    resolution: float = 5.0,
    workers: int | None = None,
    cluster: Any = None,
    progress: bool = True,
) -> PushRecovery:
    """The largest horizontal push that a controller survives on the physics, in each of several
    directions, by bisection.

    A push is survived when `rollout` comes to its end: the robot has not fallen, nothing diverged,
    no controller failed. Each push has a simulation and a controller of its own, so that none
    remembers the one before. Bisection takes for granted that whoever survives a push survives
    every smaller one in that direction; it does not look for gaps.

    controller: one that has a `robot`, as `fb.WholeBodyController`, and stands on level ground with
        friction 1; or a function without parameters that makes one, or makes a pair (simulation,
        controller): each push starts in that simulation.
    directions: how many, evenly spaced from the world's x axis.
    duration: s, of the push.
    frame: name of the frame at whose origin it acts.
    start: s, before the push: the robot settles.
    observation_time: s, after the push: a slow fall must happen within it.
    initial_force: N, the first push tried, by default the robot's weight; it is doubled while it is
        survived.
    resolution: N, spacing of the pushes that are tried: pushes are multiples of it.
    workers, cluster, progress: as for `fb.sweep`; a direction is a point.

    Raises `InputError` for numbers that do not fit, and for a robot that is bolted to the ground;
    `SimulationError` where the robot falls without a push, and where it survives a hundred times
    its weight.
    """
    if (
        isinstance(directions, bool)
        or not isinstance(directions, int | np.integer)
        or directions < _MIN_DIRECTIONS
    ):
        raise InputError(
            f"directions is {directions!r}; it must be a whole number ≥ {_MIN_DIRECTIONS}."
        )
    make = _factory_for(controller)
    sim, example = make()
    robot, contacts = sim.robot, getattr(example, "contacts", None)
    if not robot.is_floating:
        raise InputError(
            f"{robot.name} is bolted to the ground and cannot fall: it has no push recovery."
        )
    robot.frame_id(frame)
    settings = {
        "start": as_positive("start", start, "s", allow_zero=True),
        "duration": as_positive("duration", duration, "s"),
        "observation_time": as_positive("observation_time", observation_time, "s"),
        "resolution": as_positive("resolution", resolution, "N"),
    }
    first = ceil(
        as_positive("initial_force", robot.weight if initial_force is None else initial_force, "N")
        / resolution
    )

    def largest_push(direction: float) -> float:  # the bar shows this name
        return _largest_survived(direction, make, frame, first, **settings)

    angles = 2.0 * np.pi * np.arange(directions) / directions
    table = sweep(
        largest_push, {"direction": angles}, workers=workers, cluster=cluster, progress=progress
    )
    for row in table.errors:
        raise SimulationError(
            f"the push towards {np.rad2deg(row['direction']):.0f}° ended with {row['error']}"
        )
    return PushRecovery(
        read_only(angles), read_only(table["result"]), settings["resolution"], settings["duration"],
        frame, sim.state,
        contacts if isinstance(contacts, Contacts) else sim.feet,
    )  # fmt: skip


def _factory_for(controller: Any) -> Callable[[], tuple[Simulation, Any]]:
    """A function that makes a simulation and a controller, from what `push_recovery` was given; it
    can be sent to a worker.
    """
    needs = "a controller that has a robot, or a function without parameters that makes one"
    if not callable(controller):
        raise InputError(
            f"push_recovery needs {needs} or makes a pair (simulation, controller), not "
            f"{controller!r}."
        )
    if not hasattr(controller, "robot"):
        if fault := signature_error(controller):
            raise InputError(f"push_recovery needs {needs}; {fault}.")
        return partial(_simulation_and_controller, controller)
    try:
        return partial(
            _simulation_and_controller, partial(pickle.loads, cloudpickle.dumps(controller))
        )
    except Exception as error:
        raise InputError(
            f"this controller cannot be copied for each push ({type(error).__name__}: {error}): "
            f"give a function without "
            "parameters that makes it."
        ) from error


def _simulation_and_controller(make: Callable[[], Any]) -> tuple[Simulation, Any]:
    """What a function makes, a controller or (simulation, controller), as a pair."""
    made = make()
    if isinstance(made, tuple) and len(made) == 2 and isinstance(made[0], Simulation):
        return made
    if not callable(made) or not hasattr(made, "robot"):
        raise InputError(
            f"the function must make a controller that has a robot, or a pair (simulation, "
            f"controller), not {made!r}."
        )
    return Simulation(made.robot), made


def _largest_survived(
    direction: float,
    make: Callable[[], tuple[Simulation, Any]],
    frame: str,
    initial_steps: int,
    start: float,
    duration: float,
    observation_time: float,
    resolution: float,
) -> float:
    """The largest multiple of `resolution`, N, that is survived as a push in a direction, rad;
    `initial_steps` of them are tried first.
    """

    def pushed(steps: int) -> Rollout:
        sim, controller = make()
        push = Push(
            steps * resolution * _unit_vectors(direction), sim.time + start, duration, frame
        )
        ticks = ceil((start + duration + observation_time) / sim.timestep)
        return rollout(sim, controller, ticks * sim.timestep, [push])

    def survives(steps: int) -> bool:
        return pushed(steps).outcome == "completed"

    survived, fatal = 0, initial_steps
    while survives(fatal):
        survived, fatal = fatal, 2 * fatal
        if fatal * resolution > _MAX_FORCE_IN_WEIGHTS * make()[0].robot.weight:
            raise SimulationError(
                f"a push of {survived * resolution:g} N is survived, and the doubled one is too "
                f"large to be sensible."
            )
    while fatal - survived > 1:
        middle = (survived + fatal) // 2
        survived, fatal = (middle, fatal) if survives(middle) else (survived, middle)
    if survived == 0 and (unpushed := pushed(0)).outcome != "completed":
        how = f"the controller fails without a push: {unpushed.error}"
        raise SimulationError("the robot falls without a push." if unpushed.error is None else how)
    return survived * resolution


def _unit_vectors(directions: Any) -> Array:
    """Horizontal unit vectors, shape (…, 3), for directions, rad."""
    return read_only(
        np.stack([np.cos(directions), np.sin(directions), np.zeros_like(directions)], axis=-1)
    )


def _max_scaling(wrenches: WrenchSet, push: Array, weight_wrench: Array) -> float:
    """The largest multiple of a push that can go with what is carried; 0 where rounding puts that
    beyond the set's border.
    """
    try:
        return max(0.0, wrenches.max_scaling(push, weight_wrench))
    except InfeasibleError:
        return 0.0


def _distance_to_border(polygon: Array, point: Array, directions: Array) -> Array:
    """How far it is from a point to the border of a convex polygon, shape (n,), m; 0 for a point
    that is not inside.

    polygon: (k, 2), m, counter-clockwise. point: (2,), m. directions: (n, 2), unit.
    """
    if len(polygon) < 3:
        return np.zeros(len(directions))
    edges = np.roll(polygon, -1, axis=0) - polygon
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    slack = np.sum(normals * (polygon - point), axis=1)
    if np.any(slack < 0.0):
        return np.zeros(len(directions))
    cosines = directions @ normals.T
    return np.asarray(
        np.min(
            np.where(cosines > _MIN_COSINE, slack / np.maximum(cosines, _MIN_COSINE), np.inf),
            axis=1,
        )
    )
