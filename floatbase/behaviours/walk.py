"""`Walk`: a walking controller.

`Walk` plans footholds and a linear inverted pendulum at each change of stance, and follows the plan
with the whole-body controller, eqs. (26), (27).
"""

from __future__ import annotations

import warnings
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
from floatbase.behaviours.speed import speed_fractions
from floatbase.behaviours.swing import Swing
from floatbase.control import Command, JointLimits, WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.errors import InputError, SimulationWarning
from floatbase.objectives import CoMTask, FrameTask, OrientationTask, PostureTask, Task
from floatbase.robots import Robot, State

Foothold: TypeAlias = Callable[[str, float, "Walk"], npt.ArrayLike]
_RESTART_GAP = 0.2  # s without a call, after which another controller may have moved the robot
_DEFAULT_REACH, _DEFAULT_REACH_FLAT = 0.2, 0.3  # m
_RAMP_LOAD_FACTOR = 2.0  # times its share of the weight: the normal force at which a ramp begins
# per rad/s²: the weight of a task. A knee that touches its stop is better than a fall: of 24
# pushes of 200 to 300 N, go2 survives 24 with this weight, 22 with 200 and 13 with 10 000
_JOINT_LIMIT_WEIGHT = 10.0
_MAX_SPEED = 10.0  # m/s and rad/s: a larger number must be in another unit
_HISTORY_LENGTH = 500  # changes of stance that are kept: two minutes of a trot, 4 MB


class Walk:
    """A controller that walks with a given gait and velocity.

    A `Walk` can be used like any other controller in `fb.rollout`, `LiveSimulation`, `fb.sweep` and
    `fb.push_recovery`. At each change of stance, the controller reads the positions of the feet,
    and plans the next footholds (`neutral_point`) and the motion of the centre of mass (`LIPM`)
    from its present position. In each control step it shifts the ends of the swings by
    `step_adjustment`, as far as the legs reach. One `WholeBodyController` for each stance does the
    rest. If no contact forces can hold the feet, their contacts become soft.

    If the time jumps back, or forward by more than 0.2 s, the controller starts again from
    the measured state. A controller that wraps it needs an attribute `contacts` with the present
    value of `Walk.contacts`.

    Parameters
    ----------
    robot : Robot
        The robot; its feet are point feet or flat feet.
    contacts : Contacts
        All contacts of the robot, such as `Contacts.feet(robot)`.
    gait : Gait
        The contact schedule; at least one foot must stand at any time. The gait can be set while
        walking: feet no longer lift off according to the former gait, and the new gait begins once
        all feet stand, without its earlier lift-offs. The new gait begins up to 0.8 s later if the
        weight must first shift to the feet that stand at its first lift-off.
    velocity : array_like, shape (2,), optional
        Desired velocity of the body, forwards and to the left [m/s]. The velocity can be set while
        walking, and is approached at 1 m/s². If the legs are too short for its steps, a
        `SimulationWarning` says so, and the robot walks at the fraction `speed_fraction` of the
        desired velocity. In its first period, a slow gait may be slower. At (0, 0) the robot
        marches on the spot; to make it stand, set `walk.gait = dataclasses.replace(walk.gait,
        stop=walk.time)`.
    yaw_rate : float, optional
        Desired yaw rate, to the left [rad/s]. The yaw rate can be set while walking, and is
        approached at 1 rad/s². It is limited together with the velocity.
    clearance : float, optional
        Height of the swings [m].
    reach : float, optional
        Largest distance of a foothold from the nominal one below the body [m]; by default 0.2, or
        0.3 with flat feet.
    ramp : float, optional
        Time in which a foot is unloaded before lift-off, and loaded after touchdown, if all feet
        stand meanwhile [s]. The option `max_normal_force` replaces the ramps.
    foothold : callable, optional
        Called as foothold(foot, touchdown, walk) with the time of touchdown [s]. It returns the
        foothold before adjustments, shape (2,), in the world frame [m]. The default is
        `raibert_foothold`.
    gains : Gains, optional
        Gains of the tasks; by default `Gains.for_contacts(contacts)`.
    **options : object
        Further options of `fb.WholeBodyController`, such as `facets`.

    Raises
    ------
    InputError
        If an argument is out of range, or if an option is unknown.

    Notes
    -----
    Footholds follow [Raibert1986]_; the adjustment of steps uses the divergent component of motion
    [Englsberger2015]_.

    Examples
    --------
    >>> import floatbase as fb
    >>> from floatbase.behaviours import Gait, Walk
    >>> robot = fb.load("go2")
    >>> walk = Walk(robot, fb.Contacts.feet(robot), Gait.trot(robot), velocity=(0.3, 0.0))
    >>> walk
    Walk(go2, 4 feet, 0.3 and 0 m/s)
    """

    __setattr__ = refuse_new_attributes
    _waits_for_weight = True  # whether a new gait begins later if the weight must first shift

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
        ).limits  # reports wrong options now
        self._options, self._standing_state = options, robot.standing()
        self._single_contacts = {contact.name: Contacts([contact]) for contact in contacts}
        self._planner = Planner(contacts, self._standing_state, self._clearance, self._reach)
        self._clear()
        self._limit_speed(stacklevel=3)

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @property
    def clearance(self) -> float:
        """Height of the swings [m]."""
        return self._clearance

    @property
    def reach(self) -> float:
        """Largest distance of a foothold from the nominal one below the body [m]."""
        return self._reach

    @property
    def ramp(self) -> float:
        """Time in which a foot is unloaded or loaded [s]."""
        return self._ramp

    @property
    def foothold(self) -> Foothold:
        """Function that returns the foothold of a foot."""
        return self._foothold

    @property
    def gains(self) -> Gains:
        """Gains of the tasks."""
        return self._gains

    @property
    def omega(self) -> float:
        """Natural frequency of the pendulum [1/s]."""
        return self._planner.omega

    @property
    def history(self) -> deque[StepPlan]:
        """Plans of the last 500 changes of stance."""
        return self._history

    @property
    def gait(self) -> Gait:
        """The contact schedule that was set last."""
        return self._gait

    @gait.setter
    def gait(self, gait: Gait) -> None:
        check_gait_feet(as_instance("gait", gait, Gait, "Gait.trot(robot)"), self._all_contacts)
        if len(gait.feet) == len(self._all_contacts):
            check_always_supported(gait)
        self._gait = gait
        self._limit_speed(stacklevel=3)

    @property
    def velocity(self) -> Array:
        """Desired velocity, forwards and to the left, shape (2,) [m/s]."""
        return self._velocity

    @velocity.setter
    def velocity(self, velocity: npt.ArrayLike) -> None:
        velocity = as_array("velocity", velocity, (2,), "m/s")
        as_number("speed", float(np.linalg.norm(velocity)), "m/s", maximum=_MAX_SPEED)
        self._velocity = velocity
        self._limit_speed(stacklevel=3)

    @property
    def yaw_rate(self) -> float:
        """Desired yaw rate, to the left [rad/s]."""
        return self._yaw_rate

    @yaw_rate.setter
    def yaw_rate(self, yaw_rate: float) -> None:
        self._yaw_rate = as_number("yaw_rate", yaw_rate, "rad/s", -_MAX_SPEED, _MAX_SPEED)
        self._limit_speed(stacklevel=3)

    @property
    def speed_fraction(self) -> float:
        """Fraction of the desired velocity and yaw rate at which the robot walks, at most 1."""
        return self._speed_fraction

    @property
    def time(self) -> float | None:
        """Time of the last control step [s]; None before the first."""
        return self._ref.time if self._reference else None

    @property
    def stance(self) -> tuple[str, ...]:
        """Names of the feet that stand now."""
        return self._ref.stance if self._reference else self._all_contacts.names

    @property
    def contacts(self) -> Contacts:
        """Contacts of the present stance."""
        controller = self._controllers.get(self.stance)
        return self._all_contacts if controller is None else controller.contacts

    @property
    def footholds(self) -> dict[str, Array]:
        """Foothold of each foot in the air or next to lift off, shape (3,), world frame [m]."""
        ends = {foot: path.end for foot, path in self.swings.items()}
        return self._ref.footholds | ends if self._reference else {}

    @property
    def swings(self) -> dict[str, Swing]:
        """Paths of the feet in the air."""
        if self._reference is None:
            return {}
        return {foot: each.path for foot, each in self._reference.swinging.items()}

    @property
    def plan(self) -> LIPM | None:
        """Plan of the centre of mass's horizontal motion; None before the first control step."""
        return self._ref.plan if self._reference else None

    def nominal_foothold(self, foot: str, t: float) -> Array:
        """Return where a foot would stand below the body, if the desired velocity does not change.

        Parameters
        ----------
        foot : str
            Name of the foot.
        t : float
            The time [s].

        Returns
        -------
        ndarray, shape (2,)
            Position of the foot's frame in the world frame [m].
        """
        foot = self._all_contacts[foot].name  # an `UnknownNameError` lists the names
        position, yaw, _ = self._path_at(as_number("t", t, "s"))
        return position + rotated_by_yaw(self._planner.nominal_feet[foot][:2], yaw)

    def velocity_at(self, t: float) -> Array:
        """Predict the body's velocity, if the desired velocity does not change.

        Parameters
        ----------
        t : float
            The time [s].

        Returns
        -------
        ndarray, shape (2,)
            Velocity in the world frame [m/s].
        """
        _, yaw, velocity = self._path_at(as_number("t", t, "s"))
        return rotated_by_yaw(velocity[:2], yaw)

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """Compute the command of one control step.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Configuration.
        v : array_like, shape (nv,)
            Velocity.
        t : float, optional
            The time [s].

        Returns
        -------
        Command
            Joint torques, with the planned accelerations and contact forces.
        """
        state, t = State(self.robot, q, as_array("v", v, (self.robot.nv,))), as_number("t", t, "s")
        if not self._continues(t):
            self._initialize(state, t)
        ref = self._ref
        self._update_gait(state, t)
        (ref.position, ref.yaw, ref.velocity), ref.time = self._path_at(t), t
        stance = self._stance_at(t)
        if stance != ref.stance or t >= ref.replan_time:
            plan = self._planner.replan(ref, state, stance, self._foothold_at, self._yaw_at)
            self._history.append(plan)
        self._planner.adjust_footholds(ref, state)
        return self._stance_controller()(q, v, t)

    @property
    def _ref(self) -> Reference:
        """Reference, which exists from the first control step on."""
        if self._reference is None:
            raise InputError(
                "A Walk has no path before its first control step. Call walk(q, v, t) first, as a "
                "rollout does."
            )
        return self._reference

    def _continues(self, t: float) -> bool:
        """Return whether a time [s] follows the last control step, so that the walk continues."""
        ref = self._reference
        return (
            ref is not None
            and t > ref.start_time
            and ref.time - TIME_TOLERANCE <= t <= ref.time + _RESTART_GAP
        )

    def _clear(self) -> None:
        """Discard the controllers, the reference and the history."""
        self._controllers: dict[tuple[str, ...], WholeBodyController] = {}
        self._reference = None
        self._history: deque[StepPlan] = deque(maxlen=_HISTORY_LENGTH)

    def _limit_speed(self, stacklevel: int) -> None:
        """Update `speed_fraction`, and warn if the feet cannot follow the desired motion."""
        if "_planner" not in vars(self):  # the constructor is still checking its arguments
            return
        self._first_fraction, self._speed_fraction = speed_fractions(
            self._gait,
            self._standing_state,
            self._planner.nominal_feet,
            self._planner.flat_feet,
            self._reach,
            np.array([*self._velocity, self._yaw_rate]),
        )
        if self._speed_fraction < 1.0:
            x, y = self._speed_fraction * self._velocity
            warnings.warn(
                f"{self.robot.name} cannot make steps that are long enough for {self!r}. It walks "
                f"at {x:.3g} and {y:.3g} m/s, and turns at "
                f"{self._speed_fraction * self._yaw_rate:.3g} rad/s. Use a gait with a shorter "
                f"period than {self._gait.period:g} s.",
                SimulationWarning,
                stacklevel=stacklevel,
            )

    def _path_at(self, t: float) -> tuple[Array, float, Array]:
        """Return position, yaw and velocity of the path at t [s].

        The path does not move before the first lift-off or after the last touchdown.
        """
        ref, begin = self._ref, max(self._ref.time, self._ref.gait.start)
        walking = ref.swinging or any(ref.gait.next_swing(foot, begin) for foot in ref.gait.feet)
        first = t < ref.gait.start + ref.gait.period
        return ref.predict(
            (self._first_fraction if first else self._speed_fraction)
            * np.array([*self.velocity, self.yaw_rate])
            if walking
            else np.zeros(3),
            begin,
            t,
        )

    def _update_gait(self, state: State, t: float) -> None:
        """Change to a newly requested gait once all feet stand.

        Feet that are in the air come down as planned.
        """
        ref = self._ref
        if ref.requested_gait is not None and vars(self._gait) == vars(ref.requested_gait):
            return
        if not ref.swinging:
            gait = self._gait.starting_at(t)
            if self._waits_for_weight and (delay := self._planner.weight_shift(gait, state, t)):
                gait = replace(gait, start=gait.start + delay)
            ref.requested_gait, ref.gait, ref.replan_time = self._gait, gait, t
        elif ref.gait.stop is None or ref.gait.stop > t:
            ref.requested_gait, ref.gait = None, replace(ref.gait, stop=t)

    def _initialize(self, state: State, t: float) -> None:
        """Start from the measured state."""
        self._reference = self._planner.start(state, self._gait, t)
        self._history.clear()

    def _foothold_at(self, foot: str, touchdown: float) -> npt.ArrayLike:
        """Return the foothold of a foot, (2,) [m], that lands at a time [s]."""
        return self._foothold(foot, touchdown, self)

    def _yaw_at(self, t: float) -> float:
        """Return the path's yaw [rad] at t [s]."""
        return self._path_at(t)[1]

    def _stance_at(self, t: float) -> tuple[str, ...]:
        """Return the contacts that stand at t [s]."""
        gait = self._ref.gait
        swinging = {foot for foot in gait.feet if gait.swing_at(foot, t)}
        return tuple(name for name in self._all_contacts.names if name not in swinging)

    def _stance_controller(self) -> WholeBodyController:
        """Return the controller of the present stance, which is made when first needed."""
        stance = self._ref.stance
        if stance not in self._controllers:
            arguments: dict[str, Any] = {
                "max_normal_force": self._normal_force_bounds(stance),
                "on_infeasible": "soften",  # torques and friction may be unable to hold the feet
                "joint_limits": JointLimits.of(self.robot, weight=_JOINT_LIMIT_WEIGHT),
                **self._options,
            }
            self._controllers[stance] = WholeBodyController(
                self.robot, self._all_contacts.only(*stance), self._tasks(stance), **arguments
            )
        return self._controllers[stance]

    def _tasks(self, stance: Sequence[str]) -> list[Task]:
        """Return the tasks of a stance, with targets that follow the reference."""
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
        """Return the target position of a foot at t [s]."""
        return self._ref.foot_target(foot, t)

    def _foot_rotation_target(self, foot: str, t: float) -> Motion:
        """Return the target rotation of a flat foot at t [s]."""
        return self._ref.foot_rotation_target(foot, t)

    def _normal_force_bounds(
        self, stance: Sequence[str]
    ) -> dict[str, Callable[[float], float]] | None:
        """Return ramps for the normal force of each point if all feet stand, otherwise None."""
        if self.ramp == 0.0 or len(stance) < len(self._all_contacts) or len(stance) < 2:
            return None
        return {foot: partial(self._normal_force_bound, foot) for foot in self._all_contacts.names}

    def _normal_force_bound(self, foot: str, t: float) -> float:
        """Return the upper bound of the normal force of each point of a foot at t [s], in N."""
        full_load = (
            _RAMP_LOAD_FACTOR
            * self.robot.weight
            / len(self._all_contacts)
            / len(self._single_contacts[foot].point_names)
        )
        minimum = float(self._limits.normal_forces(self._single_contacts[foot], t)[0].max())
        return max(minimum, self._ref.normal_force_bound(foot, t, self.ramp, full_load))

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without controllers and memory, so that a copy starts anew."""
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
    """Compute the default foothold of a `Walk`: the neutral point of the foot on the body's path.

    Parameters
    ----------
    foot : str
        Name of the foot.
    touchdown : float
        Time at which the foot lands [s].
    walk : Walk
        The walk.

    Returns
    -------
    ndarray, shape (2,)
        Foothold in the world frame [m].

    Notes
    -----
    The rule is from [Raibert1986]_.
    """
    gait = walk.gait
    return neutral_point(
        walk.nominal_foothold(foot, touchdown),
        walk.velocity_at(touchdown),
        gait.period - gait.swing,
    )
