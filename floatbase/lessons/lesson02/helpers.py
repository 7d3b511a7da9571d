"""Lesson 02, experiments: constant torques, how far feet and tools stray, a wheel that parks."""

from __future__ import annotations

from collections.abc import Callable, Sequence

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

MotionSolver = Callable[
    [EquationsOfMotion, Array, Array], tuple[Array, Array]
]  # (eom, τ, b) -> (q̈, λ), by (7)
DISC_RADIUS = 0.2  # m, of assets/models/disc.urdf


def run_constant_torques(
    robot: Robot,
    contacts: fb.Contacts,
    tau: npt.ArrayLike,
    motion: MotionSolver,
    duration: float = 0.2,
) -> Rollout:
    """MuJoCo under constant torques; `planned` holds the λ of (7) at every millisecond, `measured`
    the engine's.

    contacts: the stance of (7).
    tau: shape (d,), N·m.
    motion: solves (7), (eom, τ, b) -> (q̈, λ).
    duration: s.
    """
    torques = np.array(tau, dtype=np.float64)

    def by_equation(q: Array, v: Array) -> Array:
        eom = fb.equations_of_motion(fb.State(robot, q, v), contacts)
        return motion(eom, torques, eom.b)[1]

    return fb.rollout(
        fb.Simulation(robot), ConstantTorques(torques, contacts, by_equation), duration
    )


def foot_displacement(states: Sequence[fb.State], contacts: fb.Contacts) -> Array:
    """Distance of the worst foot from its first position, m, for each state; shape (number of
    states,).
    """
    places = np.array([contacts.positions(state) for state in states])
    return np.asarray(np.linalg.norm(places - places[0], axis=2).max(axis=1))


def tool_displacement(record: Rollout) -> Array:
    """Distance of the arm's tool from its first position, mm, for every row of a record; shape
    (rows,).
    """
    places = np.array([record.state(i).point("tool0") for i in range(len(record))])
    return 1e3 * np.asarray(np.linalg.norm(places - places[0], axis=1))


def load_disc() -> Robot:
    """A robot without joints: a solid disc of 1 kg and 0.2 m radius, free to move; its axle is
    y.
    """
    return fb.load_urdf(assets_root() / "models" / "disc.urdf")


def rolling_wheel() -> RollingWheel:
    """The constraint (6) of `load_disc`: it rolls on the level ground."""
    return RollingWheel("disc", np.array([0.0, 1.0, 0.0]), DISC_RADIUS)


def disc_state(
    robot: Robot, place: Sequence[float] = (0.0, 0.0), heading: float = 0.0, rolled: float = 0.0,
    speed: float = 0.0, turning: float = 0.0,
) -> fb.State:  # fmt: skip
    """The disc upright on the ground, rolling without slip.

    place: x and y of its centre, m, world.
    heading: of its rolling, rad about the vertical; 0 is along x.
    rolled: how far it has rolled about its axle, rad.
    speed: m/s along its heading.
    turning: rad/s about the vertical.
    """
    R = pin.utils.rotate("z", heading) @ pin.utils.rotate("y", rolled)
    velocity = speed * np.array([np.cos(heading), np.sin(heading), 0.0])
    omega = speed / DISC_RADIUS * R[:, 1] + turning * np.array([0.0, 0.0, 1.0])
    q = np.concatenate([[*place, DISC_RADIUS], pin.Quaternion(R).normalized().coeffs()])
    return fb.State(robot, q, np.concatenate([R.T @ velocity, R.T @ omega]))


def parking_states(
    robot: Robot, distance: float = 0.5, angle: float = 0.7, steps: int = 20
) -> list[fb.State]:
    """The disc parks: it rolls ahead, turns, rolls back, turns back, 1 s each; a list of states
    with their velocities.

    distance: how far it rolls, m. angle: how far it turns, rad. steps: states a second.
    """
    states, x, y, heading, rolled = [], 0.0, 0.0, 0.0, 0.0
    for speed, turning in ((distance, 0.0), (0.0, angle), (-distance, 0.0), (0.0, -angle)):
        for _ in range(steps):
            states.append(disc_state(robot, (x, y), heading, rolled, speed, turning))
            x, y = x + speed * np.cos(heading) / steps, y + speed * np.sin(heading) / steps
            heading, rolled = heading + turning / steps, rolled + speed / DISC_RADIUS / steps
    return [*states, disc_state(robot, (x, y), heading, rolled)]
