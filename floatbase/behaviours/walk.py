"""`Walk`: a controller that steps. It plans footholds and a pendulum at each change of stance, and
serves them by (26)(27).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    as_array,
    as_callable,
    as_instance,
    as_number,
    as_positive,
    refuse_new_attributes,
)
from floatbase.behaviours.footholds import neutral_point
from floatbase.behaviours.gait import TIME_TOLERANCE, Gait, check_always_supported
from floatbase.behaviours.lipm import LIPM
from floatbase.behaviours.options import Gains, check_gait_feet, check_options, flat_foot_names
from floatbase.behaviours.planner import Planner, StepPlan
from floatbase.behaviours.reference import Motion, Reference, rotated_by_yaw
from floatbase.behaviours.swing import Swing
from floatbase.control import Command, WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.objectives import CoMTask, FrameTask, OrientationTask, PostureTask, Task
from floatbase.robots import Robot, State

Foothold: TypeAlias = Callable[[str, float, "Walk"], npt.ArrayLike]
_RESTART_GAP = 0.2  # s without a tick, after which another controller may have moved the robot
_DEFAULT_REACH, _DEFAULT_REACH_FLAT = 0.2, 0.3  # m
_RAMP_LOAD_FACTOR = 2.0  # times its share of the weight: the normal force a ramp comes down from
_MAX_SPEED = 10.0  # m/s and rad/s: more is a slip of units
_HISTORY_LENGTH = 500  # changes of stance that are kept: two minutes of a trot, 4 MB


class Walk:
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

    __setattr__ = refuse_new_attributes

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
        self._robot = as_instance("robot", robot, Robot)
        self._all_contacts = as_instance("contacts", contacts, Contacts)
        self._reference: Reference | None = None
        self.gait, self.velocity, self.yaw_rate = gait, velocity, yaw_rate
        self._clearance = as_positive("clearance", clearance, "m", allow_zero=True, maximum=1.0)
        if reach is None:
            reach = _DEFAULT_REACH_FLAT if flat_foot_names(contacts) else _DEFAULT_REACH
        self._reach = as_positive("reach", reach, "m", maximum=1.0)
        self._ramp = as_positive("ramp", ramp, "s", allow_zero=True, maximum=1.0)
        self._foothold = (
            raibert_foothold
            if foothold is None
            else as_callable("foothold", foothold, "foothold(foot, touchdown, walk)")
        )
        self._gains = (
            Gains.for_contacts(contacts) if gains is None else as_instance("gains", gains, Gains)
        )
        check_options(type(self).__name__, options)
        self._limits = WholeBodyController(
            robot, contacts, (), **options
        ).limits  # what does not fit is told now
        self._options, self._standing_state = options, robot.standing()
        self._single_contacts = {contact.name: Contacts([contact]) for contact in contacts}
        self._planner = Planner(contacts, self._standing_state, self._clearance, self._reach)
        self._clear()

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @property
    def clearance(self) -> float:
        """m, how high feet are lifted."""
        return self._clearance

    @property
    def reach(self) -> float:
        """m, how far a foot may land from where it would stand below the body."""
        return self._reach

    @property
    def ramp(self) -> float:
        """s, in which a foot is unloaded or loaded."""
        return self._ramp

    @property
    def foothold(self) -> Foothold:
        """Where a foot should land."""
        return self._foothold

    @property
    def gains(self) -> Gains:
        """Gains of the tasks."""
        return self._gains

    @property
    def omega(self) -> float:
        """1/s, of the pendulum."""
        return self._planner.omega

    @property
    def history(self) -> deque[StepPlan]:
        """Plans of the last changes of stance."""
        return self._history

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
        velocity = as_array("velocity", velocity, (2,), "m/s")
        as_number("speed", float(np.linalg.norm(velocity)), "m/s", maximum=_MAX_SPEED)
        self._velocity = velocity

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
        controller = self._controllers.get(self.stance)
        return self._all_contacts if controller is None else controller.contacts

    @property
    def footholds(self) -> dict[str, Array]:
        """Where each foot that is in the air, or lifts next, is to land: (3,) m, world, of its
        frame.
        """
        ends = {foot: path.end for foot, path in self.swings.items()}
        return self._ref.footholds | ends if self._reference else {}

    @property
    def swings(self) -> dict[str, Swing]:
        """The paths of the feet that are in the air."""
        if self._reference is None:
            return {}
        return {foot: each.path for foot, each in self._reference.swinging.items()}

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
        return position + rotated_by_yaw(self._planner.nominal_feet[foot][:2], yaw)

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
            plan = self._planner.replan(ref, state, stance, self._foothold_at, self._yaw_at)
            self._history.append(plan)
        self._planner.adjust_footholds(ref, state)
        return self._stance_controller()(q, v, t)

    @property
    def _ref(self) -> Reference:
        if self._reference is None:
            raise InputError("A Walk has no path before its first walk(q, v, t), as in a rollout.")
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
        self._controllers: dict[tuple[str, ...], WholeBodyController] = {}
        self._reference = None
        self._history: deque[StepPlan] = deque(maxlen=_HISTORY_LENGTH)

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

    def _initialize(self, state: State, t: float) -> None:
        """Start from the measured state."""
        self._reference = self._planner.start(state, self._gait, t)
        self._history.clear()

    def _foothold_at(self, foot: str, touchdown: float) -> npt.ArrayLike:
        return self._foothold(foot, touchdown, self)

    def _yaw_at(self, t: float) -> float:
        return self._path_at(t)[1]

    def _stance_at(self, t: float) -> tuple[str, ...]:
        gait = self._ref.gait
        swinging = {foot for foot in gait.feet if gait.swing_at(foot, t)}
        return tuple(name for name in self._all_contacts.names if name not in swinging)

    def _stance_controller(self) -> WholeBodyController:
        """The controller of the present stance, made when it is first needed."""
        stance = self._ref.stance
        if stance not in self._controllers:
            arguments: dict[str, Any] = {
                "max_normal_force": self._normal_force_bounds(stance),
                "on_infeasible": "soften",  # torques and friction may not hold the feet
                **self._options,
            }
            self._controllers[stance] = WholeBodyController(
                self.robot, self._all_contacts.only(*stance), self._tasks(stance), **arguments
            )
        return self._controllers[stance]

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
        for foot in [name for name in self._all_contacts.names if name not in stance]:
            position, rotation = (
                partial(target, foot) for target in (self._foot_target, self._foot_rotation_target)
            )
            tasks.append(FrameTask(foot, position, kp=swing, weight=swing_weight))
            if foot in self._planner.flat_feet:
                tasks.append(OrientationTask(foot, rotation, kp=swing, weight=swing_weight))
        return tasks

    def _foot_target(self, foot: str, t: float) -> Motion:
        return self._ref.foot_target(foot, t)

    def _foot_rotation_target(self, foot: str, t: float) -> Motion:
        return self._ref.foot_rotation_target(foot, t)

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
            / len(self._single_contacts[foot].point_names)
        )
        minimum = float(self._limits.normal_forces(self._single_contacts[foot], t)[0].max())
        return max(minimum, self._ref.normal_force_bound(foot, t, self.ramp, full_load))

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles begin anew: controllers are made again, and nothing is remembered."""
        return {
            key: value
            for key, value in vars(self).items()
            if key not in ("_controllers", "_reference", "_history")
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
