"""Lesson 08, Standing, shifting, stepping, walking: bodies that move over feet that stay, what a
record says, crawls.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase._validation import Array
from floatbase.behaviours import Gait, Stand, Walk, support_margin
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson06 import state_with_feet_at
from floatbase.simulation import Rollout

MU = 0.7
PERIOD = 2e-3  # s, between ticks of the records: half the work of 1 ms, and nothing else changes
SLOW_PERIOD = 4e-3  # s, of exercise 08.4: what it judges changes by about 2 %
FOOT_SETBACK = 0.06  # m by which RR stands further back in exercise 08.1
CRAWL_DURATION = 6.0  # s of exercise 08.4
_ROW_STEP = 3  # rows of a record from one look at the margin to the next: 12 ms of a crawl


def make_controller() -> Stand:
    """Standing, and trotting on the spot when it must: the controller whose push rose ends the
    lesson.
    """
    robot = fb.load("go2")
    return Stand(robot, fb.Contacts.points(robot, mu=MU), Gait.trot(robot))


def state_with_moved_body(state: fb.State, move: npt.ArrayLike) -> fb.State:
    """The state with the body moved by (3,) m while all feet stay. Raises `InputError` for what the
    legs do not reach.
    """
    feet = {foot.frame: state.frame_pose(foot.frame).translation for foot in state.robot.feet}
    return state_with_feet_at(state.robot, state.q[:3] + np.asarray(move), feet)


@cache
def uneven_stance() -> fb.State:
    """go2 with its RR foot further back than it stands usually."""
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
    """The record of go2 on the physics, pushed at the base for 0.1 s.

    controller: of go2. seconds: of the record. push: (3,) N, world; none by default. start: s, of
        the push.
    period: s, between two ticks.
    """
    pushes = [fb.Push(np.asarray(push, dtype=np.float64), start)] if np.any(push) else []
    return fb.rollout(fb.Simulation(standing_go2_eom().robot), controller, seconds, pushes, period)  # type: ignore[arg-type]


def largest_tilt(record: Rollout) -> float:
    """The largest angle between the base's and the world's vertical in a record, degrees."""
    upright = 1.0 - 2.0 * (record.q[:, 3] ** 2 + record.q[:, 4] ** 2)
    return float(np.rad2deg(np.arccos(np.clip(upright, -1.0, 1.0)).max()))


def mean_velocity(record: Rollout, seconds: float = 0.5) -> Array:
    """Mean velocity of the centre of mass in the last seconds of a record, shape (3,), m/s."""
    first = int(np.searchsorted(record.time, record.time[-1] - seconds))
    mean: Array = (record.com[-1] - record.com[first]) / (record.time[-1] - record.time[first])
    return mean


def torque_jump(record: Rollout) -> float:
    """The jump of a torque from one tick to the next where a foot lifts, N·m: the largest of all
    joints, median of lifts.
    """
    counts = [len(record.contacts_at(i)) for i in range(len(record))]
    lifts = [i for i in range(1, len(record)) if counts[i] < counts[i - 1]]
    return float(
        np.median([np.abs(record.tau_desired[i] - record.tau_desired[i - 1]).max() for i in lifts])
    )


def smallest_support_margin(record: Rollout) -> float:
    """The least distance of the centre of mass from the edge of the feet that stand, seen from
    above, m.
    """
    names = record.contacts.names
    margins = []
    for i in range(0, len(record), _ROW_STEP):
        stand = [names.index(name) for name in record.contacts_at(i).names]
        margins.append(support_margin(record.com[i, :2], record.foot_positions[i, stand, :2]))
    return min(margins)


@cache
def run_crawl(swing: float, pause: float, forwards: float) -> Rollout:
    """The record of a crawl by `Walk`, 6 s long. swing, pause: s, as of `Gait.crawl`. forwards:
    m/s.
    """
    robot = standing_go2_eom().robot
    gait = Gait.crawl(robot, swing, pause, start=0.5)
    return run_go2(
        Walk(robot, fb.Contacts.points(robot, mu=MU), gait, (forwards, 0.0)),
        CRAWL_DURATION,
        period=SLOW_PERIOD,
    )


def opposite_foot(foot: str) -> str:
    """The foot on the other diagonal, across: the one that lies opposite."""
    return {"FL_foot": "RR_foot", "FR_foot": "RL_foot", "RL_foot": "FR_foot", "RR_foot": "FL_foot"}[
        foot
    ]


def shortest_com_shift(
    state: fb.State, foot: str, to: Callable[[Array], Array] | None = None
) -> Array:
    """The shortest way of the centre of mass, (2,) m, after which a foot's opposite carries nothing
    when it lifts.

    to: exchanges the point from which it is measured, for mistakes: the centre of mass, (2,) m, to
        another point.
    """
    contacts = fb.Contacts.points(state.robot)
    feet = dict(zip(contacts.names, contacts.positions(state)[:, :2], strict=True))
    a, b = (feet[name] for name in contacts.names if name not in (foot, opposite_foot(foot)))
    normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
    start = state.com[:2] if to is None else to(state.com[:2])
    way: Array = ((a - start) @ normal) * normal
    return way
