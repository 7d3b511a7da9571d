"""Lesson 09, Feet with area: Talos held upright, where the ground pushes, a lean, and the
controllers of its roses.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

import floatbase as fb
from floatbase._validation import Array, read_only
from floatbase.behaviours import Gait, Stand, Swing
from floatbase.dynamics import grasp_matrix
from floatbase.friction import FrictionPolyhedron
from floatbase.lessons.lesson06 import constrained_minimiser
from floatbase.simulation import Rollout

MU = 0.7
# s: a tick of the controller; 1 ms makes no difference to what the lesson shows, and takes twice as
# long
PERIOD = 2e-3
SLOW_PERIOD = 4e-3  # s, for long records
PUSH_RECOVERY_WATCH_TIME = 4.0  # s: who steps may fall late
SWING = 0.4  # s of each step after a push
_FORCE_WEIGHT = 1e-4  # weight of least corner forces beside a wish in N²
LEAN_START, TIME_AFTER_LEAN = 0.2, 1.0  # s: before and after the lean of exercise 09.4


@cache
def load_talos() -> fb.Robot:
    """The humanoid on its two soles."""
    return fb.load("talos")


def run_standing(
    contacts: fb.Contacts,
    duration: float,
    pushes: Sequence[fb.Push] = (),
    sim: fb.Simulation | None = None,
    **options: object,
) -> Rollout:
    """The record of a robot that the QP of lesson 07 keeps where it stands, ticking every 2 ms.

    contacts: what the controller believes in. duration: s. pushes: on the robot.
    sim: the physics; Talos on its soles by default. options: of `fb.WholeBodyController`.
    """
    sim = fb.Simulation(load_talos()) if sim is None else sim
    tasks = fb.standing_tasks(sim.state)
    controller = fb.WholeBodyController(sim.robot, contacts, tasks, **options)  # type: ignore[arg-type]
    return fb.rollout(sim, controller, duration, pushes, PERIOD)


def outcome_text(record: Rollout) -> str:
    """Whether a record's robot stands, or to which side it falls: where its centre of mass went, in
    words.
    """
    x, y, _ = record.com[-1] - record.com[0]
    if record.outcome == "completed":
        return "stands"
    if abs(y) > abs(x):
        return "falls aside"
    return "falls forwards" if x > 0.0 else "falls backwards"


def centre_of_pressure_path(record: Rollout) -> Array:
    """Where the ground pushed: the centre of pressure of all points together at each row, shape (n,
    2), m, world.

    NaN while nothing touches. The ground is level.
    """
    normal = record.measured[:, 2::3]
    total = np.sum(normal, axis=1)
    total = np.where(total > 0.0, total, np.nan)
    return read_only(
        np.einsum("ij,ijk->ik", normal, record.foot_positions[:, :, :2]) / total[:, None]
    )


def single_support_rows(record: Rollout, every: int = 5) -> dict[int, Array]:
    """Rows of a record in which one foot stands alone, and its corners there from above, shape (n,
    2), m, world.

    every: of so many rows one is looked at.
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
    """The forces at the corners of one sole, inside their pyramids, whose wrench is nearest to the
    one given, shape (k,), N.

    Of those that make it, the smallest. wrench: shape (6,), about the origin of the sole's frame, N
    and N·m, world.
    facets: of each pyramid.
    """
    cones = zip(sole.normals, sole.mus, strict=True)
    rows = block_diag(*(FrictionPolyhedron(n, mu, facets).face_matrix for n, mu in cones))
    G = grasp_matrix(sole.positions(state), state.point(sole.names[0]))
    weights = np.repeat([1.0, 10.0], 3)  # 1 N·m counts as 10 N: at the corners, 10 cm away, it is
    cost = fb.Quadratic.from_residual(weights[:, None] * G, weights * np.asarray(wrench))
    return constrained_minimiser(
        cost + _FORCE_WEIGHT * fb.Quadratic.from_residual(np.eye(sole.k), np.zeros(sole.k)), rows
    )


def leaning_controller(
    centimetres: float, seconds: float, posture: float
) -> fb.WholeBodyController:
    """Talos moves its centre of mass forwards along a minimum-jerk path, from 0.2 s on, and stays
    there.

    centimetres: how far. seconds: how long it takes. posture: weight of the posture.
    """
    robot, state = load_talos(), load_talos().standing()
    path = Swing(
        state.com, state.com + [0.01 * centimetres, 0.0, 0.0], LEAN_START, LEAN_START + seconds, 0.0
    )
    tasks = [fb.CoMTask(path), fb.standing_tasks(state)[1], fb.PostureTask(state.q, weight=posture)]
    return fb.WholeBodyController(robot, fb.Contacts.flat_feet(robot, mu=MU), tasks)


def make_controller() -> Stand:
    """Talos stands on its soles, and steps when its capture point comes near their edge: its rose
    ends the lesson.
    """
    return Stand(
        load_talos(),
        fb.Contacts.flat_feet(load_talos(), mu=MU),
        Gait.walk(load_talos(), swing=SWING),
    )


def make_standing_controller() -> Stand:
    """The same without steps."""
    return Stand(load_talos(), fb.Contacts.flat_feet(load_talos(), mu=MU))
