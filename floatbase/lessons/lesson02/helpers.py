"""Lesson 02: constant torques, displacements of feet and tools, and a wheel that parks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import numpy.typing as npt
import pinocchio as pin

import floatbase as fb
from floatbase._assets import assets_root
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion, RollingWheel
from floatbase.lessons.controllers import ConstantTorques
from floatbase.robots import Robot
from floatbase.simulation import Rollout

# (eom, τ, b) -> (q̈, λ), by (7)
MotionSolver = Callable[[EquationsOfMotion, Array, Array], tuple[Array, Array]]
DISC_RADIUS = 0.2  # m, of assets/models/disc.urdf
RECORD_ROW = 300  # in the record of the exercises: after the push, while the base still turns


def run_constant_torques(
    robot: Robot,
    contacts: fb.Contacts,
    tau: npt.ArrayLike,
    motion: MotionSolver,
    duration: float = 0.2,
) -> Rollout:
    """Simulate a robot under constant torques, with the contact forces of (7) as planned forces."""
    torques = np.array(tau, dtype=np.float64)

    def by_equation(q: Array, v: Array) -> Array:
        eom = fb.equations_of_motion(fb.State(robot, q, v), contacts)
        return motion(eom, torques, eom.b)[1]

    return fb.rollout(
        fb.Simulation(robot), ConstantTorques(torques, contacts, by_equation), duration
    )


@cache
def shoved_go2() -> Rollout:
    """Return a record of go2 that stands while something pushes its front left hip to the left.

    Returns
    -------
    Rollout
        The record of 0.35 s, with a row for each millisecond. The push lasts from 0.05 s to 0.15 s.
    """
    robot = fb.load("go2")
    tasks = fb.standing_tasks(robot.standing())
    controller = fb.WholeBodyController(robot, fb.Contacts.points(robot), tasks)
    push = fb.Push(np.array([0.0, 150.0, 0.0]), start=0.05, duration=0.1, frame="FL_hip")
    return fb.rollout(fb.Simulation(robot), controller, 0.35, [push])


def foot_displacement(states: Sequence[fb.State], contacts: fb.Contacts) -> Array:
    """Return how far the feet have moved from their first position."""
    places = np.array([contacts.positions(state) for state in states])
    return np.asarray(np.linalg.norm(places - places[0], axis=2).max(axis=1))


def tool_displacement(record: Rollout) -> Array:
    """Return how far the tool of an arm has moved from its first position."""
    places = np.array([record.state(i).point("tool0") for i in range(len(record))])
    return 1e3 * np.asarray(np.linalg.norm(places - places[0], axis=1))


def load_disc() -> Robot:
    """Load a free solid disc without joints: mass 1 kg, radius 0.2 m, axle along y."""
    return fb.load_urdf(assets_root() / "models" / "disc.urdf")


def rolling_wheel() -> RollingWheel:
    """Return the rolling constraint of the disc of `load_disc` on level ground."""
    return RollingWheel("disc", np.array([0.0, 1.0, 0.0]), DISC_RADIUS)


def disc_state(
    robot: Robot, place: Sequence[float] = (0.0, 0.0), heading: float = 0.0, rolled: float = 0.0,
    speed: float = 0.0, turning: float = 0.0,
) -> fb.State:  # fmt: skip
    """Return a state of the disc, upright on the ground and rolling without slip."""
    R = pin.utils.rotate("z", heading) @ pin.utils.rotate("y", rolled)
    velocity = speed * np.array([np.cos(heading), np.sin(heading), 0.0])
    omega = speed / DISC_RADIUS * R[:, 1] + turning * np.array([0.0, 0.0, 1.0])
    q = np.concatenate([[*place, DISC_RADIUS], pin.Quaternion(R).normalized().coeffs()])
    return fb.State(robot, q, np.concatenate([R.T @ velocity, R.T @ omega]))


def parking_states(
    robot: Robot, distance: float = 0.5, angle: float = 0.7, steps: int = 20
) -> list[fb.State]:
    """Return the states of a disc that parks: it rolls ahead, turns, rolls back and turns back."""
    states, x, y, heading, rolled = [], 0.0, 0.0, 0.0, 0.0
    for speed, turning in ((distance, 0.0), (0.0, angle), (-distance, 0.0), (0.0, -angle)):
        for _ in range(steps):
            states.append(disc_state(robot, (x, y), heading, rolled, speed, turning))
            x, y = x + speed * np.cos(heading) / steps, y + speed * np.sin(heading) / steps
            heading, rolled = heading + turning / steps, rolled + speed / DISC_RADIUS / steps
    return [*states, disc_state(robot, (x, y), heading, rolled)]
