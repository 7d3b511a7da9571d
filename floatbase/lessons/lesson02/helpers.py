"""Lesson 02: constant torques, displacements of feet and tools, and a wheel that parks."""

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

# (eom, τ, b) -> (q̈, λ), by (7)
MotionSolver = Callable[[EquationsOfMotion, Array, Array], tuple[Array, Array]]
DISC_RADIUS = 0.2  # m, of assets/models/disc.urdf


def run_constant_torques(
    robot: Robot,
    contacts: fb.Contacts,
    tau: npt.ArrayLike,
    motion: MotionSolver,
    duration: float = 0.2,
) -> Rollout:
    """Simulate a robot under constant torques, with the contact forces of (7) as planned forces.

    Parameters
    ----------
    robot : Robot
        The robot.
    contacts : Contacts
        Contacts in (7).
    tau : array_like, shape (d,)
        Torques [N·m].
    motion : callable
        Solver of (7): a function of (eom, τ, b) that returns (q̈, λ).
    duration : float, optional
        Duration [s].

    Returns
    -------
    Rollout
        The record. `planned` contains the λ of (7) in every millisecond, `measured` the contact
        forces of the physics engine.
    """
    torques = np.array(tau, dtype=np.float64)

    def by_equation(q: Array, v: Array) -> Array:
        eom = fb.equations_of_motion(fb.State(robot, q, v), contacts)
        return motion(eom, torques, eom.b)[1]

    return fb.rollout(
        fb.Simulation(robot), ConstantTorques(torques, contacts, by_equation), duration
    )


def foot_displacement(states: Sequence[fb.State], contacts: fb.Contacts) -> Array:
    """Return how far the feet have moved from their first position.

    Parameters
    ----------
    states : sequence of State
        The states.
    contacts : Contacts
        The feet.

    Returns
    -------
    ndarray, shape (n,)
        Largest displacement of a foot in each state [m].
    """
    places = np.array([contacts.positions(state) for state in states])
    return np.asarray(np.linalg.norm(places - places[0], axis=2).max(axis=1))


def tool_displacement(record: Rollout) -> Array:
    """Return how far the tool of an arm has moved from its first position.

    Parameters
    ----------
    record : Rollout
        The record.

    Returns
    -------
    ndarray, shape (n,)
        Displacement of the tool in each row [mm].
    """
    places = np.array([record.state(i).point("tool0") for i in range(len(record))])
    return 1e3 * np.asarray(np.linalg.norm(places - places[0], axis=1))


def load_disc() -> Robot:
    """Load a free solid disc without joints: mass 1 kg, radius 0.2 m, axle along y."""
    return fb.load_urdf(assets_root() / "models" / "disc.urdf")


def rolling_wheel() -> RollingWheel:
    """Return the rolling constraint of the disc of `load_disc` on level ground.

    Notes
    -----
    [FBR]_, eq. (6).
    """
    return RollingWheel("disc", np.array([0.0, 1.0, 0.0]), DISC_RADIUS)


def disc_state(
    robot: Robot, place: Sequence[float] = (0.0, 0.0), heading: float = 0.0, rolled: float = 0.0,
    speed: float = 0.0, turning: float = 0.0,
) -> fb.State:  # fmt: skip
    """Return a state of the disc, upright on the ground and rolling without slip.

    Parameters
    ----------
    robot : Robot
        The disc.
    place : sequence of float, optional
        x and y of its centre in the world frame [m].
    heading : float, optional
        Direction of rolling: angle about the vertical [rad]; 0 is along x.
    rolled : float, optional
        Angle by which the disc has turned about its axle [rad].
    speed : float, optional
        Speed along its heading [m/s].
    turning : float, optional
        Angular velocity about the vertical [rad/s].

    Returns
    -------
    State
        The state.
    """
    R = pin.utils.rotate("z", heading) @ pin.utils.rotate("y", rolled)
    velocity = speed * np.array([np.cos(heading), np.sin(heading), 0.0])
    omega = speed / DISC_RADIUS * R[:, 1] + turning * np.array([0.0, 0.0, 1.0])
    q = np.concatenate([[*place, DISC_RADIUS], pin.Quaternion(R).normalized().coeffs()])
    return fb.State(robot, q, np.concatenate([R.T @ velocity, R.T @ omega]))


def parking_states(
    robot: Robot, distance: float = 0.5, angle: float = 0.7, steps: int = 20
) -> list[fb.State]:
    """Return the states of a disc that parks: it rolls ahead, turns, rolls back and turns back.

    Each of the four parts takes 1 s.

    Parameters
    ----------
    robot : Robot
        The disc.
    distance : float, optional
        Distance that the disc rolls [m].
    angle : float, optional
        Angle that the disc turns [rad].
    steps : int, optional
        States per second.

    Returns
    -------
    list of State
        The states, with their velocities.
    """
    states, x, y, heading, rolled = [], 0.0, 0.0, 0.0, 0.0
    for speed, turning in ((distance, 0.0), (0.0, angle), (-distance, 0.0), (0.0, -angle)):
        for _ in range(steps):
            states.append(disc_state(robot, (x, y), heading, rolled, speed, turning))
            x, y = x + speed * np.cos(heading) / steps, y + speed * np.sin(heading) / steps
            heading, rolled = heading + turning / steps, rolled + speed / DISC_RADIUS / steps
    return [*states, disc_state(robot, (x, y), heading, rolled)]
