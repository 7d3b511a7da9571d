"""Controllers that get a measured state: sensor noise, latency, or your own state estimator."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from floatbase._validation import (
    Array,
    Value,
    as_callable,
    as_instance,
    as_integer,
    as_positive,
    cached_property,
    checked,
    refuse_new_attributes,
    short_repr,
)
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.robots import Robot
from floatbase.simulation.rollout import Controller

_NANOSECOND = 1e-9  # s: times are compared in whole nanoseconds, because the clock is a sum
_MAX_LATENCY = 10.0  # s: a longer one indicates a wrong unit

Observer: TypeAlias = Callable[[Array, Array, float], tuple[Array, Array]]


class Observed:
    """A controller that gets an observed state instead of the true one.

    The wrapper goes wherever the controller goes: into `rollout`, `sweep`, `push_recovery` and
    `LiveSimulation`. Records contain the true state. Attributes of the controller that are not
    methods, such as `contacts` and `robot`, can be read from the wrapper; set them at
    `controller`.

    Parameters
    ----------
    controller : Controller
        The controller.
    *observers : callable
        Functions observe(q, v, t) -> (q, v), such as `SensorNoise`, `Latency` or your own state
        estimator. The first observer gets the true state, and each other one gets what the observer
        before it returns. An observer with a method `measure(tau, forces, acceleration)` also gets
        other measurements (see `measure`).

    Raises
    ------
    InputError
        If the controller or an observer cannot be called with q, v and t.

    Examples
    --------
    >>> import floatbase as fb
    >>> from floatbase.simulation import Latency, Observed, SensorNoise
    >>> robot = fb.load("go2")
    >>> tasks = fb.standing_tasks(robot.standing())
    >>> controller = fb.WholeBodyController(robot, fb.Contacts.feet(robot), tasks)
    >>> observed = Observed(controller, SensorNoise(robot, seed=1), Latency(q=0.005, v=0.005))
    >>> fb.rollout(fb.Simulation(robot), observed, 0.05).outcome
    'completed'
    """

    _example = "Observed(controller, SensorNoise(robot))"
    __setattr__ = refuse_new_attributes

    def __init__(self, controller: Controller, *observers: Observer):
        self._controller = as_callable("the controller", controller, "controller(q, v, t)")
        self._observers = tuple(
            as_callable(f"observer {i}", observe, "observe(q, v, t)")
            for i, observe in enumerate(observers)
        )

    @property
    def controller(self) -> Any:
        """The controller that gets the observed state."""
        return self._controller

    @property
    def observers(self) -> tuple[Observer, ...]:
        """The observers, in the order in which they are called."""
        return self._observers

    def measure(self, tau: Array, forces: Array, acceleration: Array) -> None:
        """Pass measurements to the observers and the controller that have a method `measure`.

        `rollout` calls this method before each control step.

        Parameters
        ----------
        tau : ndarray, shape (d,)
            Motor torques of the last timestep [N·m].
        forces : ndarray, shape (points, 3)
            Force of the last timestep on each point of `sim.point_names`, world frame [N].
        acceleration : ndarray, shape (3,)
            What an accelerometer in the base measured, in the base frame [m/s²]: the acceleration
            of the base's origin minus gravity, at the beginning of the last timestep. Before the
            first timestep, it is that of the robot without motor torques.
        """
        for part in (*self._observers, self._controller):
            measure = getattr(part, "measure", None)
            if measure is not None:
                measure(tau, forces, acceleration)

    def observe(self, q: Array, v: Array, t: float) -> tuple[Array, Array]:
        """Return the state that the controller gets.

        Parameters
        ----------
        q : ndarray, shape (nq,)
            True configuration.
        v : ndarray, shape (nv,)
            True velocity.
        t : float
            Time [s].

        Returns
        -------
        q : ndarray, shape (nq,)
            Observed configuration.
        v : ndarray, shape (nv,)
            Observed velocity.

        Raises
        ------
        InputError
            If an observer does not return a pair.
        """
        for observe in self._observers:
            observed = observe(q, v, t)
            if not isinstance(observed, tuple | list) or len(observed) != 2:
                raise InputError(
                    f"An observer must return the pair (q, v), but {short_repr(observe)} returned "
                    f"{short_repr(observed)}."
                )
            q, v = observed
        return q, v

    def __call__(self, q: Array, v: Array, t: float = 0.0) -> Any:
        """Return the controller's command for the observed state.

        Parameters
        ----------
        q : ndarray, shape (nq,)
            True configuration.
        v : ndarray, shape (nv,)
            True velocity.
        t : float, optional
            Time [s].

        Returns
        -------
        Command
            What the controller returns.
        """
        return self._controller(*self.observe(q, v, t), t)

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the controller that is not a method."""
        controller = vars(self).get("_controller")
        if name.startswith("_") or controller is None:
            raise AttributeError(name)
        value = getattr(controller, name)
        if callable(value) and not isinstance(value, Contacts | Robot):
            raise AttributeError(
                f"{name!r} is a method of the controller and would not get the observed state. "
                f"Call it as observed.controller.{name}."
            )
        return value


@dataclass(frozen=True, eq=False)
class SensorNoise(Value):
    """Sensor noise of a good IMU and of joint encoders, as an observer for `Observed`.

    White Gaussian noise is added to the state in each control step. The noise depends on the seed
    and on the time alone, so that every run with the same seed and control period gets the same
    noise. Keyword arguments are standard deviations of each component.

    Parameters
    ----------
    robot : Robot
        The robot.
    seed : int, optional
        Seed of the noise.
    base_position : float, optional
        Noise of the base's position [m].
    base_orientation : float, optional
        Noise of the base's orientation, a rotation vector in the base frame [rad].
    linear_velocity : float, optional
        Noise of the base's linear velocity [m/s].
    angular_velocity : float, optional
        Noise of the base's angular velocity [rad/s].
    joint_position : float, optional
        Noise of the joint positions [rad or m].
    joint_velocity : float, optional
        Noise of the joint velocities [rad/s or m/s].

    Notes
    -----
    The default values come from data of typical sensors:

    - Angular velocity: the gyroscope of an Xsens MTi-1 has a noise density of 0.007 °/s/√Hz and a
      bandwidth of 255 Hz, according to its data sheet. This gives 0.11 °/s, or 2 mrad/s.
    - Joint position: an encoder with 14 bits has steps of 0.38 mrad, and the standard deviation of
      its rounding error is the step divided by √12, or 0.11 mrad.
    - Joint velocity: the difference of two such positions 3 ms apart has a standard deviation of
      0.05 rad/s.
    - Base position, linear velocity and orientation are estimates. 1 mm and 0.02 m/s are what the
      joint noise causes through a leg of 0.3 m to 0.4 m plus the deformation of a rubber foot. 2
      mrad is the noise of a filtered tilt angle; the slow drift of such a filter is not included.
    """

    robot: Robot = field(metadata=checked(as_instance, Robot))
    seed: int = field(default=0, metadata=checked(as_integer, 0, 2**63))
    _: KW_ONLY
    base_position: float = field(default=1e-3, metadata=checked(as_positive, "m", allow_zero=True))
    base_orientation: float = field(
        default=2e-3, metadata=checked(as_positive, "rad", allow_zero=True)
    )
    linear_velocity: float = field(
        default=0.02, metadata=checked(as_positive, "m/s", allow_zero=True)
    )
    angular_velocity: float = field(
        default=2e-3, metadata=checked(as_positive, "rad/s", allow_zero=True)
    )
    joint_position: float = field(default=1.1e-4, metadata=checked(as_positive, allow_zero=True))
    joint_velocity: float = field(default=0.05, metadata=checked(as_positive, allow_zero=True))

    @cached_property
    def _deviations(self) -> tuple[Array, Array]:
        """Noise of the components of q, as a velocity, and of v: deviations, shape (nv,) each."""
        base = 3 if self.robot.is_floating else 0
        counts = [base, base, self.robot.d]
        positions = [self.base_position, self.base_orientation, self.joint_position]
        velocities = [self.linear_velocity, self.angular_velocity, self.joint_velocity]
        return np.repeat(positions, counts), np.repeat(velocities, counts)

    def scaled(self, factor: float) -> SensorNoise:
        """Return the noise with all standard deviations multiplied by a factor.

        Parameters
        ----------
        factor : float
            The factor, 0 or more [-].

        Returns
        -------
        SensorNoise
            The scaled noise with the same seed.
        """
        factor = as_positive("factor", factor, allow_zero=True)
        names = [deviation.name for deviation in fields(self) if deviation.kw_only]
        return replace(self, **{name: factor * getattr(self, name) for name in names})

    def __call__(self, q: Array, v: Array, t: float) -> tuple[Array, Array]:
        """Return the measured state.

        Parameters
        ----------
        q : ndarray, shape (nq,)
            True configuration.
        v : ndarray, shape (nv,)
            True velocity.
        t : float
            Time [s].

        Returns
        -------
        q : ndarray, shape (nq,)
            Measured configuration.
        v : ndarray, shape (nv,)
            Measured velocity.
        """
        generator = np.random.Philox(key=self.seed, counter=_nanoseconds(t) % 2**64)
        noise = np.random.Generator(generator).standard_normal(2 * self.robot.nv)
        of_q, of_v = self._deviations
        measured = pin.integrate(self.robot.model, q, of_q * noise[: self.robot.nv])
        return measured, v + of_v * noise[self.robot.nv :]


class Latency:
    """Measurements that arrive late, as an observer for `Observed`.

    At time t the controller gets the newest q measured at t - T or before, with its latency T, and
    likewise v. Before the first measurement has arrived, it gets the first one. When the clock goes
    back, as after `Simulation.reset`, the latency begins anew.

    Parameters
    ----------
    q : float, optional
        Latency of the configuration [s].
    v : float, optional
        Latency of the velocity [s].

    Raises
    ------
    InputError
        If a latency is negative or longer than 10 s.
    """

    def __init__(self, q: float = 0.0, v: float = 0.0):
        limits: dict[str, Any] = {"allow_zero": True, "maximum": _MAX_LATENCY}
        self._latencies = tuple(
            _nanoseconds(as_positive(name, latency, "s", **limits))
            for name, latency in (("q", q), ("v", v))
        )
        self._queues: tuple[deque[tuple[int, Array]], ...] = (deque(), deque())

    @property
    def q(self) -> float:
        """Latency of the configuration [s]."""
        return self._latencies[0] * _NANOSECOND

    @property
    def v(self) -> float:
        """Latency of the velocity [s]."""
        return self._latencies[1] * _NANOSECOND

    def __call__(self, q: Array, v: Array, t: float) -> tuple[Array, Array]:
        """Return the newest measurements that have arrived.

        Parameters
        ----------
        q : ndarray, shape (nq,)
            Present configuration.
        v : ndarray, shape (nv,)
            Present velocity.
        t : float
            Time [s].

        Returns
        -------
        q : ndarray, shape (nq,)
            Delayed configuration.
        v : ndarray, shape (nv,)
            Delayed velocity.
        """
        now = _nanoseconds(t)
        arrived = [
            _arrived(queue, now, latency, np.array(value))
            for queue, latency, value in zip(self._queues, self._latencies, (q, v), strict=True)
        ]
        return arrived[0], arrived[1]


def _arrived(queue: deque[tuple[int, Array]], now: int, latency: int, value: Array) -> Array:
    """Add a measurement to a queue and return the newest one that is at least `latency` old."""
    if queue and queue[-1][0] > now:  # the clock went back
        queue.clear()
    elif queue and queue[-1][0] == now:
        queue.pop()
    queue.append((now, value))
    while len(queue) > 1 and queue[1][0] <= now - latency:
        queue.popleft()
    return queue[0][1]


def _nanoseconds(t: float) -> int:
    """Return a time in whole nanoseconds."""
    return round(t / _NANOSECOND)
