"""`push_recovery`: the largest push that a controller survives in each direction."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import ceil
from typing import Any

import numpy as np

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_integer,
    as_positive,
    cached_property,
    read_only,
    short_repr,
    signature_error,
)
from floatbase.dynamics import Contacts
from floatbase.errors import InfeasibleError, InputError, SimulationError, require
from floatbase.friction import WrenchSet, wrench_set
from floatbase.robots import State
from floatbase.simulation.physics import Simulation
from floatbase.simulation.push import Push
from floatbase.simulation.record import Rollout
from floatbase.simulation.rollout import Controller, rollout
from floatbase.simulation.sweep import sweep

_MAX_DIRECTIONS = 3600  # a tenth of a degree; with more, the computation takes days
_MIN_DIRECTIONS = 3  # directions: fewer do not enclose an area
_FACETS = 16  # facets of the polyhedra inside the friction cones: 2 % of a cone is lost
# times the robot's weight: if a larger push is survived, it is not the ground that resists it
_MAX_FORCE_IN_WEIGHTS = 100.0
# least cosine between a direction and an edge's normal: below it, the edge is parallel to the
# direction, which never meets it
_MIN_COSINE = 1e-9


@dataclass(frozen=True, eq=False)
class PushRecovery(Value):
    """Largest survived push in each of n horizontal directions, with theoretical bounds.

    `floatbase.viewer.plots.push_recovery_plots` plots it, and draws it on the ground below the
    robot.

    Parameters
    ----------
    directions : array_like, shape (n,)
        Directions of the pushes in the world's horizontal plane, from x towards y [rad].
    pushes : array_like, shape (n,)
        Largest survived push in each direction [N]. A push larger by `resolution` was not survived.
    resolution : float
        Spacing of the pushes that were tried [N].
    duration : float
        Duration of each push [s].
    frame : str
        Name of the frame that was pushed.
    state : State
        State at the beginning of the simulation, before the push.
    contacts : Contacts
        Contacts at the beginning of the simulation.
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
        """Directions as horizontal unit vectors, shape (n, 3), world frame."""
        return _unit_vectors(self.directions)

    @cached_property
    def static_bound(self) -> Array:
        """Largest constant push in static equilibrium, shape (n,) [N].

        The contact forces must support the weight and balance the push, all inside their friction
        cones, as in `WrenchSet.max_scaling`. The bound is 0 if the stance cannot support the weight
        alone, even if a push would help.

        Notes
        -----
        [FBR]_, eqs. (20), (21), (28). Static equilibrium with friction is studied in
        [BretlLall2008]_.
        """
        wrenches = wrench_set(self.state, self.contacts, facets=_FACETS)
        lever = self.state.frame_pose(self.frame).translation - wrenches.reference_point
        weight_wrench = np.array([0.0, 0.0, wrenches.weight, 0.0, 0.0, 0.0])
        if not wrenches.contains(weight_wrench):
            return read_only(np.zeros(len(self.directions)))
        pushes = [-np.concatenate([d, np.cross(lever, d)]) for d in self.unit_vectors]
        return read_only([_max_scaling(wrenches, push, weight_wrench) for push in pushes])

    @cached_property
    def capture_point_bound(self) -> Array:
        """Push that moves the capture point to the edge of the support region, shape (n,) [N].

        The model is a linear inverted pendulum of height h with ω = √(g/h), which is pushed at the
        centre of mass for `duration` T and is initially at rest. While its capture point ξ = x +
        ẋ/ω is in the support region, a robot can stop without a step. During the push F, the best
        response is a centre of pressure at the edge, at distance s. Then ξ̇ = ω (ξ - s) + F / (m
        ω), and F = m ω² s / (1 - exp(-ω T)). A short push is an impulse F T = m ω s; a long push is
        constant, F h = m g s. The effects of angular momentum and of changes in height are
        neglected. The ground is level.

        Notes
        -----
        Capture points are from [Pratt2006]_.
        """
        robot, com = self.state.robot, self.state.com
        height = com[2] - self.contacts.positions(self.state)[:, 2].mean()
        omega = np.sqrt(robot.gravity / height)
        region = wrench_set(self.state, self.contacts).support_region()
        distance = _distance_to_border(region, com[:2], self.unit_vectors[:, :2])
        return read_only(distance * robot.mass * omega**2 / -np.expm1(-omega * self.duration))

    def __repr__(self) -> str:
        return (
            f"PushRecovery({self.state.robot.name}, {len(self.directions)} directions, "
            f"{self.pushes.min():g} to {self.pushes.max():g} N for {self.duration:g} s, in steps "
            f"of {self.resolution:g} N)"
        )


def push_recovery(
    controller: Controller | Callable[[], Any],
    *,
    directions: int = 16,
    duration: float = 0.1,
    frame: str = "base",
    start: float = 0.2,
    observation_time: float = 1.5,
    resolution: float = 5.0,
    workers: int | None = None,
    cluster: Any = None,
    progress: bool = True,
) -> PushRecovery:
    """Find the largest horizontal push that a controller survives, in each of several directions.

    The search is a bisection. A push is survived if `rollout` completes: the robot does not fall,
    the simulation does not diverge, and the controller does not fail. Each push gets a new
    simulation and controller, so pushes do not influence each other. The bisection assumes that a
    controller that survives a push also survives every smaller push in that direction; it does not
    search for gaps.

    Parameters
    ----------
    controller : Controller or callable
        A controller with an attribute `robot`, such as `fb.WholeBodyController`, which stands on
        level ground with friction coefficient 1. Alternatively, a function without parameters that
        returns a controller, or a pair (simulation, controller) in whose state each push begins.
    directions : int, optional
        Number of directions, at least 3, evenly spaced from the world's x axis.
    duration : float, optional
        Duration of the push [s].
    frame : str, optional
        Name of the frame at whose origin the push acts.
    start : float, optional
        Time before the push, in which the robot settles [s].
    observation_time : float, optional
        Time after the push [s]. A fall is noticed only if it happens within this time.
    resolution : float, optional
        Spacing of the pushes to try [N]: all pushes are multiples of it. The first push is
        the robot's weight, rounded up. It is doubled as long as it is survived.
    workers : int, optional
        Number of processes, as for `fb.sweep`; each direction is a point of the sweep.
    cluster : distributed.Client or str, optional
        Dask cluster, as for `fb.sweep`.
    progress : bool, optional
        Whether to show a progress bar.

    Returns
    -------
    PushRecovery
        Largest survived push in each direction, with theoretical bounds.

    Raises
    ------
    InputError
        If a number is out of range, or if the robot's base is fixed to the ground.
    SimulationError
        If the robot falls without a push, or if the next push to try exceeds a hundred times the
        robot's weight.
    """
    directions = as_integer("directions", directions, _MIN_DIRECTIONS, _MAX_DIRECTIONS)
    make = _factory_for(controller)
    sim, example = make()
    robot, contacts = sim.robot, getattr(example, "contacts", None)
    if not robot.is_floating:
        raise InputError(
            f"{robot.name} is fixed to the ground and cannot fall. push_recovery needs a robot "
            f"with a floating base."
        )
    robot.frame_id(frame)
    settings = {
        "start": as_positive("start", start, "s", allow_zero=True),
        "duration": as_positive("duration", duration, "s"),
        "observation_time": as_positive("observation_time", observation_time, "s"),
        "resolution": as_positive("resolution", resolution, "N"),
    }
    first = ceil(robot.weight / resolution)

    def largest_push(direction: float) -> float:  # the progress bar shows this name
        return _largest_survived(direction, make, frame, first, **settings)

    angles = 2.0 * np.pi * np.arange(directions) / directions
    table = sweep(
        largest_push, {"direction": angles}, workers=workers, cluster=cluster, progress=progress
    )
    for angle, error in zip(angles, table["error"], strict=True):
        if isinstance(error, str):
            raise SimulationError(f"The push towards {np.rad2deg(angle):.0f}° failed. {error}")
    return PushRecovery(
        read_only(angles), read_only(table["result"].to_numpy(dtype=float)),
        settings["resolution"], settings["duration"],
        frame, sim.state,
        contacts if isinstance(contacts, Contacts) else sim.feet,
    )  # fmt: skip


def _factory_for(controller: Any) -> Callable[[], tuple[Simulation, Any]]:
    """Return a picklable function that makes a simulation and a controller for `push_recovery`."""
    needs = "a controller with a robot, or a function without parameters that returns one"
    if not callable(controller):
        raise InputError(
            f"push_recovery needs {needs} or a pair (simulation, controller), not "
            f"{short_repr(controller)}."
        )
    if not hasattr(controller, "robot"):
        if fault := signature_error(controller):
            raise InputError(f"push_recovery needs {needs}; {fault}.")
        return partial(_simulation_and_controller, controller)
    cloudpickle = require("cloudpickle", "sweep")
    try:
        copy = partial(pickle.loads, cloudpickle.dumps(controller))
        return partial(_simulation_and_controller, copy)
    except Exception as error:
        raise InputError(
            f"This controller cannot be copied for each push ({type(error).__name__}: {error}). "
            f"Pass a function without parameters that returns it."
        ) from error


def _simulation_and_controller(make: Callable[[], Any]) -> tuple[Simulation, Any]:
    """Return what a function makes, a controller or (simulation, controller), as a pair."""
    made = make()
    if isinstance(made, tuple) and len(made) == 2 and isinstance(made[0], Simulation):
        return made
    if not callable(made) or not hasattr(made, "robot"):
        raise InputError(
            f"The function must return a controller with a robot, or a pair (simulation, "
            f"controller), not {short_repr(made)}."
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
    """Return the largest survived push in a direction [rad], a multiple of `resolution` [N].

    The first push tried is `initial_steps` times the resolution.
    """

    def pushed(steps: int) -> Rollout:
        sim, controller = make()
        force = steps * resolution * _unit_vectors(direction)
        push = Push(force, sim.time + start, duration, frame)
        ticks = ceil((start + duration + observation_time) / sim.timestep)
        return rollout(sim, controller, ticks * sim.timestep, [push])

    def survives(steps: int) -> bool:
        return pushed(steps).outcome == "completed"

    survived, fatal = 0, initial_steps
    while survives(fatal):
        survived, fatal = fatal, 2 * fatal
        if fatal * resolution > _MAX_FORCE_IN_WEIGHTS * make()[0].robot.weight:
            raise SimulationError(
                f"The robot survived a push of {survived * resolution:g} N, and twice that is more "
                f"than {_MAX_FORCE_IN_WEIGHTS:g} times its weight. Check that the push acts."
            )
    while fatal - survived > 1:
        middle = (survived + fatal) // 2
        survived, fatal = (middle, fatal) if survives(middle) else (survived, middle)
    if survived == 0 and (unpushed := pushed(0)).outcome != "completed":
        if unpushed.error is None:
            raise SimulationError("The robot falls without a push. Pass a controller that stands.")
        raise SimulationError(f"The controller fails without a push: {unpushed.error}")
    return survived * resolution


def _unit_vectors(directions: Any) -> Array:
    """Return horizontal unit vectors, shape (..., 3), for directions [rad]."""
    return read_only(
        np.stack([np.cos(directions), np.sin(directions), np.zeros_like(directions)], axis=-1)
    )


def _max_scaling(wrenches: WrenchSet, push: Array, weight_wrench: Array) -> float:
    """Return the largest multiple of a push that the stance withstands together with the weight.

    The result is 0 if rounding puts the weight itself outside the set.
    """
    try:
        return max(0.0, wrenches.max_scaling(push, weight_wrench))
    except InfeasibleError:
        return 0.0


def _distance_to_border(polygon: Array, point: Array, directions: Array) -> Array:
    """Return the distance of a point to the border of a convex polygon in each direction."""
    if len(polygon) < 3:
        return np.zeros(len(directions))
    edges = np.roll(polygon, -1, axis=0) - polygon
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    slack = np.sum(normals * (polygon - point), axis=1)
    if np.any(slack < 0.0):
        return np.zeros(len(directions))
    cosines = directions @ normals.T
    distances = slack / np.maximum(cosines, _MIN_COSINE)
    return np.asarray(np.where(cosines > _MIN_COSINE, distances, np.inf).min(axis=1))
