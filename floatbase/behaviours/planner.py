"""`Planner`: footholds and centre-of-mass motion of a `Walk`, from its state and its gait."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import copysign, hypot, inf, sqrt
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_array
from floatbase.behaviours.footholds import capture_point, step_adjustment, support_margin
from floatbase.behaviours.gait import TIME_TOLERANCE, Gait
from floatbase.behaviours.lipm import LIPM, ZMPSegment
from floatbase.behaviours.options import flat_foot_names
from floatbase.behaviours.reference import Reference, SwingState, rotated_by_yaw, yaw_of
from floatbase.behaviours.speed import MAX_FEET_WITH_SWAY
from floatbase.behaviours.swing import Swing
from floatbase.dynamics import Contacts
from floatbase.robots import State

Phase: TypeAlias = tuple[float, float, tuple[str, ...]]
_PLANNED_PHASES = 4  # stances that a plan looks ahead: two steps; eight are no better
_PLAN_HORIZON = 5.0  # s of standing that a plan looks ahead
# s after touchdown until the height of a foot is used as that of the ground: earlier heights make
# the planned footholds climb
_TOUCHDOWN_SETTLING_TIME = 0.05
# s before the first lift-off and after the last touchdown in which the ZMP shifts
_ZMP_SHIFT_TIME = 0.8
# m of DCM error that a stance with area tolerates without moving a step: the error would grow by up
# to e^{ω 1.2 s}
_DCM_DEAD_ZONE = 0.02
# m: if steps were shifted by more, the path is shifted, too; otherwise the robot runs back to it
# and falls
_PATH_SHIFT_THRESHOLD = 0.05
# fraction of its nominal distance from the middle that a foot keeps on its side: legs must not
# cross
_MIN_SIDE_FRACTION = 0.25
_MIN_STATIC_MARGIN = 0.03  # m from the edge of the support polygon at which the ZMP may stay
_BISECTIONS = 10  # halvings of the way, so that the ZMP is known to 0.1 % of it


@dataclass(frozen=True)
class StepPlan:
    """Plan that a `Walk` makes when its stance changes, or when its plan ends while it stands.

    Parameters
    ----------
    time : float
        Time of the plan [s].
    stance : tuple of str
        Feet that stand from then on.
    feet : dict of str to ndarray, shape (3,)
        Position of each foot's frame, where it stands or last stood, in the world frame [m].
    footholds : dict of str to ndarray, shape (3,)
        Planned foothold of each foot that is in the air or lifts off next, in the world frame [m].
    plan : LIPM
        Plan of the centre of mass.
    swings : dict of str to Swing
        Planned paths of the feet in the air.
    """

    time: float
    stance: tuple[str, ...]
    feet: dict[str, Array]
    footholds: dict[str, Array]
    plan: LIPM
    swings: dict[str, Swing]


class Planner:
    """Planner of footholds, swings and the centre-of-mass motion.

    Parameters
    ----------
    contacts : Contacts
        All the robot's contacts.
    standing_state : State
        State whose posture the robot keeps.
    clearance : float
        Height of the swings, as for `Walk` [m].
    reach : float
        Largest distance of a foothold from the nominal one, as for `Walk` [m].

    Attributes
    ----------
    nominal_feet : dict of str to ndarray, shape (3,)
        Position of each foot's frame in the standing posture, relative to the middle of the feet on
        the ground [m].
    omega : float
        Natural frequency of the pendulum [1/s].
    """

    def __init__(self, contacts: Contacts, standing_state: State, clearance: float, reach: float):
        self.contacts, self.standing_state = contacts, standing_state
        self.clearance, self.reach = clearance, reach
        self.flat_feet = flat_foot_names(contacts)
        positions = {contact.name: standing_state.point(contact.name) for contact in contacts}
        centre = np.mean(
            [self._foot_centre(name, position, 0.0) for name, position in positions.items()], axis=0
        )
        self.nominal_feet = {
            name: position - [*centre, 0.0] for name, position in positions.items()
        }
        ground = float(contacts.positions(standing_state)[:, 2].mean())
        self.omega = sqrt(standing_state.robot.gravity / (standing_state.com[2] - ground))

    def start(self, state: State, gait: Gait, t: float) -> Reference:
        """Return the reference for a measured state; its path begins in the middle of the feet."""
        yaw = yaw_of(state.frame_pose("base").rotation)
        feet = {name: state.point(name) for name in self.contacts.names}
        positions = [
            feet[name][:2] - rotated_by_yaw(nominal_foot[:2], yaw)
            for name, nominal_foot in self.nominal_feet.items()
        ]
        return Reference(
            self.standing_state,
            self.nominal_feet,
            gait,
            gait.starting_at(t),
            t,
            t,
            np.mean(positions, axis=0),
            yaw,
            feet,
        )

    def replan(
        self,
        ref: Reference,
        state: State,
        stance: tuple[str, ...],
        foothold: Callable[[str, float], npt.ArrayLike],
        yaw_at: Callable[[float], float],
    ) -> StepPlan:
        """Plan anew from the feet's present positions, when the stance changes or its plan ends.

        Parameters
        ----------
        ref : Reference
            The reference, which is updated.
        state : State
            The measured state.
        stance : tuple of str
            Feet that stand from now on.
        foothold : callable
            Called as foothold(foot, touchdown) with the time of touchdown [s]; returns the
            foothold, shape (2,), in the world frame [m].
        yaw_at : callable
            Called as yaw_at(t) with a time [s]; returns the yaw of the path [rad].

        Returns
        -------
        StepPlan
            The plan.
        """
        for foot in ref.stance or stance:
            if ref.time > ref.touchdown_times.get(foot, -inf) + _TOUCHDOWN_SETTLING_TIME:
                ref.feet[foot] = state.point(foot)
        self._register_touchdowns(ref, state, [foot for foot in stance if foot in ref.swinging])
        phases = ref.gait.phases(ref.time, _PLANNED_PHASES, _PLAN_HORIZON)
        begin, until = ref.stance_interval[0] if stance == ref.stance else ref.time, phases[0][1]
        ref.stance_interval, ref.replan_time, ref.stance, ref.footholds = (
            (begin, until),
            inf,
            stance,
            {},
        )
        if len(phases) == 1:  # it stands, with no end within the horizon
            ref.stance_interval, ref.replan_time = (begin, inf), until - _ZMP_SHIFT_TIME
        ref.fit_ground()
        ref.plan = LIPM(self._zmp_segments(ref, phases, foothold), state.com[:2], self.omega)
        for foot in self.contacts.names:
            times = ref.gait.swing_at(foot, ref.time) if foot in ref.gait.feet else None
            if times and foot not in ref.swinging:
                end, yaw = (
                    ref.footholds[foot],
                    yaw_of(state.frame_pose(foot).rotation @ self._nominal_rotation(foot).T),
                )
                path = Swing(state.point(foot), end, *times, self.clearance)
                ref.swinging[foot] = SwingState(path, end, (yaw, yaw_at(times[1])))
        swings = {foot: each.path for foot, each in ref.swinging.items()}
        return StepPlan(ref.time, stance, dict(ref.feet), dict(ref.footholds), ref.plan, swings)

    def weight_shift(self, gait: Gait, state: State, t: float) -> float:
        """Return how much later a gait must begin, so that the weight can shift before [s].

        The delay is 0 if the capture point is above the feet that stand at the first lift-off, or
        if only two points stand then: such a gait is kept in balance by its steps.

        Parameters
        ----------
        gait : Gait
            Gait without lift-offs before t.
        state : State
            The measured state, with all feet on the ground.
        t : float
            The time [s].
        """
        swings = {foot: gait.next_swing(foot, t) for foot in gait.feet}
        first = min((times[0] for times in swings.values() if times), default=inf)
        delay = t + _ZMP_SHIFT_TIME - first
        if delay <= TIME_TOLERANCE:
            return 0.0
        swinging = [
            foot for foot, times in swings.items() if times and times[0] <= first + TIME_TOLERANCE
        ]
        points = self.contacts.without(*swinging).positions(state)
        if len(points) <= 2:
            return 0.0
        dcm = capture_point(state.com, state.com_velocity, self.omega)
        return delay if support_margin(dcm, points[:, :2]) < -_DCM_DEAD_ZONE else 0.0

    def adjust_footholds(self, ref: Reference, state: State) -> None:
        """Shift the ends of the swings by the error of the DCM, as far as the legs reach."""
        if not ref.swinging:
            return
        assert ref.plan is not None
        error = capture_point(state.com, state.com_velocity, self.omega) - ref.plan.dcm(ref.time)
        dead_zone = _DCM_DEAD_ZONE if len(ref.stance) > 2 or self.flat_feet else 0.0
        # two feet of a trot land together
        for touchdown in dict.fromkeys(each.path.touchdown for each in ref.swinging.values()):
            shift = step_adjustment(error, touchdown - ref.time, self.omega, dead_zone)
            com_at_touchdown = state.com[:2] + state.com_velocity[:2] * (touchdown - ref.time)
            for foot, each in ref.swinging.items():
                if each.path.touchdown == touchdown:
                    end = self._clamp_to_reach(
                        ref.yaw, foot, each.planned_end[:2] + shift, com_at_touchdown
                    )
                    each.path = each.path.with_end(ref.on_ground(foot, end))

    def _register_touchdowns(self, ref: Reference, state: State, feet: Sequence[str]) -> None:
        """Register that feet have landed, and shift the path if the steps were shifted far."""
        offsets = []
        for foot in feet:
            each = ref.swinging.pop(foot)
            ref.feet[foot] = np.array([*state.point(foot)[:2], each.path.end[2]])
            offsets.append((ref.feet[foot] - each.planned_end)[:2])
            ref.touchdown_times[foot] = ref.time
        if not offsets:
            return
        before, ref.step_offset = ref.step_offset, np.mean(offsets, axis=0)
        mean_offset = (
            before + ref.step_offset
        ) / 2.0  # the mean of two steps, as swinging legs sway the body to both sides in turn
        if np.linalg.norm(mean_offset) > _PATH_SHIFT_THRESHOLD:
            ref.position = ref.position + mean_offset

    def _zmp_segments(
        self,
        ref: Reference,
        phases: Sequence[Phase],
        foothold: Callable[[str, float], npt.ArrayLike],
    ) -> list[ZMPSegment]:
        """Return the ZMP of the next phases.

        The ZMP is in the middle of the standing feet, and shifts while all feet stand.
        """
        centres = self._stance_centres(ref, phases, foothold)
        zmp = ref.plan.zmp(ref.time) if ref.plan else centres[0]
        segments: list[ZMPSegment] = []
        for i, (begin, end, names) in enumerate(phases):
            all_stand, last = len(names) == len(ref.gait.feet), i + 1 == len(phases)
            goal = centres[i] if last or not all_stand else centres[i + 1]
            if not all_stand:
                segments.append((begin, end, goal, goal))
            elif end - begin <= _ZMP_SHIFT_TIME:
                segments.append((begin, end, zmp, goal))
            elif last:  # move to the middle, then stay
                segments += [
                    (begin, begin + _ZMP_SHIFT_TIME, zmp, goal),
                    (begin + _ZMP_SHIFT_TIME, end, goal, goal),
                ]
            else:  # stay, then shift before the foot lifts off
                segments += [
                    (begin, end - _ZMP_SHIFT_TIME, zmp, zmp),
                    (end - _ZMP_SHIFT_TIME, end, zmp, goal),
                ]
            zmp = goal
        return segments

    def _stance_centres(
        self,
        ref: Reference,
        phases: Sequence[Phase],
        foothold: Callable[[str, float], npt.ArrayLike],
    ) -> list[Array]:
        """Return the planned ZMP of each phase, (2,) [m], and set new footholds.

        The ZMP is in the middle of the standing feet. With more than four feet, it is as near to
        the middle of all feet as the support polygon allows, because the middle of the standing
        feet would sway the body: a tripod has two feet on one side and one on the other.
        """
        feet, centres = dict(ref.feet), []
        for begin, end, names in phases:
            stance = [
                name for name in self.contacts.names if name in names or name not in ref.gait.feet
            ]
            points = [self._foot_centre(name, feet[name], ref.yaw) for name in stance]
            centre, before = np.mean(points, axis=0), dict(feet)
            for foot in ref.gait.feet:
                times = ref.gait.swing_at(foot, begin)
                if times is not None:
                    position = as_array(
                        f"the foothold of {foot}", foothold(foot, times[1]), (2,), "m"
                    )
                    ref.footholds.setdefault(foot, ref.on_ground(foot, position))
                    if abs(times[1] - end) < 2.0 * TIME_TOLERANCE:
                        feet[foot] = ref.on_ground(foot, position)
            if len(feet) > MAX_FEET_WITH_SWAY and len(points) > 2:
                middle = np.mean([before[foot] + feet[foot] for foot in feet], axis=0)[:2] / 2.0
                centre = _nearest_inside(middle, centre, np.array(points))
            centres.append(centre)
        return centres

    def _foot_centre(self, foot: str, position: Array, yaw: float) -> Array:
        """Return the best centre of pressure of a foot whose frame is at `position`, (2,) [m].

        The best point is the middle of a sole, or the point below the centre of a ball.
        """
        contact = self.contacts.friction_contact(foot)
        to_ground = (
            getattr(contact, "radius", 0.0) * contact.normal
        )  # a ball touches the ground there in any orientation
        offset = (
            contact.positions(self.standing_state).mean(axis=0)
            - self.standing_state.point(foot)
            + to_ground
        )
        return position[:2] + rotated_by_yaw(offset[:2], yaw) - to_ground[:2]

    def _clamp_to_reach(self, yaw: float, foot: str, end: Array, body: Array) -> Array:
        """Return the foothold nearest to `end`, (2,) [m], in reach and on the foot's own side."""
        nominal = self.nominal_feet[foot][:2]
        offset = rotated_by_yaw(end - body, -yaw) - nominal
        position = nominal + offset * min(1.0, self.reach / (hypot(*offset) or 1.0))
        side = copysign(1.0, nominal[1])
        position[1] = side * max(side * position[1], _MIN_SIDE_FRACTION * abs(nominal[1]))
        return body + rotated_by_yaw(position, yaw)

    def _nominal_rotation(self, foot: str) -> Array:
        """Return the rotation of a foot in the standing posture."""
        rotation: Array = self.standing_state.frame_pose(foot).rotation
        return rotation


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
