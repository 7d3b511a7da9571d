"""Lesson 08: stances with a shifted body, measures of a record, and crawls."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase._validation import Array
from floatbase.behaviours import Gait, Stand, Walk, support_margin
from floatbase.errors import SimulationWarning
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson06 import state_with_feet_at
from floatbase.simulation import Rollout

MU = 0.7
PERIOD = 2e-3  # s, control period of the records: half the work of 1 ms, with the same results
SLOW_PERIOD = 4e-3  # s, of exercise 08.4: the quantities it judges change by about 2 %
FOOT_SETBACK = 0.06  # m: how much further back RR stands in exercise 08.1
CRAWL_DURATION = 6.0  # s of exercise 08.4
_ROW_STEP = 3  # the margin is computed in every third row: every 12 ms of a crawl


def make_controller() -> Stand:
    """Return the controller of the lesson's push-recovery map."""
    robot = fb.load("go2")
    return Stand(robot, fb.Contacts.points(robot, mu=MU), Gait.trot(robot))


def state_with_moved_body(state: fb.State, move: npt.ArrayLike) -> fb.State:
    """Return a state with the body moved while all feet stay.

    Parameters
    ----------
    state : State
        State before the move.
    move : array_like, shape (3,)
        Displacement of the body in the world frame [m].

    Returns
    -------
    State
        The state.

    Raises
    ------
    InputError
        If the legs cannot reach so far.
    """
    feet = {foot.frame: state.frame_pose(foot.frame).translation for foot in state.robot.feet}
    return state_with_feet_at(state.robot, state.q[:3] + np.asarray(move), feet)


@cache
def uneven_stance() -> fb.State:
    """Return go2 with its RR foot 6 cm further back than usual."""
    state = standing_go2_eom().state
    feet = {
        foot.frame: np.array(state.frame_pose(foot.frame).translation) for foot in state.robot.feet
    }
    feet["RR_foot"][0] -= FOOT_SETBACK
    return state_with_feet_at(state.robot, state.q[:3], feet)


def run_go2(
    controller: object,
    seconds: float,
    push: npt.ArrayLike = (0.0, 0.0, 0.0),
    start: float = 1.0,
    period: float = PERIOD,
) -> Rollout:
    """Simulate go2 with a push at the base for 0.1 s.

    Parameters
    ----------
    controller : callable
        Controller of go2.
    seconds : float
        Duration of the record [s].
    push : array_like, shape (3,), optional
        Force of the push in the world frame [N]; no push by default.
    start : float, optional
        Start of the push [s].
    period : float, optional
        Control period [s].

    Returns
    -------
    Rollout
        The record.
    """
    pushes = [fb.Push(np.asarray(push, dtype=np.float64), start)] if np.any(push) else []
    return fb.rollout(fb.Simulation(standing_go2_eom().robot), controller, seconds, pushes, period)  # type: ignore[arg-type]


def largest_tilt(record: Rollout) -> float:
    """Return the largest angle between the base's vertical and the world's in a record [°]."""
    upright = 1.0 - 2.0 * (record.q[:, 3] ** 2 + record.q[:, 4] ** 2)
    return float(np.rad2deg(np.arccos(np.clip(upright, -1.0, 1.0)).max()))


def mean_velocity(record: Rollout, seconds: float = 0.5) -> Array:
    """Return the mean velocity of the centre of mass at the end of a record.

    Parameters
    ----------
    record : Rollout
        The record.
    seconds : float, optional
        Duration of the part at the end [s].

    Returns
    -------
    ndarray, shape (3,)
        Velocity in the world frame [m/s].
    """
    first = int(np.searchsorted(record.time, record.time[-1] - seconds))
    mean: Array = (record.com[-1] - record.com[first]) / (record.time[-1] - record.time[first])
    return mean


def smallest_support_margin(record: Rollout) -> float:
    """Return the smallest margin of the centre of mass in a record [m]."""
    names = record.contacts.names
    margins = []
    for i in range(0, len(record), _ROW_STEP):
        stand = [names.index(name) for name in record.contacts_at(i).names]
        margins.append(support_margin(record.com[i, :2], record.foot_positions[i, stand, :2]))
    return min(margins)


@cache
def run_crawl(swing: float, pause: float, forwards: float) -> Rollout:
    """Simulate 6 s of a crawl."""
    return run_go2(crawl(swing, pause, forwards), CRAWL_DURATION, period=SLOW_PERIOD)


def crawl(swing: float, pause: float, forwards: float) -> Walk:
    """Return the controller of `run_crawl`."""
    robot = standing_go2_eom().robot
    gait = Gait.crawl(robot, swing, pause, start=0.5)
    with warnings.catch_warnings():  # the verdict reports a limited speed
        warnings.simplefilter("ignore", SimulationWarning)
        return Walk(robot, fb.Contacts.points(robot, mu=MU), gait, (forwards, 0.0))


def opposite_foot(foot: str) -> str:
    """Return the diagonally opposite foot."""
    return {"FL_foot": "RR_foot", "FR_foot": "RL_foot", "RL_foot": "FR_foot", "RR_foot": "FL_foot"}[
        foot
    ]


def shortest_com_shift(
    state: fb.State, foot: str, to: Callable[[Array], Array] | None = None
) -> Array:
    """Return the shortest shift of the centre of mass that lets a foot lift off."""
    contacts = fb.Contacts.points(state.robot)
    feet = dict(zip(contacts.names, contacts.positions(state)[:, :2], strict=True))
    a, b = (feet[name] for name in contacts.names if name not in (foot, opposite_foot(foot)))
    normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
    start = state.com[:2] if to is None else to(state.com[:2])
    way: Array = ((a - start) @ normal) * normal
    return way
