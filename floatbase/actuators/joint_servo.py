"""`JointServo`: the motor driver between the whole-body controller and the joints."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_instance,
    as_positive,
    checked,
    one_or_each,
    short_repr,
)
from floatbase.errors import InputError
from floatbase.robots import Robot
from floatbase.robots._checks import as_torque_limits

_MAX_TIME = 10.0  # s, longest step: a longer one indicates a wrong unit


def _as_gains(name: str, value: npt.ArrayLike, d: int | None = None) -> Array:
    """Return one gain for all joints, or one for each, checked."""
    gains = one_or_each(name, value, d, ())
    as_positive(name, float(gains.min(initial=np.inf)), allow_zero=True, maximum=np.inf)
    return gains


@dataclass(frozen=True, eq=False)
class JointTargets(Value):
    """What motor drivers receive: positions, velocities, gains and feedforward torques.

    Parameters
    ----------
    position : ndarray, shape (d,)
        Desired joint positions [rad or m].
    velocity : ndarray, shape (d,)
        Desired joint velocities [rad/s or m/s].
    stiffness : float or array_like, shape (d,)
        Stiffness [N·m/rad or N/m].
    damping : float or array_like, shape (d,)
        Damping [N·m·s/rad or N·s/m].
    torque : ndarray, shape (d,)
        Feedforward torques [N·m].
    """

    position: Array = field(metadata=checked(as_array, (None,), "rad"))
    velocity: Array = field(metadata=checked(as_array, (None,), "rad/s"))
    stiffness: Array = field(metadata=checked(_as_gains))
    damping: Array = field(metadata=checked(_as_gains))
    torque: Array = field(metadata=checked(as_array, (None,), "N·m"))

    def torques(self, q_joints: Array, v_joints: Array) -> Array:
        """Return the torques of the driver, before its limits.

        Parameters
        ----------
        q_joints : ndarray, shape (d,)
            Measured joint positions [rad or m].
        v_joints : ndarray, shape (d,)
            Measured joint velocities [rad/s or m/s].

        Returns
        -------
        ndarray, shape (d,)
            torque + stiffness · (position - q_joints) + damping · (velocity - v_joints) [N·m].
        """
        spring = self.stiffness * (self.position - q_joints)
        torques: Array = self.torque + spring + self.damping * (self.velocity - v_joints)
        return torques


class JointServo:
    """Motor drivers that follow the controller's plan; usable as `actuators` in `rollout`.

    The controller computes torques and accelerations at a low rate, such as 200 Hz. The drivers run
    at a high rate, such as 1 kHz. Between two control steps, the servo integrates the planned
    accelerations to desired joint positions and velocities. Each driver adds a spring and a damper
    to the feedforward torque: τ = τ_ff + stiffness · (q_d - q) + damping · (q̇_d - q̇).

    Parameters
    ----------
    robot : Robot
        Robot, as returned by `fb.load`.
    stiffness : float or array_like, shape (d,)
        Stiffness of all drivers, or of each [N·m/rad or N/m].
    damping : float or array_like, shape (d,)
        Damping of all drivers, or of each [N·m·s/rad or N·s/m].
    leak : float, optional
        Rate at which the desired positions and velocities return to the measured ones [1/s].
        With 0, they never do.
    torque_limits : float or array_like, shape (d,), optional
        Torque limits of the drivers [N·m]. The default is those of the robot.

    Notes
    -----
    The targets integrate the plan. They do not begin at the measured state in each control step.
    Such targets would differ from the measurement only by the motion planned for a few
    milliseconds, and the spring would do almost nothing. Integrated over seconds, the plan acts as
    integral feedback. An unknown load makes the base sink, so the plan accelerates the base
    upwards, and the targets rise until the springs carry the load.

    The leak bounds this integral and removes the effect of impacts, which no plan contains. The
    targets are limited as well, so that neither the spring nor the damper alone exceeds the torque
    limit.

    Examples
    --------
    >>> import floatbase as fb
    >>> from floatbase.actuators import JointServo
    >>> robot = fb.load("go2")
    >>> contacts, tasks = fb.Contacts.feet(robot), fb.standing_tasks(robot.standing())
    >>> controller = fb.WholeBodyController(robot, contacts, tasks)
    >>> servo, sim = JointServo(robot, stiffness=40.0, damping=1.0), fb.Simulation(robot)
    >>> fb.rollout(sim, controller, 0.1, control_period=0.005, actuators=servo).outcome
    'completed'
    """

    def __init__(
        self,
        robot: Robot,
        stiffness: npt.ArrayLike,
        damping: npt.ArrayLike,
        leak: float = 5.0,
        torque_limits: npt.ArrayLike | None = None,
    ):
        self.robot = as_instance("robot", robot, Robot)
        self.stiffness = _as_gains("stiffness", stiffness, robot.d)
        self.damping = _as_gains("damping", damping, robot.d)
        self.leak = as_positive("leak", leak, "1/s", allow_zero=True)
        limits = robot.torque_limits if torque_limits is None else torque_limits
        self.torque_limits = as_torque_limits(robot.d, limits)
        with np.errstate(divide="ignore"):  # without a gain there is no limit
            self._max_lag = self.torque_limits / self.stiffness
            self._max_speed_error = self.torque_limits / self.damping
        self.reset()

    def reset(self) -> None:
        """Forget the plan; the targets begin anew at the next measured positions."""
        self._plan: tuple[Array, Array] | None = None  # torques and joint accelerations
        self._desired: tuple[Array, Array] | None = None  # positions and velocities

    def receive(self, command: Any) -> None:
        """Store the plan of a control step.

        `rollout` calls this method after each control step.

        Parameters
        ----------
        command : Command
            Command of the controller, with torques `tau` and accelerations `qdd`.

        Raises
        ------
        InputError
            If the command has no accelerations.
        """
        if getattr(command, "qdd", None) is None:
            raise InputError(
                f"A JointServo needs planned accelerations, but {short_repr(command)} has no "
                f"attribute qdd. Use a WholeBodyController or a Walk."
            )
        self._plan = command.tau, command.qdd[self.robot.nv - self.robot.d :]

    def targets(self, q_joints: Array, v_joints: Array, dt: float) -> JointTargets:
        """Integrate the plan over a time step, and return what to send to the motor drivers.

        Parameters
        ----------
        q_joints : ndarray, shape (d,)
            Measured joint positions [rad or m].
        v_joints : ndarray, shape (d,)
            Measured joint velocities [rad/s or m/s].
        dt : float
            Length of the step [s].

        Returns
        -------
        JointTargets
            Targets of the drivers until the next step.

        Raises
        ------
        InputError
            If no plan has been received, or if an argument is invalid.
        """
        if self._plan is None:
            raise InputError(
                "The servo has no plan. Call servo.receive(command) after each control step."
            )
        dt = as_positive("dt", dt, "s", maximum=_MAX_TIME)
        q_joints = as_array("q_joints", q_joints, (self.robot.d,), "rad")
        v_joints = as_array("v_joints", v_joints, (self.robot.d,), "rad/s")
        torque, acceleration = self._plan
        position, velocity = self._desired or (q_joints, v_joints)
        lag = position + dt * velocity + 0.5 * dt**2 * acceleration - q_joints
        speed_error = velocity + dt * acceleration - v_joints
        kept = np.exp(-self.leak * dt)
        lag = np.clip(kept * lag, -self._max_lag, self._max_lag)
        speed_error = np.clip(kept * speed_error, -self._max_speed_error, self._max_speed_error)
        targets = JointTargets(
            q_joints + lag, v_joints + speed_error, self.stiffness, self.damping, torque
        )
        self._desired = targets.position, targets.velocity
        return targets

    def step(self, tau_desired: Array, q_joints: Array, v_joints: Array, dt: float) -> Array:
        """Advance by a time step and return the torques of the drivers, within their limits.

        Parameters
        ----------
        tau_desired : ndarray, shape (d,)
            Feedforward torques, as in the plan [N·m].
        q_joints : ndarray, shape (d,)
            Measured joint positions [rad or m].
        v_joints : ndarray, shape (d,)
            Measured joint velocities [rad/s or m/s].
        dt : float
            Length of the step [s].

        Returns
        -------
        ndarray, shape (d,)
            Torques [N·m].
        """
        torques = self.targets(q_joints, v_joints, dt).torques(q_joints, v_joints)
        return np.clip(torques, -self.torque_limits, self.torque_limits)
