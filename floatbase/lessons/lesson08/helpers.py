"""Lesson 08: stances with a shifted body, footholds of a trot, and measures of a record."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase._validation import Array
from floatbase.behaviours import Gait, Stand
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson06 import state_with_feet_at
from floatbase.simulation import Rollout

MU = 0.7
PERIOD = 2e-3  # s, control period of the records: half the work of 1 ms, with the same results
FOOT_SETBACK = 0.06  # m: how much further back RR stands in exercise 08.2
SWING_TIME = 0.25  # s: duration of each step of the lesson's trot


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


@cache
def feet_of_the_trot() -> tuple[dict[str, Array], Array]:
    """Return the places of the standing feet (3,) and their mean from above (2,) [m]."""
    state = standing_go2_eom().state
    contacts = fb.Contacts.points(state.robot)
    home = {foot: state.point(foot) for foot in contacts.names}
    return home, contacts.positions(state).mean(axis=0)[:2]


def parts_of_foothold(
    foot: str, now: fb.State, since: float, desired: npt.ArrayLike
) -> tuple[Array, Array, Array]:
    """Return where the body is at touch-down, the step ahead of it, and the foot beside it."""
    home, middle = feet_of_the_trot()
    v, v_end = now.com_velocity[:2], np.asarray(desired, dtype=np.float64)
    omega = np.sqrt(now.robot.gravity / standing_go2_eom().state.com[2])
    neutral = v_end / omega * np.tanh(omega * SWING_TIME / 2)
    ahead = neutral + (v - v_end) / (omega * np.tanh(omega * SWING_TIME))
    return now.com[:2] + v * (SWING_TIME - since), ahead, home[foot][:2] - middle


def foothold(foot: str, now: fb.State, since: float, desired: npt.ArrayLike) -> Array:
    """Return where a foot of the lesson's trot is to land.

    Parameters
    ----------
    foot : str
        Name of the foot.
    now : State
        Present state of go2.
    since : float
        Time since the foot lifted off [s].
    desired : array_like, shape (2,)
        Desired horizontal velocity [m/s].

    Returns
    -------
    ndarray, shape (3,)
        Place of the foot's centre in the world frame [m].
    """
    place = np.sum(parts_of_foothold(foot, now, since, desired), axis=0)
    return np.append(place, feet_of_the_trot()[0][foot][2])


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
