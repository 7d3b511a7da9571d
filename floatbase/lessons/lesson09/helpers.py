"""Lesson 09: Talos standing, centres of pressure, a lean, and controllers of push-recovery maps."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import cache

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

import floatbase as fb
from floatbase._validation import Array, read_only
from floatbase.behaviours import Gait, Stand, Swing
from floatbase.dynamics import grasp_matrix
from floatbase.errors import SimulationWarning
from floatbase.friction import FrictionPolyhedron
from floatbase.lessons.lesson06 import constrained_minimizer
from floatbase.simulation import Rollout

MU = 0.7
# s: control period; 1 ms gives the same results in the lesson and takes twice as long
PERIOD = 2e-3
SLOW_PERIOD = 4e-3  # s, for long records
PUSH_RECOVERY_WATCH_TIME = 4.0  # s: a robot that steps may fall late
SWING = 0.4  # s: duration of each step after a push
_FORCE_WEIGHT = 1e-4  # weight of small corner forces relative to an error of the wrench in N²
LEAN_START, TIME_AFTER_LEAN = 0.2, 1.0  # s: before and after the lean of exercise 09.3


@cache
def load_talos() -> fb.Robot:
    """Load the humanoid Talos, which stands on two soles."""
    return fb.load("talos")


def run_standing(
    contacts: fb.Contacts,
    duration: float,
    pushes: Sequence[fb.Push] = (),
    sim: fb.Simulation | None = None,
    **options: object,
) -> Rollout:
    """Simulate a robot that the QP of lesson 07 keeps standing, with a control period of 2 ms.

    Parameters
    ----------
    contacts : Contacts
        Contacts that the controller assumes.
    duration : float
        Duration [s].
    pushes : sequence of Push, optional
        Pushes on the robot.
    sim : Simulation, optional
        The simulation; by default Talos on its soles.
    **options
        Options of `WholeBodyController`.

    Returns
    -------
    Rollout
        The record.
    """
    sim = fb.Simulation(load_talos()) if sim is None else sim
    tasks = fb.standing_tasks(sim.state)
    controller = fb.WholeBodyController(sim.robot, contacts, tasks, **options)  # type: ignore[arg-type]
    with warnings.catch_warnings():  # only the controller assumes that soles are bolted down
        warnings.simplefilter("ignore", SimulationWarning)
        return fb.rollout(sim, controller, duration, pushes, PERIOD)


def outcome_text(record: Rollout) -> str:
    """Return in words whether the robot of a record stands, or in which direction it falls."""
    x, y, _ = record.com[-1] - record.com[0]
    if record.outcome == "completed":
        return "stands"
    if abs(y) > abs(x):
        return "falls aside"
    return "falls forwards" if x > 0.0 else "falls backwards"


def centre_of_pressure_path(record: Rollout) -> Array:
    """Return the centre of pressure of all contact points together in each row of a record.

    The ground is level. The centre of pressure is NaN while nothing touches the ground.

    Parameters
    ----------
    record : Rollout
        The record.

    Returns
    -------
    ndarray, shape (n, 2)
        Centre of pressure in the world frame [m].
    """
    normal = record.measured[:, 2::3]
    total = np.sum(normal, axis=1)
    total = np.where(total > 0.0, total, np.nan)
    return read_only(
        np.einsum("ij,ijk->ik", normal, record.foot_positions[:, :, :2]) / total[:, None]
    )


def single_support_rows(record: Rollout, every: int = 5) -> dict[int, Array]:
    """Return the rows of a record with one foot on the ground, and the corners of this foot.

    Parameters
    ----------
    record : Rollout
        The record.
    every : int, optional
        Distance between the rows that are examined.

    Returns
    -------
    dict of int to ndarray, shape (n, 2)
        For each row: the corners from above, in the world frame [m].
    """
    stances = {i: record.contacts_at(i) for i in range(0, len(record), every)}
    return {
        i: stance.positions(record.state(i))[:, :2]
        for i, stance in stances.items()
        if len(stance) == 1
    }


def corner_forces(
    state: fb.State, sole: fb.Contacts, wrench: npt.ArrayLike, facets: int = 4
) -> Array:
    """Return the forces at the corners of a sole whose wrench is closest to a given wrench."""
    cones = zip(sole.normals, sole.mus, strict=True)
    rows = block_diag(*(FrictionPolyhedron(n, mu, facets).face_matrix for n, mu in cones))
    G = grasp_matrix(sole.positions(state), state.point(sole.names[0]))
    # 1 N·m counts as 10 N, its force at the corners, 10 cm away
    weights = np.repeat([1.0, 10.0], 3)
    cost = fb.Quadratic.from_residual(weights[:, None] * G, weights * np.asarray(wrench))
    return constrained_minimizer(
        cost + _FORCE_WEIGHT * fb.Quadratic.from_residual(np.eye(sole.k), np.zeros(sole.k)), rows
    )


def leaning_controller(
    centimetres: float, seconds: float, posture: float
) -> fb.WholeBodyController:
    """Return a controller that leans Talos forwards.

    The centre of mass moves along a minimum-jerk path, starting at 0.2 s, and stays at its end.

    Parameters
    ----------
    centimetres : float
        Distance [cm].
    seconds : float
        Duration [s].
    posture : float
        Weight of the posture task [-].

    Returns
    -------
    WholeBodyController
        The controller.
    """
    robot, state = load_talos(), load_talos().standing()
    path = Swing(
        state.com, state.com + [0.01 * centimetres, 0.0, 0.0], LEAN_START, LEAN_START + seconds, 0.0
    )
    tasks = [fb.CoMTask(path), fb.standing_tasks(state)[1], fb.PostureTask(state.q, weight=posture)]
    return fb.WholeBodyController(robot, fb.Contacts.flat_feet(robot, mu=MU), tasks)


def make_controller() -> Stand:
    """Return the controller of the lesson's push-recovery map."""
    return Stand(
        load_talos(),
        fb.Contacts.flat_feet(load_talos(), mu=MU),
        Gait.walk(load_talos(), swing=SWING),
    )


def make_standing_controller() -> Stand:
    """Return the same controller without steps."""
    return Stand(load_talos(), fb.Contacts.flat_feet(load_talos(), mu=MU))
