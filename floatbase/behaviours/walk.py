"""`Walk`: a controller that steps. It plans footholds and a pendulum at each change of stance, and
serves them by (26)(27).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import copysign, hypot, inf, sqrt
from typing import Any, ClassVar, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    FixedAttributes,
    as_array,
    as_callable,
    as_instance,
    as_number,
    as_positive,
)
from floatbase.behaviours.footholds import capture_point, neutral_point, step_adjustment
from floatbase.behaviours.gait import TIME_TOLERANCE, Gait, check_always_supported
from floatbase.behaviours.lipm import LIPM, ZMPSegment
from floatbase.behaviours.options import Gains, check_gait_feet, check_options, flat_foot_names
from floatbase.behaviours.reference import Motion, Reference, SwingState, rotated_by_yaw, yaw_of
from floatbase.behaviours.swing import Swing
from floatbase.control import Command, WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.errors import InfeasibleError, InputError
from floatbase.objectives import CoMTask, FrameTask, OrientationTask, PostureTask, Task
from floatbase.robots import Robot, State

Foothold: TypeAlias = Callable[[str, float, "Walk"], npt.ArrayLike]
Phase: TypeAlias = tuple[float, float, tuple[str, ...]]
_PLANNED_PHASES = 4  # stances that a plan looks ahead: two steps; eight are no better
_PLAN_HORIZON = 5.0  # s of standing that a plan looks ahead
_RESTART_GAP = 0.2  # s without a tick, after which another controller may have moved the robot
# s after which the height of a foot shows that of the ground: feet that aim where others just
# touched climb
_TOUCHDOWN_SETTLING_TIME = 0.05
# s before the first lift-off and after the last landing in which the ZMP moves
_ZMP_SHIFT_TIME = 0.8
# m of DCM error that a stance with area bears without moving a step: it would grow by up to e^{ω
# 1.2 s}
_DCM_DEAD_ZONE = 0.02
# m by which steps have moved, from which on the path moves along, or the robot runs back to it and
# falls
_PATH_SHIFT_THRESHOLD = 0.05
# part of its distance from the middle that a foot keeps to its own side: legs must not cross
_MIN_SIDE_FRACTION = 0.25
_DEFAULT_REACH, _DEFAULT_REACH_FLAT = 0.2, 0.3  # m
# times its even share of the weight: the normal force from which a ramp comes down
_RAMP_LOAD_FACTOR = 2.0
_SOFT_CONTACT_WEIGHT = 1e4  # weight of contacts that must give way, beside 10 of the tasks
_MAX_SPEED = 10.0  # m/s and rad/s: more is a slip of units
_HISTORY_LENGTH = 500  # changes of stance that are kept: two minutes of a trot, 4 MB


@dataclass(frozen=True)
class StepPlan:
    """What a `Walk` planned at one change of stance, or where it stood on and the plan came to its
    end.

    time: s.
    stance: the feet that stand from then on.
    feet: (3,) m, world, where each foot's frame stands or stood.
    footholds: (3,) m, world, where each foot that is in the air, or lifts next, is to land, as
        planned then.
    plan: of the centre of mass.
    swings: the paths of the feet that are in the air, as planned then.
    """

    time: float
    stance: tuple[str, ...]
    feet: dict[str, Array]
    footholds: dict[str, Array]
    plan: LIPM
    swings: dict[str, Swing]


class Walk(FixedAttributes):
    """Walks by a gait at a velocity: a controller like any other, for `fb.rollout`,
    `LiveSimulation`, `fb.sweep` and `fb.push_recovery`.

    At each change of stance it takes the feet where they are, plans the next footholds
    (`neutral_point`) and a linear inverted pendulum above them (`LIPM`), from where the centre of
    mass is. At each tick it moves the ends of the swings by `step_adjustment`, as far as the legs
    reach. One `WholeBodyController` for each stance does the rest; where no forces hold the feet,
    they give way. When the clock goes back, or 0.2 s ahead at once, it begins anew from the
    measured state.

    robot: the robot; its feet are point feet or flat feet.
    contacts: all its contacts; `Contacts.feet(robot)` fits.
    gait: when each foot is in the air; may be set while it walks: no foot lifts by the former one
        any more, and the new one takes over when all stand. Lift-offs that were over before are
        left out. At least one foot must stand at any time.
    velocity: (2,) m/s, forwards and to the left, of the body; may be set while it walks, and is
        approached by 1 m/s².
    yaw_rate: rad/s, to the left; as velocity.
    clearance: m, how high feet are lifted.
    reach: m, how far a foot may land from where it would stand below the body; 0.2 by default, 0.3
        for flat feet.
    ramp: s, in which a foot is unloaded before it lifts, and loaded after it landed, as far as all
        feet stand then; a max_normal_force among the options takes its place.
    foothold: (foot, touchdown in s, walk) -> (2,) m, world: where a foot should land, before
        adjustments; `neutral_point` below the body by default.
    gains: of its tasks; `Gains.for_contacts(contacts)` by default.
    options: more arguments of `fb.WholeBodyController`, such as facets.

    At velocity (0, 0) it marches on the spot; `walk.gait = dataclasses.replace(walk.gait,
    stop=walk.time)` makes it stand. `stance`, `footholds`, `swings`, `plan` and
    `history` tell what it is doing. A controller of your own around it needs its `contacts`, as
    they are at each tick. Raises `InputError` for arguments that do not fit.
    """

    _hints: ClassVar[dict[str, str]] = {
        **dict.fromkeys(
            ("robot", "clearance", "reach", "ramp", "foothold", "gains", "omega"),
            "make another one",
        ),
        **dict.fromkeys(
            ("time", "stance", "contacts", "footholds", "swings", "plan", "history"),
            "it tells what it is doing",
        ),
    }

    history: deque[StepPlan]

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        gait: Gait,
        velocity: npt.ArrayLike = (0.0, 0.0),
        yaw_rate: float = 0.0,
        *,
        clearance: float = 0.05,
        reach: float | None = None,
        ramp: float = 0.1,
        foothold: Foothold | None = None,
        gains: Gains | None = None,
        **options: Any,
    ):
        self.robot, self._all_contacts = (
            as_instance("robot", robot, Robot),
            as_instance("contacts", contacts, Contacts),
        )
        self._flat_feet = flat_foot_names(contacts)
        self._reference: Reference | None = None
        self.gait, self.velocity, self.yaw_rate = gait, velocity, yaw_rate
        self.clearance = as_positive("clearance", clearance, "m", allow_zero=True, maximum=1.0)
        self.reach = as_positive(
            "reach",
            (_DEFAULT_REACH_FLAT if self._flat_feet else _DEFAULT_REACH)
            if reach is None
            else reach,
            "m",
            maximum=1.0,
        )
        self.ramp = as_positive("ramp", ramp, "s", allow_zero=True, maximum=1.0)
        self.foothold = (
            raibert_foothold
            if foothold is None
            else as_callable("foothold", foothold, "foothold(foot, touchdown, walk)")
        )
        self.gains = (
            Gains.for_contacts(contacts) if gains is None else as_instance("gains", gains, Gains)
        )
        check_options(type(self).__name__, options)
        self._limits = WholeBodyController(
            robot, contacts, (), **options
        ).limits  # what does not fit is told now
        self._options, self._standing_state = options, robot.standing()
        self._single_contacts = {contact.name: Contacts([contact]) for contact in contacts}
        positions = {contact.name: self._standing_state.point(contact.name) for contact in contacts}
        centre = np.mean(
            [self._foot_centre(name, position, 0.0) for name, position in positions.items()], axis=0
        )
        self._nominal_feet = {
            name: position - [*centre, 0.0] for name, position in positions.items()
        }
        ground = float(contacts.positions(self._standing_state)[:, 2].mean())
        self.omega = sqrt(robot.gravity / (self._standing_state.com[2] - ground))
        self._clear()
        self._initialised = True

    @property
    def gait(self) -> Gait:
        """When each foot is in the air, as it was set last."""
        return self._gait

    @gait.setter
    def gait(self, gait: Gait) -> None:
        check_gait_feet(as_instance("gait", gait, Gait, "Gait.trot(robot)"), self._all_contacts)
        if len(gait.feet) == len(self._all_contacts):
            check_always_supported(gait)
        self._gait = gait

    @property
    def velocity(self) -> Array:
        """(2,) m/s, forwards and to the left, that is desired."""
        return self._velocity

    @velocity.setter
    def velocity(self, velocity: npt.ArrayLike) -> None:
        self._velocity = as_array("velocity", velocity, (2,), "m/s")
        as_number("speed", float(np.linalg.norm(self._velocity)), "m/s", maximum=_MAX_SPEED)

    @property
    def yaw_rate(self) -> float:
        """rad/s, to the left, that is desired."""
        return self._yaw_rate

    @yaw_rate.setter
    def yaw_rate(self, yaw_rate: float) -> None:
        self._yaw_rate = as_number("yaw_rate", yaw_rate, "rad/s", -_MAX_SPEED, _MAX_SPEED)

    @property
    def time(self) -> float | None:
        """s, of the last tick; None before the first."""
        return self._ref.time if self._reference else None

    @property
    def stance(self) -> tuple[str, ...]:
        """The feet that stand now."""
        return self._ref.stance if self._reference else self._all_contacts.names

    @property
    def contacts(self) -> Contacts:
        """The contacts of the present stance."""
        key = (self.stance, False)
        return self._controllers[key].contacts if key in self._controllers else self._all_contacts

    @property
    def footholds(self) -> dict[str, Array]:
        """Where each foot that is in the air, or lifts next, is to land: (3,) m, world, of its
        frame.
        """
        return (
            {**self._ref.footholds, **{foot: path.end for foot, path in self.swings.items()}}
            if self._reference
            else {}
        )

    @property
    def swings(self) -> dict[str, Swing]:
        """The paths of the feet that are in the air."""
        return (
            {foot: each.path for foot, each in self._ref.swinging.items()}
            if self._reference
            else {}
        )

    @property
    def plan(self) -> LIPM | None:
        """The plan of the centre of mass, horizontally; None before the first tick."""
        return self._ref.plan if self._reference else None

    def nominal_foothold(self, foot: str, t: float) -> Array:
        """Where a foot would stand below the body at time t in s, (2,) m, world, if the desired
        velocity goes on.
        """
        foot = self._all_contacts[foot].name  # an `UnknownNameError` tells what there is
        position, yaw, _ = self._path_at(as_number("t", t, "s"))
        return position + rotated_by_yaw(self._nominal_feet[foot][:2], yaw)

    def velocity_at(self, t: float) -> Array:
        """The body's velocity at time t in s, (2,) m/s, world, if the desired one goes on."""
        _, yaw, velocity = self._path_at(as_number("t", t, "s"))
        return rotated_by_yaw(velocity[:2], yaw)

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """The tick: torques for configuration q, shape (nq,), and velocity v, shape (nv,), at time
        t in s.
        """
        state, t = State(self.robot, q, as_array("v", v, (self.robot.nv,))), as_number("t", t, "s")
        if not self._continues(t):
            self._initialize(state, t)
        ref = self._ref
        self._update_gait(t)
        (ref.position, ref.yaw, ref.velocity), ref.time = self._path_at(t), t
        stance = self._stance_at(t)
        if stance != ref.stance or t >= ref.replan_time:
            self._replan(state, stance)
        self._adjust_footholds(state)
        try:
            return self._stance_controller()(q, v, t)
        except InfeasibleError:  # torques and friction do not hold the feet
            return self._stance_controller(contact_weight=_SOFT_CONTACT_WEIGHT)(q, v, t)

    @property
    def _ref(self) -> Reference:
        if self._reference is None:
            raise InputError(
                "a Walk has no path before its first tick: call it as walk(q, v, t), or run a "
                "rollout."
            )
        return self._reference

    def _continues(self, t: float) -> bool:
        """Whether time t, s, follows the last tick; else it begins anew."""
        ref = self._reference
        return (
            ref is not None
            and t > ref.start_time
            and ref.time - TIME_TOLERANCE <= t <= ref.time + _RESTART_GAP
        )

    def _clear(self) -> None:
        self._controllers: dict[tuple[tuple[str, ...], bool], WholeBodyController] = {}
        self._reference = None
        vars(self)["history"] = deque(maxlen=_HISTORY_LENGTH)

    def _path_at(self, t: float) -> tuple[Array, float, Array]:
        """Place, yaw and velocity of the path at t; it stands before the first foot lifts, and once
        none does any more.
        """
        ref, begin = self._ref, max(self._ref.time, self._ref.gait.start)
        walking = ref.swinging or any(ref.gait.next_swing(foot, begin) for foot in ref.gait.feet)
        return ref.predict(
            np.array([*self.velocity, self.yaw_rate]) if walking else np.zeros(3), begin, t
        )

    def _update_gait(self, t: float) -> None:
        """Where another gait is asked for, walk by that once all feet stand; those in the air come
        down as they were to.
        """
        ref = self._ref
        if ref.requested_gait is not None and vars(self._gait) == vars(ref.requested_gait):
            return
        if not ref.swinging:
            ref.requested_gait, ref.gait, ref.replan_time = self._gait, self._gait.starting_at(t), t
        elif ref.gait.stop is None or ref.gait.stop > t:
            ref.requested_gait, ref.gait = None, replace(ref.gait, stop=t)

    def _stance_at(self, t: float) -> tuple[str, ...]:
        gait = self._ref.gait
        swinging = {foot for foot in gait.feet if gait.swing_at(foot, t)}
        return tuple(name for name in self._all_contacts.names if name not in swinging)

    def _initialize(self, state: State, t: float) -> None:
        """Start from the measured state: the path begins in the middle of the feet."""
        yaw = yaw_of(state.frame_pose("base").rotation)
        feet = {name: state.point(name) for name in self._all_contacts.names}
        positions = [
            feet[name][:2] - rotated_by_yaw(nominal_foot[:2], yaw)
            for name, nominal_foot in self._nominal_feet.items()
        ]
        gait, position = self._gait, np.mean(positions, axis=0)
        self._reference = Reference(
            self._standing_state,
            self._nominal_feet,
            gait,
            gait.starting_at(t),
            t,
            t,
            position,
            yaw,
            feet,
        )
        self.history.clear()

    def _replan(self, state: State, stance: tuple[str, ...]) -> None:
        """Another stance begins, or its plan ends: take the feet where they are, and plan anew."""
        ref = self._ref
        for foot in ref.stance or stance:
            if ref.time > ref.touchdown_times.get(foot, -inf) + _TOUCHDOWN_SETTLING_TIME:
                ref.feet[foot] = state.point(foot)
        self._register_touchdowns(state, [foot for foot in stance if foot in ref.swinging])
        phases = ref.gait.phases(ref.time, _PLANNED_PHASES, _PLAN_HORIZON)
        begin, until = ref.stance_interval[0] if stance == ref.stance else ref.time, phases[0][1]
        ref.stance_interval, ref.replan_time, ref.stance, ref.footholds = (
            (begin, until),
            inf,
            stance,
            {},
        )
        if len(phases) == 1:  # it stands, and no end is in sight
            ref.stance_interval, ref.replan_time = (begin, inf), until - _ZMP_SHIFT_TIME
        ref.fit_ground()
        ref.plan = LIPM(self._zmp_segments(phases), state.com[:2], self.omega)
        for foot in self._all_contacts.names:
            times = ref.gait.swing_at(foot, ref.time) if foot in ref.gait.feet else None
            if times and foot not in ref.swinging:
                end, yaw = (
                    ref.footholds[foot],
                    yaw_of(state.frame_pose(foot).rotation @ self._nominal_rotation(foot).T),
                )
                path = Swing(state.point(foot), end, *times, self.clearance)
                ref.swinging[foot] = SwingState(path, end, (yaw, self._path_at(times[1])[1]))
        self.history.append(
            StepPlan(ref.time, stance, dict(ref.feet), dict(ref.footholds), ref.plan, self.swings)
        )

    def _register_touchdowns(self, state: State, feet: Sequence[str]) -> None:
        """These feet have landed; the path moves along where they were moved far."""
        ref, offsets = self._ref, []
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
        ) / 2.0  # swinging legs sway the body to one side and to the other
        if np.linalg.norm(mean_offset) > _PATH_SHIFT_THRESHOLD:
            ref.position = ref.position + mean_offset

    def _zmp_segments(self, phases: Sequence[Phase]) -> list[ZMPSegment]:
        """The ZMP of the coming phases: in the middle of the feet that stand, and shifting while
        all stand.
        """
        ref, centres = self._ref, self._stance_centres(phases)
        zmp = ref.plan.zmp(ref.time) if ref.plan else centres[0]
        segments: list[ZMPSegment] = []
        for i, (begin, end, names) in enumerate(phases):
            all_stand, last = len(names) == len(ref.gait.feet), i + 1 == len(phases)
            goal = centres[i] if last or not all_stand else centres[i + 1]
            if not all_stand:
                segments.append((begin, end, goal, goal))
            elif end - begin <= _ZMP_SHIFT_TIME:
                segments.append((begin, end, zmp, goal))
            elif last:  # come to the middle, and stay
                segments += [
                    (begin, begin + _ZMP_SHIFT_TIME, zmp, goal),
                    (begin + _ZMP_SHIFT_TIME, end, goal, goal),
                ]
            else:  # stay, then shift before the foot lifts
                segments += [
                    (begin, end - _ZMP_SHIFT_TIME, zmp, zmp),
                    (end - _ZMP_SHIFT_TIME, end, zmp, goal),
                ]
            zmp = goal
        return segments

    def _stance_centres(self, phases: Sequence[Phase]) -> list[Array]:
        """The middle of the feet that stand in each phase, (2,) m; finds the footholds of those
        that swing.
        """
        ref, feet, centres = self._ref, dict(self._ref.feet), []
        for begin, end, names in phases:
            stance = [
                name
                for name in self._all_contacts.names
                if name in names or name not in ref.gait.feet
            ]
            centres.append(
                np.mean([self._foot_centre(name, feet[name], ref.yaw) for name in stance], axis=0)
            )
            for foot in ref.gait.feet:
                times = ref.gait.swing_at(foot, begin)
                if times is not None:
                    position = as_array(
                        f"the foothold of {foot}", self.foothold(foot, times[1], self), (2,), "m"
                    )
                    ref.footholds.setdefault(foot, ref.on_ground(foot, position))
                    if abs(times[1] - end) < 2.0 * TIME_TOLERANCE:
                        feet[foot] = ref.on_ground(foot, position)
        return centres

    def _foot_centre(self, foot: str, position: Array, yaw: float) -> Array:
        """Where a foot carries best, (2,) m: the middle of a sole, below the centre of a ball.
        position: (3,) m, of its frame.
        """
        contact = self._all_contacts[foot]
        to_ground = (
            getattr(contact, "radius", 0.0) * contact.normal
        )  # a ball touches there however it is turned
        offset = (
            contact.positions(self._standing_state).mean(axis=0)
            - self._standing_state.point(foot)
            + to_ground
        )
        return position[:2] + rotated_by_yaw(offset[:2], yaw) - to_ground[:2]

    def _adjust_footholds(self, state: State) -> None:
        """Shift the ends of the swings by what the DCM misses of the plan, as far as the legs
        reach.
        """
        ref = self._ref
        if not ref.swinging:
            return
        assert ref.plan is not None
        error = capture_point(state.com, state.com_velocity, self.omega) - ref.plan.dcm(ref.time)
        dead_zone = _DCM_DEAD_ZONE if len(ref.stance) > 2 or self._flat_feet else 0.0
        for touchdown in {
            each.path.touchdown for each in ref.swinging.values()
        }:  # feet of a trot land together
            shift = step_adjustment(error, touchdown - ref.time, self.omega, dead_zone)
            com_at_touchdown = state.com[:2] + state.com_velocity[:2] * (touchdown - ref.time)
            for foot, each in ref.swinging.items():
                if each.path.touchdown == touchdown:
                    end = self._clamp_to_reach(foot, each.planned_end[:2] + shift, com_at_touchdown)
                    each.path = each.path.with_end(ref.on_ground(foot, end))

    def _clamp_to_reach(self, foot: str, end: Array, body: Array) -> Array:
        """The foothold nearest to `end`, (2,) m, that the leg reaches from the body, (2,) m, and
        that is on the foot's side.
        """
        nominal, yaw = self._nominal_feet[foot][:2], self._ref.yaw
        offset = rotated_by_yaw(end - body, -yaw) - nominal
        position = nominal + offset * min(1.0, self.reach / (hypot(*offset) or 1.0))
        side = copysign(1.0, nominal[1])
        position[1] = side * max(side * position[1], _MIN_SIDE_FRACTION * abs(nominal[1]))
        return body + rotated_by_yaw(position, yaw)

    def _stance_controller(self, **options: Any) -> WholeBodyController:
        """The controller of the present stance, made when it is first needed. options: more of
        them.
        """
        stance = self._ref.stance
        key = (stance, bool(options))
        if key not in self._controllers:
            arguments = {
                "max_normal_force": self._normal_force_bounds(stance),
                **self._options,
                **options,
            }
            self._controllers[key] = WholeBodyController(
                self.robot, self._all_contacts.only(*stance), self._tasks(stance), **arguments
            )
        return self._controllers[key]

    def _tasks(self, stance: Sequence[str]) -> list[Task]:
        """The tasks of a stance; their targets follow the reference."""
        (com, com_weight), (base, base_weight) = self.gains.com, self.gains.base
        (swing, swing_weight), (posture, posture_weight) = self.gains.swing, self.gains.posture
        tasks: list[Task] = [
            CoMTask(lambda t: self._ref.com_target(t), kp=com, weight=com_weight),
            OrientationTask(
                "base", lambda t: self._ref.base_target(t), kp=base, weight=base_weight
            ),
            PostureTask(self._standing_state.q, kp=posture, weight=posture_weight),
        ]
        for foot in set(self._all_contacts.names) - set(stance):
            tasks.append(
                FrameTask(foot, partial(self._foot_target, foot), kp=swing, weight=swing_weight)
            )
            if foot in self._flat_feet:
                tasks.append(
                    OrientationTask(
                        foot,
                        partial(self._foot_rotation_target, foot),
                        kp=swing,
                        weight=swing_weight,
                    )
                )
        return tasks

    def _foot_target(self, foot: str, t: float) -> Motion:
        return self._ref.foot_target(foot, t)

    def _foot_rotation_target(self, foot: str, t: float) -> Motion:
        return self._ref.foot_rotation_target(foot, t)

    def _nominal_rotation(self, foot: str) -> Array:
        rotation: Array = self._standing_state.frame_pose(foot).rotation
        return rotation

    def _normal_force_bounds(
        self, stance: Sequence[str]
    ) -> dict[str, Callable[[float], float]] | None:
        """Bounds of the normal force of each point while all feet stand, for ramps; None where a
        foot is in the air.
        """
        if self.ramp == 0.0 or len(stance) < len(self._all_contacts) or len(stance) < 2:
            return None
        return {foot: partial(self._normal_force_bound, foot) for foot in self._all_contacts.names}

    def _normal_force_bound(self, foot: str, t: float) -> float:
        full_load = (
            _RAMP_LOAD_FACTOR
            * self.robot.weight
            / len(self._all_contacts)
            / len(self._all_contacts[foot].point_names)
        )
        minimum = float(self._limits.normal_forces(self._single_contacts[foot], t)[0].max())
        return max(minimum, self._ref.normal_force_bound(foot, t, self.ramp, full_load))

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles begin anew: controllers are made again, and nothing is remembered."""
        return {
            key: value
            for key, value in vars(self).items()
            if key not in ("_controllers", "_reference", "history")
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._clear()

    def __repr__(self) -> str:
        forwards, left = self.velocity
        return (
            f"{type(self).__name__}({self.robot.name}, {len(self.gait.feet)} feet, "
            f"{forwards:g} and {left:g} m/s)"
        )


def raibert_foothold(foot: str, touchdown: float, walk: Walk) -> Array:
    """The foothold, (2,) m, of a foot that lands at `touchdown` s: `neutral_point` below the body
    on its path.
    """
    gait = walk.gait
    return neutral_point(
        walk.nominal_foothold(foot, touchdown),
        walk.velocity_at(touchdown),
        gait.period - gait.swing,
    )
