"""`Jump`: crouch, push off, fly without contacts, and land on soft contacts."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from math import cos, e, pi, sqrt
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._geometry import bump, minimum_jerk
from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_instance,
    as_number,
    as_positive,
    checked,
    refuse_new_attributes,
)
from floatbase.behaviours._level_place import foot_outline
from floatbase.behaviours.terrain import Terrain, as_terrain
from floatbase.behaviours.walk.gait_limits import leg_joints
from floatbase.behaviours.walk.options import as_vector, check_options, flat_foot_names
from floatbase.control import Command, WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.objectives import CoMTask, FrameTask, OrientationTask, PostureTask, Task
from floatbase.robots import Robot, State

Phase: TypeAlias = Literal["stand", "crouch", "push", "flight", "landing"]

# fractions of the height of the centre of mass above the feet
_CROUCH, _TUCK = 0.3, 0.15
_MIN_HEIGHT, _MAX_SIZE = 0.02, 10.0  # m: a larger number must be in another unit
_CROUCH_TIME = 0.4  # s, slow enough to keep the feet on the ground
_BODY_WEIGHT = 1e2  # of the tasks on the body
_SOFT_CONTACTS = 1e4  # 1/(m/s²)²: the feet do not land at the same time
_TOUCH_HEIGHT = 2e-3  # m above a known ground, below which a foot has landed
# m/s: if the centre of mass falls more slowly by this much than in free fall, a foot has landed
_TOUCH_SPEED = 0.1
_MAX_UNEVENNESS = 0.02  # m between the heights of the ground where the feet land
_DRY_RUN_STEP = 2e-3  # s, the usual control period
_MIN_FRACTION = 0.95  # of the take-off velocity that a dry run must reach


@dataclass(frozen=True, eq=False)
class JumpPlan(Value):
    """Times and velocities of a jump.

    Parameters
    ----------
    crouch, push, take_off : float
        Times at which the phases begin [s].
    apex : float
        Time at which the centre of mass is highest [s].
    touchdown : float
        Time at which the feet are planned to land [s].
    depth : float
        How far the centre of mass is below its standing height before the push [m]. At take-off, it
        is at its standing height.
    velocity : ndarray, shape (2,)
        Velocity of the centre of mass at take-off, forwards and upwards [m/s].
    acceleration : ndarray, shape (2,)
        Its acceleration during the push, forwards and upwards [m/s²].
    lead : float
        How far the feet land in front of the centre of mass, so that it comes to rest [m].
    """

    crouch: float = field(metadata=checked(as_number, "s"))
    push: float = field(metadata=checked(as_number, "s"))
    take_off: float = field(metadata=checked(as_number, "s"))
    apex: float = field(metadata=checked(as_number, "s"))
    touchdown: float = field(metadata=checked(as_number, "s"))
    depth: float = field(metadata=checked(as_positive, "m"))
    velocity: Array = field(metadata=checked(as_array, (2,), "m/s"))
    acceleration: Array = field(metadata=checked(as_array, (2,), "m/s²"))
    lead: float = field(metadata=checked(as_number, "m"))

    @staticmethod
    def of(
        height: float, distance: float, start: float, leg: float, gravity: float, rise: float = 0.0
    ) -> JumpPlan:
        """Plan a jump in closed form.

        With the take-off velocity (v_x, v_z) and the depth d of the crouch, from which the robot
        pushes off at constant acceleration,

            (J1)  v_z = √(2 g height),  flight T = v_z / g + √(2 (height - rise) / g)
            (J2)  push t = 2 d / v_z,     a = (v_x, v_z) / t
            (J3)  distance = v_x (t / 2 + T + 1 / ω),  lead = v_x / ω

        where v_x / ω is the capture point of a pendulum of the height `leg`: there the feet land.

        Parameters
        ----------
        height : float
            Rise of the centre of mass above its standing height [m].
        distance : float
            Distance of the landing place [m].
        start : float
            Beginning of the crouch [s].
        leg : float
            Height of the centre of mass above the feet [m].
        gravity : float
            Gravitational acceleration [m/s²].
        rise : float, optional
            How much higher the ground is at the landing place than at the start [m]. It must be
            less than `height`.

        Returns
        -------
        JumpPlan
            The plan.

        Raises
        ------
        InputError
            If an argument is out of range.
        """
        height = as_number("height", height, "m", _MIN_HEIGHT, _MAX_SIZE)
        distance = as_number("distance", distance, "m", -_MAX_SIZE, _MAX_SIZE)
        start = as_positive("start", start, "s", allow_zero=True)
        leg, gravity = as_positive("leg", leg, "m"), as_positive("gravity", gravity, "m/s²")
        if height - as_number("rise", rise, "m") < _MIN_HEIGHT:
            raise InputError(
                f"height is {height:g} m, but the ground at the landing place is {rise:.3g} m "
                f"higher than at the start. The height must exceed this rise by at least "
                f"{_MIN_HEIGHT:g} m."
            )
        depth, upwards = _CROUCH * leg, sqrt(2.0 * gravity * height)  # (J1)
        ascent, push = upwards / gravity, 2.0 * depth / upwards  # (J2)
        flight = ascent + sqrt(2.0 * (height - rise) / gravity)
        lead_time = sqrt(leg / gravity)  # 1 / ω
        forwards = distance / (push / 2.0 + flight + lead_time)  # (J3)
        velocity = np.array([forwards, upwards])
        begin = start + _CROUCH_TIME
        return JumpPlan(
            start, begin, begin + push, begin + push + ascent, begin + push + flight, depth,
            velocity, velocity / push, forwards * lead_time,
        )  # fmt: skip

    def com_offset(self, t: float) -> tuple[Array, Array, Array]:
        """Return the planned motion of the centre of mass before take-off, relative to standing.

        Parameters
        ----------
        t : float
            Time, until the take-off [s].

        Returns
        -------
        position, velocity, acceleration : ndarray, shape (2,)
            Forwards and upwards [m, m/s, m/s²].

        Raises
        ------
        InputError
            If t is not a number.
        """
        t = as_number("t", t, "s")
        if t < self.push:
            u = (t - self.crouch) / (self.push - self.crouch)
            down = np.array([0.0, -self.depth])
            s, rate, acceleration = minimum_jerk(u)
            T = self.push - self.crouch
            return s * down, rate / T * down, acceleration / T**2 * down
        s, a = min(t, self.take_off) - self.push, self.acceleration
        return np.array([0.0, -self.depth]) + a * s * s / 2.0, a * s, a


class Jump:
    """A controller that jumps once: it stands, crouches, pushes off, flies, lands and stands again.

    The jump is planned in closed form, for a push at constant acceleration. In flight, there are no
    contacts, and the feet move relative to the centre of mass to the place where they land. After
    the landing, the contacts are soft, because the feet do not land at the same time.

    The robot jumps in the direction of x from its standing posture at the origin. With a known
    `ground`, it lands when a foot reaches the height of this ground. Otherwise, it lands when the
    centre of mass falls more slowly than in free fall. So it also lands on ground that is higher or
    lower than expected, but a push upwards counts as a landing, too. The way to the landing place
    is not checked: a foot may hit an edge on the way.

    Before it accepts a jump, the controller integrates the push with the equations of motion,
    without a simulator and without torque limits. It refuses a jump for which a motor is too weak
    or too slow.

    If the time jumps back, the controller begins again.

    Parameters
    ----------
    robot : Robot
        The robot.
    contacts : Contacts
        All contacts of the robot, such as `Contacts.feet(robot)`.
    height : float
        Rise of the centre of mass above its standing height [m].
    distance : float, optional
        Distance of the landing place from the start, forwards [m].
    start : float, optional
        Time at which the robot begins to crouch [s].
    ground : Terrain, optional
        The ground, if the controller knows it, such as `fb.Ground`. The jump then ends at the
        height of the ground where the feet land. Without `ground`, level ground is assumed.
    **options : object
        Further options of `fb.WholeBodyController`, such as `facets`.

    Raises
    ------
    InputError
        If an argument is out of range, if the feet would land at different heights, if the
        friction is too low for the distance, or if a motor is too weak or too slow for the jump.
        The message gives the number and the limit.

    Examples
    --------
    >>> import floatbase as fb
    >>> from floatbase.behaviours import Jump
    >>> robot = fb.load("go2")
    >>> jump = Jump(robot, fb.Contacts.feet(robot), height=0.2)
    >>> round(float(jump.plan.velocity[1]), 2)
    1.98
    """

    __setattr__ = refuse_new_attributes
    _phase: Phase
    _time: float  # s, of the last control step
    _acceleration: Array  # q̈ then
    _com: Array  # at take-off or touchdown
    _com_velocity: Array

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        height: float,
        distance: float = 0.0,
        *,
        start: float = 0.5,
        ground: Terrain | None = None,
        **options: Any,
    ):
        self._robot = as_instance("robot", robot, Robot)
        self._all_contacts = as_instance("contacts", contacts, Contacts)
        check_options(type(self), options)
        if not contacts.names:
            raise InputError("contacts must have at least one foot, because a jump pushes off.")
        self._standing = standing = robot.standing()
        self._ground, self._options = as_terrain("ground", ground), options
        self._distance = as_number("distance", distance, "m", -_MAX_SIZE, _MAX_SIZE)
        centre = contacts.positions(standing).mean(axis=0)
        leg = float(standing.com[2] - centre[2])
        self._plan = JumpPlan.of(height, distance, start, leg, robot.gravity, self._rise())
        self._leg, self._com_offset = leg, standing.com - [*centre[:2], 0.0]
        self._height = float(height)
        model = robot.model
        legs = [j for foot in contacts.names for j in leg_joints(robot, foot)]
        self._legs = np.array(model.idx_qs)[legs], np.array(model.idx_vs)[legs]
        self._posture = np.array(standing.q), np.zeros(robot.d), np.zeros(robot.d)
        self._restart()
        self._stand = self._controller(contacts, **{"on_infeasible": "soften", **options})
        self._fly = self._controller(contacts.only(), **options)
        self._land = self._controller(contacts, **{"contact_weight": _SOFT_CONTACTS, **options})
        self._dry_run()
        self._restart()

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @property
    def plan(self) -> JumpPlan:
        """Times and velocities of the jump."""
        return self._plan

    @property
    def phase(self) -> Phase:
        """Present phase."""
        return self._phase

    @property
    def contacts(self) -> Contacts:
        """Contacts of the present phase."""
        return self._all_contacts.only() if self._phase == "flight" else self._all_contacts

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """Change the phase if it is time, and compute the torques of the present phase.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Measured configuration.
        v : array_like, shape (nv,)
            Measured velocity.
        t : float, optional
            The time [s]. A time before that of the last call starts the jump again.

        Returns
        -------
        Command
            Joint torques, planned accelerations and contact forces. In flight there are no contact
            forces.
        """
        t = as_number("t", t, "s")
        if t < self._time:
            self._restart()
        self._time = t
        q, v = as_vector("q", q, self._robot.nq), as_vector("v", v, self._robot.nv)
        self._update(q, v, t)
        self._observe(q, v)
        controller = {"flight": self._fly, "landing": self._land}.get(self._phase, self._stand)
        command = controller(q, v, t)
        self._acceleration = command.qdd
        return command

    def _restart(self) -> None:
        """Begin again."""
        self._phase = "stand"
        self._time, self._acceleration = -np.inf, np.zeros(self._robot.nv)
        self._com = self._com_velocity = np.zeros(3)
        self._since, self._goal = 0.0, self._standing.com
        self._apex: tuple[float, Array] | None = None  # time and velocity of the centre of mass

    def _observe(self, q: Array, v: Array) -> None:
        """Let the posture task follow the measured legs, so that it does not brake them.

        Their last accelerations are targets, too: if the task reduced them, the arms would swing.
        """
        in_q, in_v = self._legs
        position, velocity, acceleration = self._posture
        joints = in_v - (self._robot.nv - self._robot.d)
        position[in_q], velocity[joints] = q[in_q], v[in_v]
        acceleration[joints] = self._acceleration[in_v]

    def _update(self, q: Array, v: Array, t: float) -> None:
        """Change the phase if it is time to do so."""
        plan = self._plan
        if self._phase in ("stand", "crouch", "push"):
            if t >= plan.take_off:
                self._begin("flight", State(self._robot, q, v), t)
            elif t >= plan.crouch:
                self._phase = "push" if t >= plan.push else "crouch"
        elif self._phase == "flight" and t >= plan.apex:
            state = State(self._robot, q, v)
            if self._apex is None:
                self._apex = t, state.com_velocity
            level = self._touched(state, t)
            if level is not None:
                self._begin("landing", state, t)
                feet = self._all_contacts.positions(state).mean(axis=0)
                self._goal = np.array([*feet[:2], level]) + self._com_offset

    def _touched(self, state: State, t: float) -> float | None:
        """Return how much higher the ground is than at the start, or None in flight [m].

        With a known ground, only the height of the feet above it counts.
        """
        contacts = self._all_contacts
        points = contacts.positions(state)
        levels = points[:, 2] - contacts.positions(self._standing)[:, 2]
        if self._ground is not None:
            grounds = [self._ground_level(point[:2]) for point in points]
            lowest = int(np.argmin(levels - grounds))
            return grounds[lowest] if levels[lowest] - grounds[lowest] < _TOUCH_HEIGHT else None
        assert self._apex is not None
        since, velocity = self._apex
        # a push from the side is no landing
        upwards = (state.com_velocity - velocity)[2] + self._robot.gravity * (t - since)
        return float(levels.min()) if upwards > _TOUCH_SPEED else None

    def _ground_level(self, xy: Array) -> float:
        """Return the height of a known ground above the ground below the standing robot [m]."""
        assert self._ground is not None
        start = self._all_contacts.positions(self._standing)[:, :2].mean(axis=0)
        return float(self._ground.height(xy)) - float(self._ground.height(start))

    def _rise(self) -> float:
        """Return how much higher the ground is at the landing place than at the start [m]."""
        if self._ground is None:
            return 0.0
        levels = []
        for name in self._all_contacts.names:
            landing = self._standing.point(name)[:2] + [self._distance, 0.0]
            outline = foot_outline(self._robot.foot(name), 0.0)
            levels += [self._ground_level(landing + around) for around in outline]
        if max(levels) - min(levels) > _MAX_UNEVENNESS:
            raise InputError(
                f"With a distance of {self._distance:g} m, the feet would land at different "
                f"heights. The ground there is {min(levels):.3g} to {max(levels):.3g} m higher "
                f"than at the start. Use another distance."
            )
        return float(np.mean(levels))

    def _begin(self, phase: Phase, state: State, t: float) -> None:
        """Begin a phase in a measured state."""
        self._phase, self._since = phase, t
        self._com, self._com_velocity = state.com, state.com_velocity

    def _posture_target(self, t: float) -> tuple[Array, Array, Array]:
        """Return the target of the posture task, which `_observe` sets."""
        return self._posture

    def _com_target(self, t: float) -> tuple[Array, Array, Array]:
        """Return the target of the centre of mass at t [s]."""
        if self._phase != "landing":
            planned = [np.array([part[0], 0.0, part[1]]) for part in self._plan.com_offset(t)]
            return self._standing.com + planned[0], planned[1], planned[2]
        # critical damping: after a fall to the same height, the body sinks by v / (e rate), as far
        # as in the crouch
        pendulum = sqrt(self._robot.gravity / self._leg)
        rate = max(self._plan.velocity[1] / (e * self._plan.depth), pendulum)
        s, offset = t - self._since, self._com - self._goal
        slope, decay = self._com_velocity + rate * offset, np.exp(-rate * s)
        position = decay * (offset + slope * s)
        velocity = decay * slope - rate * position
        acceleration = -rate * decay * slope - rate * velocity
        return self._goal + position, velocity, acceleration

    def _foot_target(self, foot: str, t: float) -> tuple[Array, Array, Array]:
        """Return the target of a foot in flight, which moves with the falling centre of mass."""
        plan, standing, gravity = self._plan, self._standing, self._robot.gravity
        s, T = max(t - self._since, 0.0), plan.touchdown - plan.take_off
        u = min(s / T, 1.0)
        (fraction, rate, bend), (rise, rise_rate, rise_bend) = minimum_jerk(u), bump(u)
        fall = np.array([0.0, 0.0, -gravity])
        last = standing.point(foot) - standing.com + [plan.lead, 0.0, 0.0]
        first = last - [plan.lead + self._plan.com_offset(plan.take_off)[0][0], 0.0, 0.0]
        tuck = np.array([0.0, 0.0, _TUCK * self._leg])
        change = last - first
        return (
            self._com + self._com_velocity * s + fall * s * s / 2.0
            + first + fraction * change + rise * tuck,
            self._com_velocity + fall * s + rate / T * change + rise_rate / T * tuck,
            fall + bend / T**2 * change + rise_bend / T**2 * tuck,
        )  # fmt: skip

    def _controller(self, contacts: Contacts, **options: Any) -> WholeBodyController:
        """Return the controller of a phase."""
        standing = self._standing
        rotation, weight = standing.frame_pose("base").rotation, _BODY_WEIGHT
        tasks: list[Task] = [
            PostureTask(self._posture_target, weight=1e-2),
            OrientationTask("base", rotation, kp=200.0, weight=weight if len(contacts) else 1.0),
        ]
        if len(contacts):
            tasks.append(CoMTask(self._com_target, kp=150.0, weight=_BODY_WEIGHT))
        else:
            for foot in self._all_contacts.names:
                tasks.append(FrameTask(foot, partial(self._foot_target, foot), kp=600.0))
            for foot in sorted(flat_foot_names(self._all_contacts)):
                tasks.append(OrientationTask(foot, standing.frame_pose(foot).rotation, kp=600.0))
        return WholeBodyController(self._robot, contacts, tasks, **options)

    def _dry_run(self) -> None:
        """Raise `InputError` if a motor or the friction is not sufficient for the push."""
        robot, plan, gravity = self._robot, self._plan, self._robot.gravity
        what = f"A jump of {robot.name} with a height of {self._height:g} m"
        what += f" and a distance of {self._distance:g} m" if self._distance else ""
        unlimited = {"on_infeasible": "soften", "torque_limits": np.inf, "joint_limits": None}
        controller = self._controller(self._all_contacts, **{**self._options, **unlimited})
        facets = controller.limits.facets
        scale = cos(pi / facets) if controller.limits.inner_approximation else 1.0
        mu = scale * min(contact.mu for contact in self._all_contacts.friction_contacts)
        slope = abs(plan.acceleration[0]) / (gravity + plan.acceleration[1])
        if slope > mu:
            raise InputError(
                f"{what} needs a friction coefficient of {slope:.2f} in every direction, but the "
                f"contacts allow {mu:.2f}. Use a smaller distance."
            )
        q, h = np.array(self._standing.q), _DRY_RUN_STEP
        v: Array = np.zeros(robot.nv)
        joints, limits = slice(robot.nv - robot.d, None), self._stand.limits
        speeds = np.full(robot.d, np.inf)
        if limits.joint_limits is not None:
            speeds = limits.joint_limits.velocity
        needed, largest = np.zeros((2, robot.d)), np.array([limits.torque_limits, speeds])
        for t in np.arange(plan.crouch, plan.take_off, h):
            self._observe(q, v)
            command = controller(q, v, t)
            self._acceleration = command.qdd
            v = v + h * command.qdd
            q = pin.integrate(robot.model, q, h * v)
            needed = np.maximum(needed, [np.abs(command.tau), np.abs(v[joints])])
        kind, joint = np.unravel_index(np.argmax(needed / largest), needed.shape)
        if needed[kind, joint] > largest[kind, joint]:
            unit, quantity = (("N·m", "torque"), ("rad/s", "speed"))[kind]
            raise InputError(
                f"{what} needs a {quantity} of {needed[kind, joint]:.3g} {unit} in joint "
                f"{robot.joint_names[joint]}, but its limit is {largest[kind, joint]:.3g} {unit}. "
                f"Use a smaller height or distance."
            )
        reached = State(robot, q, v).com_velocity[2]
        if reached < _MIN_FRACTION * plan.velocity[1]:
            raise InputError(
                f"{what} needs a take-off velocity of {plan.velocity[1]:.2f} m/s, but the legs "
                f"reach only {reached:.2f} m/s. Use a smaller height."
            )
