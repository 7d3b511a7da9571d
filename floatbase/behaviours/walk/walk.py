"""`Walk`: a walking controller.

`Walk` plans footholds and a linear inverted pendulum at each change of stance, and follows the plan
with the whole-body controller, eqs. (26), (27).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import cos, inf, sin
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, as_instance, as_number, refuse_new_attributes
from floatbase.behaviours.terrain import Terrain
from floatbase.behaviours.walk.active_plan import ActivePlan
from floatbase.behaviours.walk.footholds import raibert_foothold
from floatbase.behaviours.walk.gait import Gait
from floatbase.behaviours.walk.gait_limits import check_friction, motion_message, speed_fractions
from floatbase.behaviours.walk.lipm import CoMPlan
from floatbase.behaviours.walk.options import (
    Gains,
    WalkOptions,
    as_gait,
    as_vector,
    as_velocity,
    as_yaw_rate,
    check_options,
)
from floatbase.behaviours.walk.path import DesiredMotion, Path
from floatbase.behaviours.walk.plan import (
    StepPlan,
    first_footing,
    first_path,
    make_plan,
    next_footing,
    weight_shift,
)
from floatbase.behaviours.walk.posture import WalkingPosture
from floatbase.behaviours.walk.progress import GaitClock, Progress
from floatbase.behaviours.walk.stance_controllers import StanceControllers
from floatbase.behaviours.walk.swing import SwingPath
from floatbase.behaviours.walk.targets import Adjustment, BodyPose
from floatbase.control import Command, WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.errors import InputError, SimulationWarning, warn
from floatbase.objectives import Task
from floatbase.robots import Robot, State

Foothold: TypeAlias = Callable[[str, float, "Walk"], npt.ArrayLike]
Entries: TypeAlias = Mapping[str, slice]  # of each task in the array of all targets
_LEAN_FRACTION = 0.5  # of the slope, by which the goal of the lean moves at a change of stance


class Walk:
    """A controller that walks with a given gait and velocity.

    A `Walk` can be used like any other controller in `fb.rollout`, `LiveSimulation`, `fb.sweep` and
    `fb.push_recovery`. At each change of stance, the controller reads the positions of the feet,
    and plans the next footholds (`neutral_point`) and the motion of the centre of mass (`LIPM`)
    from its present position. In each control step it shifts the ends of the swings by
    `step_adjustment`, as far as the legs reach. One `WholeBodyController` for each stance does the
    rest. If no contact forces can hold the feet, their contacts become soft. Legs that cannot keep
    a sole flat, for example without an ankle roll joint, get `contact_weight=10.0`, so that a sole
    can roll on its edge.

    Between two changes of stance, a walk is a few arrays, and one compiled function writes all
    targets of a control step. With a user-defined adjustment, swings of another class than
    `Swing`, or a plan of another class than `LIPM`, slower functions do that.

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
        walking, and is approached at the largest `acceleration`. If the legs are too short for its
        steps, a `SimulationWarning` says so, and the robot walks at the fraction `speed_fraction`
        of the desired velocity. In its first period, a slow gait may be slower. At (0, 0) the robot
        marches on the spot; to make it stand, set `walk.gait = dataclasses.replace(walk.gait,
        stop=walk.time)`.
    yaw_rate : float, optional
        Desired yaw rate, to the left [rad/s]. The yaw rate can be set while walking, and is
        approached at the largest `acceleration`. It is limited together with the velocity.
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
        foothold before adjustments, in the world frame [m]: x and y, shape (2,), or the position of
        the foot's frame, shape (3,). The default is `raibert_foothold`.
    adjustment : callable, optional
        Called in each control step as adjustment(plan, path, com, com_velocity, t) with the
        `StepPlan`, the body's present path, centre of mass and its velocity, shape (3,). It returns
        a mapping from feet in the air to the places where they land, shape (2,) or (3,), in the
        world frame [m]; the other feet keep their footholds. The default, `step_adjustment`,
        shifts footholds by the error of the capture point.
    modify_plan : callable, optional
        Called as modify_plan(plan, state) with each new `StepPlan` and the measured state. It
        returns the plan to use, such as `dataclasses.replace(plan, plan=...)` with another
        trajectory of the centre of mass (`CoMPlan`), and perhaps an earlier `replan_time`.
    swing : callable, optional
        Called as swing(start, end, lift_off, touchdown, clearance) when a foot lifts off. It
        returns the path of the foot, such as a `Swing`, which is the default.
    ground : Terrain, optional
        The ground, if the walk knows it: an object with the methods height(xy) and normal(xy), such
        as `fb.Ground`. Footholds then lie on it and keep clear of its edges, swings clear its
        steps, soles follow its normal, and the body of a robot with more than two feet leans with
        the slope below the feet. Without it, the ground is the plane through the feet.
    tasks : sequence of Task, optional
        Further tasks, for example for a hand.
    height : float, optional
        Change of the height of the centre of mass [m]. It can be set while walking.
    pitch : float, optional
        Pitch of the base relative to the standing posture, nose down if positive [rad]. It can be
        set while walking.
    acceleration : (float, float), optional
        Largest acceleration of the path's velocity [m/s²] and yaw rate [rad/s²]. Robots fall if
        the velocity jumps.
    gains : Gains, optional
        Gains of the tasks; by default `Gains.for_contacts(contacts)`.
    **options : object
        Further options of `fb.WholeBodyController`, such as `facets`.

    Raises
    ------
    InputError
        If an argument is out of range.
    UnknownArgumentError
        If an option is unknown.

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
    waits_for_weight = True
    """Whether a new gait begins later if the weight must first shift."""
    may_fly = False
    """Whether all feet may be in the air at the same time."""
    # attributes that copies do not share
    _made_anew = frozenset({"_posture", "_controllers", "_centroid", "_progress"})
    _force_weight: float | None = None  # 1/N², of a task on the contact forces

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
        adjustment: Adjustment | None = None,
        modify_plan: Callable[[StepPlan, State], StepPlan] | None = None,
        swing: Callable[..., SwingPath] | None = None,
        ground: Terrain | None = None,
        tasks: Sequence[Task] = (),
        height: float = 0.0,
        pitch: float = 0.0,
        acceleration: tuple[float, float] = (1.0, 1.0),
        gains: Gains | None = None,
        **options: Any,
    ):
        self._robot = as_instance("robot", robot, Robot)
        self._all_contacts = as_instance("contacts", contacts, Contacts)
        self._gait = as_gait(gait, self._all_contacts, self.may_fly)
        self._velocity = as_velocity(velocity)
        self._yaw_rate = as_yaw_rate(yaw_rate)
        self._pose = BodyPose.checked(height, pitch)
        check_options(type(self), options)
        self._options = WalkOptions.checked(
            self._all_contacts,
            clearance=clearance,
            reach=reach,
            ramp=ramp,
            foothold=raibert_foothold if foothold is None else foothold,
            adjustment=adjustment,
            modify_plan=modify_plan,
            swing=swing,
            ground=ground,
            tasks=tasks,
            acceleration=acceleration,
            gains=gains,
            controller=options,
        )
        self._clear()
        self._prepare(self._gait)
        self._limit_speed()

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @property
    def options(self) -> WalkOptions:
        """Options that do not change, such as `options.reach`."""
        return self._options

    @property
    def omega(self) -> float:
        """Natural frequency of the pendulum [1/s]."""
        return self._posture.omega

    @property
    def history(self) -> deque[StepPlan]:
        """Plans of the last 500 changes of stance."""
        return self._progress.history

    @property
    def gait(self) -> Gait:
        """The contact schedule that was set last."""
        return self._gait

    @gait.setter
    def gait(self, gait: Gait) -> None:
        as_gait(gait, self._all_contacts, self.may_fly)
        self._prepare(gait)
        self._gait = gait
        self._limit_speed()

    @property
    def velocity(self) -> Array:
        """Desired velocity, forwards and to the left, shape (2,) [m/s]."""
        return self._velocity

    @velocity.setter
    def velocity(self, velocity: npt.ArrayLike) -> None:
        self._velocity = as_velocity(velocity)
        self._limit_speed()

    @property
    def yaw_rate(self) -> float:
        """Desired yaw rate, to the left [rad/s]."""
        return self._yaw_rate

    @yaw_rate.setter
    def yaw_rate(self, yaw_rate: float) -> None:
        self._yaw_rate = as_yaw_rate(yaw_rate)
        self._limit_speed()

    @property
    def height(self) -> float:
        """Change of the height of the centre of mass [m]."""
        return self._pose.height

    @height.setter
    def height(self, height: float) -> None:
        self._pose = BodyPose.checked(height, self._pose.pitch)
        self._refresh()

    @property
    def pitch(self) -> float:
        """Pitch of the base relative to the standing posture, nose down if positive [rad]."""
        return self._pose.pitch

    @pitch.setter
    def pitch(self, pitch: float) -> None:
        self._pose = BodyPose.checked(self._pose.height, pitch)
        self._refresh()

    @property
    def speed_fraction(self) -> float:
        """Fraction of the desired velocity and yaw rate at which the robot walks, at most 1."""
        return self._speeds[1]

    @property
    def time(self) -> float | None:
        """Time of the last control step [s]; None before the first."""
        active = self._progress.active
        return active.path.time if active else None

    @property
    def stance(self) -> tuple[str, ...]:
        """Names of the feet that stand now."""
        active = self._progress.active
        return active.plan.stance if active else self._all_contacts.names

    @property
    def contacts(self) -> Contacts:
        """Contacts of the present stance."""
        started = self._progress.active is not None
        return self._controllers[self.stance].contacts if started else self._all_contacts

    @property
    def controllers(self) -> Mapping[tuple[str, ...], WholeBodyController]:
        """The controllers made so far, by the names of the feet that stand."""
        return self._controllers.by_feet

    @property
    def footholds(self) -> dict[str, Array]:
        """Foothold of each foot in the air or next to lift off, shape (3,), world frame [m]."""
        active, ends = self._progress.active, {foot: path.end for foot, path in self.swings.items()}
        return {**active.plan.footholds, **ends} if active else {}

    @property
    def swings(self) -> dict[str, SwingPath]:
        """Paths of the feet in the air."""
        active = self._progress.active
        return active.swings if active else {}

    @property
    def plan(self) -> CoMPlan | None:
        """Plan of the centre of mass's horizontal motion; None before the first control step."""
        active = self._progress.active
        return active.plan.plan if active else None

    @property
    def path(self) -> Path:
        """Path of the body at the last control step, or at the time that is being planned.

        Raises
        ------
        InputError
            Before the first control step.
        """
        progress = self._progress
        path = progress.planning_path or (progress.active.path if progress.active else None)
        if path is None:
            raise InputError(
                "A Walk has no path before its first control step. Call walk(q, v, t) first, as a "
                "rollout does."
            )
        return path

    def path_at(self, t: float) -> Path:
        """Predict the path of the body, if the desired velocity does not change.

        Parameters
        ----------
        t : float
            The time [s].

        Returns
        -------
        Path
            Position, yaw and velocity at that time.
        """
        return self.path.moved(self._progress.desired, as_number("t", t, "s"))

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
        return self.path_at(t).point(self._posture.nominal_feet[foot][:2])

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """Follow the plan for one control step. Plan anew first if the stance changes.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Measured configuration.
        v : array_like, shape (nv,)
            Measured velocity.
        t : float, optional
            The time [s].

        Returns
        -------
        Command
            Joint torques of the present stance's controller, with the planned accelerations and
            contact forces.
        """
        robot = self._robot
        t = as_number("t", t, "s")
        q, v = as_vector("q", q, robot.nq), as_vector("v", v, robot.nv)
        if self._progress.continues(t):
            self.select_gait(q, v, t)
        else:
            self.restart()
            self._forget_plan()
        progress = self._progress
        if (
            progress.active is None
            or not progress.clock.follows(self._gait)
            or t >= progress.next_change
        ):
            self._change(State(robot, q, v), t)
        active = progress.active
        assert active is not None
        data, com, com_velocity = self._centroid
        pin.centerOfMass(robot.model, data, q, v, False)
        controller = self._controllers[active.plan.stance]
        targets = controller.targets_at(t)
        active.write(t, com, com_velocity, targets)
        self._adjust_targets(q, v, t, active, controller.targets, targets)
        progress.time = t
        return controller(q, v, t, targets)

    def restart(self) -> None:
        """Let the next control step start from the measured state.

        `Walk` calls this method by itself if the time jumps. Derived classes may extend it.
        """
        self._progress.time = -inf

    def select_gait(self, q: Array, v: Array, t: float) -> None:
        """Choose the gait before a control step; derived classes may set `gait` here.

        `Walk` itself does nothing here.

        Parameters
        ----------
        q : ndarray, shape (nq,)
            Configuration.
        v : ndarray, shape (nv,)
            Velocity.
        t : float
            The time [s].
        """

    def _clear(self) -> None:
        """Make everything that a copy makes anew."""
        self._posture = WalkingPosture(self._all_contacts, self._robot.standing())
        self._controllers = StanceControllers(self._posture, self._options, self._force_weight)
        data = self._robot.model.createData()
        self._centroid = data, data.com[0], data.vcom[0]  # views, overwritten in each step
        self._forget_plan()
        self.restart()

    def _forget_plan(self) -> None:
        """Discard the plan and the history."""
        self._progress = Progress()

    def _prepare(self, gait: Gait) -> None:
        """Check the friction that a gait needs, and make the controllers of its stances."""
        limits = self._controllers.limits
        facets, inner = limits.facets, limits.inner_approximation
        if not self.may_fly:
            check_friction(gait, self._posture, self._all_contacts, facets, inner)
        self._controllers.prepare(gait)

    def _limit_speed(self) -> None:
        """Update `speed_fraction`, and warn if the feet cannot follow the desired motion."""
        motion = np.array([*self._velocity, self._yaw_rate])
        # fractions in the first period, and later
        self._speeds = speed_fractions(
            self._gait, self._posture, self._options.reach, motion, self._options.acceleration[0]
        )
        message = motion_message(self, self._gait, self._posture.state, self.speed_fraction)
        if message:
            warn(message, SimulationWarning)
        self._refresh()

    def _refresh(self) -> None:
        """Apply a new desired motion or pose to the plan in use."""
        progress, active = self._progress, self._progress.active
        if active is not None:
            swinging, time = bool(active.plan.planned_swings), active.path.time
            progress.desired = self._desired_motion(swinging, time)
            progress.active = active.changed(progress.desired, self._leaning_pose)

    def _desired_motion(self, swinging: bool, t: float) -> DesiredMotion:
        """Return the motion that the path approaches from t [s] on.

        The path does not move before the first lift-off or after the last touchdown.
        """
        clock, motion = self._progress.clock, np.array([*self._velocity, self._yaw_rate])
        gait = clock.gait
        if not (swinging or clock.lifts_later(t)):
            motion = np.zeros(3)
        first, later = (fraction * motion for fraction in self._speeds)
        first_until = gait.start + gait.period
        return DesiredMotion(first, later, first_until, gait.start, self._options.acceleration)

    def _change(self, state: State, t: float) -> None:
        """Start, or change stance or gait, if it is time to do so."""
        progress, posture, names = self._progress, self._posture, self._all_contacts.names
        active = progress.active
        if active is None:
            progress.start_time = t
            progress.clock = GaitClock(self._gait, t)
            stance = progress.clock.stance(names, t)
            path, footing = first_path(posture, state, t), first_footing(posture, state)
            swings: dict[str, SwingPath] = {}
        else:
            swinging = bool(active.plan.planned_swings)
            delay = partial(weight_shift, posture, state, t) if self.waits_for_weight else None
            new_gait = progress.clock.update(self._gait, swinging, t, delay)
            progress.desired = self._desired_motion(swinging, active.path.time)
            stance, swings = progress.clock.stance(names, t), active.swings
            if not new_gait and stance == active.plan.stance and t < active.plan.replan_time:
                self._refresh()
                progress.next_change = progress.clock.next_change(t, active.plan.replan_time)
                return
            footing, shift = next_footing(active.plan, swings, state, stance, t)
            path = active.path.moved(progress.desired, t)
            path = replace(path, position=path.position + shift)
            swings = {foot: swing for foot, swing in swings.items() if foot not in stance}
        progress.planning_path = path
        progress.desired = self._desired_motion(bool(swings), t)
        try:
            plan = make_plan(
                posture, self._options, state, path, progress.clock.gait, stance, footing,
                lambda foot, touchdown: self._options.foothold(foot, touchdown, self),
                lambda time: self.path_at(time).yaw,
                active.plan if active else None,
                swings,
            )  # fmt: skip
        finally:
            progress.planning_path = None
        plan = self._modified(plan, state)
        progress.history.append(plan)
        self._update_lean(plan)
        self._controllers.plan = plan
        controller = self._controllers[stance]
        progress.active = ActivePlan(
            posture, plan, progress.desired, self._leaning_pose, self._options.reach,
            controller.targets, self._options.adjustment, controller.compiled is not None,
        )  # fmt: skip
        progress.next_change = progress.clock.next_change(t, plan.replan_time)

    def _modified(self, plan: StepPlan, state: State) -> StepPlan:
        """Return the plan to use instead of a new plan at the measured state."""
        if self._options.modify_plan is None:
            return plan
        changed = self._options.modify_plan(plan, state)
        return as_instance("the result of modify_plan", changed, StepPlan)

    def _adjust_targets(
        self, q: Array, v: Array, t: float, active: ActivePlan, entries: Entries, targets: Array
    ) -> None:
        """Change the targets of one control step; entries: those of each task. `MPC` does so."""

    @property
    def _leaning_pose(self) -> BodyPose:
        """The requested height and pitch, with the lean of the body on a known ground."""
        return replace(self._pose, lean=self._progress.lean)

    def _update_lean(self, plan: StepPlan) -> None:
        """Turn the body towards the slope below the feet, if the ground is known.

        On stairs, the legs of a long body that stays level become too short. A body on two feet
        stays upright.
        """
        if self._options.ground is None or len(self._posture.nominal_feet) <= 2:
            return
        heading = np.array([cos(plan.path.yaw), sin(plan.path.yaw)])
        uphill = float(np.arctan(plan.ground.slope @ heading))
        lean = self._progress.lean
        goal = lean.goal + _LEAN_FRACTION * (-uphill - lean.goal)
        self._progress.lean = lean.towards(goal, plan.time)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without controllers and memory, so that a copy starts anew."""
        return {key: value for key, value in vars(self).items() if key not in self._made_anew}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._clear()

    def __repr__(self) -> str:
        forwards, left = self.velocity
        return (
            f"{type(self).__name__}({self.robot.name}, {len(self.gait.feet)} feet, "
            f"{forwards:g} and {left:g} m/s)"
        )
