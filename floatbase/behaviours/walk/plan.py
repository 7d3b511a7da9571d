"""`StepPlan`: footholds, swings and centre-of-mass motion from the present stance on.

All functions are pure: a plan follows from the previous plan, the measured state, the gait and the
path.
"""
# The live page plans in JavaScript: floatbase/viewer/web/src/engine/walk.js repeats this module for
# a trot and a walk on level ground, so a change here needs the same change there.

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf, pi, remainder
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_array, frozen
from floatbase.behaviours.terrain import Plane, Terrain
from floatbase.behaviours.walk.footholds import capture_point, support_margin
from floatbase.behaviours.walk.gait import TIME_TOLERANCE, Gait
from floatbase.behaviours.walk.gait_limits import MAX_FEET_WITH_SWAY
from floatbase.behaviours.walk.lipm import LIPM, CoMPlan, ZMPSegment
from floatbase.behaviours.walk.options import WalkOptions
from floatbase.behaviours.walk.path import Path, yaw_of
from floatbase.behaviours.walk.posture import WalkingPosture
from floatbase.behaviours.walk.swing import SwingPath
from floatbase.errors import InputError
from floatbase.robots import State

Phase: TypeAlias = tuple[float, float, tuple[str, ...]]
PLANNED_PHASES = 4  # stances that a plan looks ahead: two steps; eight are no better
PLAN_HORIZON = 5.0  # s of standing that a plan looks ahead
# s after touchdown until the height of a foot is used as that of the ground: earlier heights make
# the planned footholds climb
TOUCHDOWN_SETTLING_TIME = 0.05
# s before the first lift-off and after the last touchdown in which the ZMP shifts
WEIGHT_SHIFT_TIME = 0.8
# m of DCM error that a stance with area tolerates without moving a step: the error would grow by up
# to e^{ω 1.2 s}
DCM_DEAD_ZONE = 0.02
# m: if steps were shifted by more, the path is shifted, too; otherwise the robot runs back to it
# and falls
PATH_SHIFT_THRESHOLD = 0.05
_MIN_STATIC_MARGIN = 0.03  # m from the edge of the support polygon at which the ZMP may stay
_BISECTIONS = 10  # halvings of the way, so that the ZMP is known to 0.1 % of it
LEVEL = Plane(frozen(np.zeros(2)), 0.0)


@dataclass(frozen=True, eq=False)
class PlannedSwing:
    """A foot in the air."""

    path: SwingPath
    planned_end: Array
    yaws: tuple[float, float]
    tilts: tuple[Array, Array]
    ground: Plane


@dataclass(frozen=True, eq=False)
class Footing:
    """The feet on the ground."""

    feet: Mapping[str, Array]
    touchdowns: Mapping[str, float] = field(default_factory=dict)
    step_offset: Array = field(default_factory=lambda: np.zeros(2))


@dataclass(frozen=True, eq=False)
class StepPlan:
    """Plan that a `Walk` makes when its stance changes, or when its plan ends while it stands.

    Parameters
    ----------
    time : float
        Time of the plan [s].
    stance : tuple of str
        Feet that stand from then on.
    footing : Footing
        The feet on the ground.
    footholds : dict of str to ndarray, shape (3,)
        Planned foothold of each foot that is in the air or lifts off next, in the world frame [m].
    plan : CoMPlan
        Plan of the centre of mass, such as a `LIPM`.
    planned_swings : dict of str to PlannedSwing
        The feet in the air.
    path : Path
        The body's path at the time of the plan.
    ground : Plane
        Plane of the ground through the feet, relative to the ground below the standing posture.
    interval : (float, float)
        Beginning and end of the stance [s]; inf if no end is known.
    replan_time : float
        Time at which to plan anew even if the stance does not change [s].
    ramps : dict of str to (bool, bool)
        Whether each foot has landed at the beginning of the stance, and lifts off at its end.
    """

    time: float
    stance: tuple[str, ...]
    footing: Footing
    footholds: Mapping[str, Array]
    plan: CoMPlan
    planned_swings: Mapping[str, PlannedSwing]
    path: Path
    ground: Plane
    interval: tuple[float, float]
    replan_time: float
    ramps: Mapping[str, tuple[bool, bool]]

    @property
    def feet(self) -> Mapping[str, Array]:
        """Position of each foot's frame, where it stands or last stood, shape (3,), world [m]."""
        return self.footing.feet

    @property
    def swings(self) -> dict[str, SwingPath]:
        """Planned paths of the feet in the air."""
        return {foot: each.path for foot, each in self.planned_swings.items()}


def first_path(posture: WalkingPosture, state: State, t: float) -> Path:
    """Return the path of a measured state, which begins in the middle of the feet, at rest."""
    path = Path(t, np.zeros(2), yaw_of(state.frame_pose("base").rotation), np.zeros(3))
    positions = [
        state.point(foot)[:2] - path.point(nominal[:2])
        for foot, nominal in posture.nominal_feet.items()
    ]
    return replace(path, position=np.mean(positions, axis=0))


def first_footing(posture: WalkingPosture, state: State) -> Footing:
    """Return the feet of a measured state, all on the ground."""
    return Footing({foot: state.point(foot) for foot in posture.contacts.names})


def next_footing(
    plan: StepPlan, swings: Mapping[str, SwingPath], state: State, stance: Sequence[str], t: float
) -> tuple[Footing, Array]:
    """Return the feet on the ground at a change of stance, and by how much to shift the path.

    The path is shifted, (2,) [m], if the steps were shifted far.
    """
    feet, touchdowns = dict(plan.feet), dict(plan.footing.touchdowns)
    for foot in plan.stance:
        if t > touchdowns.get(foot, -inf) + TOUCHDOWN_SETTLING_TIME:
            feet[foot] = state.point(foot)
    offsets = []
    for foot in stance:
        if foot in swings:
            feet[foot] = np.array([*state.point(foot)[:2], swings[foot].end[2]])
            offsets.append((feet[foot] - plan.planned_swings[foot].planned_end)[:2])
            touchdowns[foot] = t
    if not offsets:
        return Footing(feet, touchdowns, plan.footing.step_offset), np.zeros(2)
    step_offset = np.mean(offsets, axis=0)
    # the mean of two steps, as swinging legs sway the body to both sides in turn
    mean_offset = (plan.footing.step_offset + step_offset) / 2.0
    far = np.linalg.norm(mean_offset) > PATH_SHIFT_THRESHOLD
    return Footing(feet, touchdowns, step_offset), mean_offset if far else np.zeros(2)


def make_plan(
    posture: WalkingPosture,
    options: WalkOptions,
    state: State,
    path: Path,
    gait: Gait,
    stance: tuple[str, ...],
    footing: Footing,
    foothold: Callable[[str, float], npt.ArrayLike],
    yaw_at: Callable[[float], float],
    previous: StepPlan | None = None,
    swings: Mapping[str, SwingPath] | None = None,
) -> StepPlan:
    """Plan footholds, swings and the motion of the centre of mass."""
    t = path.time
    phases = gait.phases(t, PLANNED_PHASES, PLAN_HORIZON)
    same = previous is not None and previous.stance == stance
    begin, until = previous.interval[0] if previous and same else t, phases[0][1]
    endless = len(phases) == 1  # it stands, with no end within the horizon
    interval = (begin, inf if endless else until)
    nominal = posture.nominal_feet
    heights = np.array([[0.0, 0.0, nominal[foot][2]] for foot in nominal])
    ground = Plane.through(np.array([footing.feet[foot] for foot in nominal]) - heights)
    plan_foothold = partial(_foothold, posture, options.ground, ground, foothold)
    centres, footholds = _stance_centres(posture, phases, gait, path.yaw, footing, plan_foothold)
    # where the planned ZMP jumps, its value before the jump: rounding would choose either side
    zmp = previous.plan.zmp(t - TIME_TOLERANCE) if previous else centres[0]
    lipm = LIPM(_zmp_segments(phases, centres, zmp, len(gait.feet)), state.com[:2], posture.omega)
    planned: dict[str, PlannedSwing] = {}
    for foot in posture.contacts.names:
        times = gait.swing_at(foot, t) if foot in gait.feet else None
        if previous and foot in (swings or {}) and foot not in stance:
            planned[foot] = replace(previous.planned_swings[foot], path=(swings or {})[foot])
        elif times:
            yaws = _nearest_yaws(_foot_yaw(posture, state, foot), yaw_at(times[1]))
            planned[foot] = _planned_swing(
                posture, options, state.point(foot), foot, footholds[foot], times, yaws
            )
    ramps, end = {}, interval[1] + TIME_TOLERANCE
    for foot in posture.contacts.names:
        landed = footing.touchdowns.get(foot, -inf) >= begin - TIME_TOLERANCE
        lifts = foot in gait.feet and end < inf and gait.swing_at(foot, end) is not None
        ramps[foot] = landed, lifts
    positions = {foot: foothold.position for foot, foothold in footholds.items()}
    replan = until - WEIGHT_SHIFT_TIME if endless else inf
    return StepPlan(
        t, stance, footing, positions, lipm, planned, path, ground, interval, replan, ramps
    )


def weight_shift(posture: WalkingPosture, state: State, t: float, gait: Gait) -> float:
    """Return how much later a gait must begin, so that the weight can shift before [s].

    The delay is 0 if the capture point is above the feet that stand at the first lift-off, or if
    only two points stand then: such a gait is kept in balance by its steps.
    """
    swings = [(foot, gait.next_swing(foot, t)) for foot in gait.feet]
    lift_offs = {foot: times[0] for foot, times in swings if times}
    first = min(lift_offs.values(), default=inf)
    delay = t + WEIGHT_SHIFT_TIME - first
    if delay <= TIME_TOLERANCE:
        return 0.0
    swinging = [foot for foot, time in lift_offs.items() if time <= first + TIME_TOLERANCE]
    points = posture.contacts.without(*swinging).positions(state)
    if len(points) <= 2:
        return 0.0
    dcm = capture_point(state.com, state.com_velocity, posture.omega)
    return delay if support_margin(dcm, points[:, :2]) < -DCM_DEAD_ZONE else 0.0


@dataclass(frozen=True, eq=False)
class _Foothold:
    """A planned foothold: the position of the foot's frame, (3,) [m], and the ground there."""

    position: Array
    ground: Plane


def _foothold(
    posture: WalkingPosture,
    terrain: Terrain | None,
    ground: Plane,
    rule: Callable[[str, float], npt.ArrayLike],
    foot: str,
    touchdown: float,
) -> _Foothold:
    """Return where a foot lands at a time [s], by a rule that gives two or three coordinates."""
    name = f"the foothold of {foot}"
    position = as_array(name, rule(foot, touchdown), (None,), "m")
    if position.shape not in ((2,), (3,)):
        raise InputError(
            f"{name} has shape {position.shape}; it must have shape (2,) or (3,) [m]: x and y in "
            f"the world frame, and optionally the height of the foot's frame."
        )
    if terrain is not None:
        plane = Plane.tangent(terrain, position[:2])
        ground = replace(plane, level=plane.level - posture.ground_height)
    if len(position) == 3:
        height = position[2] - posture.nominal_feet[foot][2]
        ground = replace(ground, level=float(height - ground.slope @ position[:2]))
    return _Foothold(posture.on_ground(foot, position[:2], ground), ground)


def _planned_swing(
    posture: WalkingPosture,
    options: WalkOptions,
    start: Array,
    foot: str,
    foothold: _Foothold,
    times: tuple[float, float],
    yaws: tuple[float, float],
) -> PlannedSwing:
    """Return the swing of a foot that lifts off now from `start`, (3,) [m]."""
    end, clearance = foothold.position, options.clearance
    if options.ground is not None:  # the foot rises above both ends
        clearance += abs(float(end[2] - start[2])) / 2.0
    tilts = LEVEL.slope, LEVEL.slope
    if options.ground is not None and foot in posture.flat_feet:
        below = Plane.tangent(options.ground, start[:2])
        tilts = below.tilt, foothold.ground.tilt
    path = options.swing(start, end, *times, clearance)
    return PlannedSwing(path, end, yaws, tilts, foothold.ground)


def _foot_yaw(posture: WalkingPosture, state: State, foot: str) -> float:
    """Return the yaw of a foot relative to the standing posture [rad]."""
    return yaw_of(state.frame_pose(foot).rotation @ posture.rotation(foot).T)


def _nearest_yaws(first: float, last: float) -> tuple[float, float]:
    """Return two yaw angles with `first` within half a turn of `last` [rad].

    The measured yaw of a foot is at most π, but the yaw of the path counts whole turns.
    """
    return last - remainder(last - first, 2.0 * pi), last


def _stance_centres(
    posture: WalkingPosture,
    phases: Sequence[Phase],
    gait: Gait,
    yaw: float,
    footing: Footing,
    foothold: Callable[[str, float], _Foothold],
) -> tuple[list[Array], dict[str, _Foothold]]:
    """Return the planned ZMP of each phase, (2,) [m], and the next foothold of each foot.

    The ZMP is in the middle of the standing feet. With more than four feet, it is as near to the
    middle of all feet as the support polygon allows, because the middle of the standing feet would
    sway the body: a tripod has two feet on one side and one on the other.
    """
    feet, centres = dict(footing.feet), []
    footholds: dict[str, _Foothold] = {}
    for begin, end, names in phases:
        stance = [name for name in posture.contacts.names if name in names or name not in gait.feet]
        # in flight there is no ZMP: the plan then keeps to the middle of all feet
        points = [posture.foot_centre(name, feet[name], yaw) for name in stance or feet]
        centre, before = np.mean(points, axis=0), dict(feet)
        for foot in gait.feet:
            times = gait.swing_at(foot, begin)
            if times is not None:
                planned = foothold(foot, times[1])
                footholds.setdefault(foot, planned)
                if abs(times[1] - end) < 2.0 * TIME_TOLERANCE:
                    feet[foot] = planned.position
        if len(feet) > MAX_FEET_WITH_SWAY and len(points) > 2:
            middle = np.mean([before[foot] + feet[foot] for foot in feet], axis=0)[:2] / 2.0
            centre = _nearest_inside(middle, centre, np.array(points))
        centres.append(centre)
    return centres, footholds


def _zmp_segments(
    phases: Sequence[Phase], centres: Sequence[Array], zmp: Array, n_feet: int
) -> list[ZMPSegment]:
    """Return the ZMP of the next phases from its present position, (2,) [m].

    The ZMP is in the middle of the standing feet, and shifts while all `n_feet` feet stand.
    """
    segments: list[ZMPSegment] = []
    for i, (begin, end, names) in enumerate(phases):
        all_stand, last = len(names) == n_feet, i + 1 == len(phases)
        goal = centres[i] if last or not all_stand else centres[i + 1]
        if not all_stand:
            segments.append((begin, end, goal, goal))
        elif end - begin <= WEIGHT_SHIFT_TIME:
            segments.append((begin, end, zmp, goal))
        elif last:  # move to the middle, then stay
            shifted = begin + WEIGHT_SHIFT_TIME
            segments += [(begin, shifted, zmp, goal), (shifted, end, goal, goal)]
        else:  # stay, then shift before the foot lifts off
            shift = end - WEIGHT_SHIFT_TIME
            segments += [(begin, shift, zmp, zmp), (shift, end, zmp, goal)]
        zmp = goal
    return segments


def _nearest_inside(wanted: Array, centre: Array, feet: Array) -> Array:
    """Return the point nearest to `wanted`, on the line to `centre`, with `_MIN_STATIC_MARGIN`.

    The result is `centre` if `centre` is no farther from the edge of the feet's support polygon.
    """
    inside, outside = 1.0, 0.0  # fractions of the way from `wanted` to `centre`
    if support_margin(wanted, feet) >= _MIN_STATIC_MARGIN:
        return wanted
    for _ in range(_BISECTIONS):
        fraction = (inside + outside) / 2.0
        if support_margin(wanted + fraction * (centre - wanted), feet) >= _MIN_STATIC_MARGIN:
            inside = fraction
        else:
            outside = fraction
    return wanted + inside * (centre - wanted)
