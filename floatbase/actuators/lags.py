"""Two simple models of slow actuators, a pure delay and a first-order lag.

The models serve as a comparison for the hydraulic actuators. [FBR]_, App. B.
"""

from __future__ import annotations

from collections import deque

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_array, as_instance, as_positive, read_only
from floatbase.robots import Robot

# s: times are counted in whole nanoseconds, so that rounding errors do not accumulate
_TIME_UNIT = 1e-9
_MAX_TIME = 10.0  # s, longest delay and longest step: a longer one indicates a wrong unit


class Delay:
    """Actuators whose torques arrive late: τ(t) = τ_d(t - T); usable as `actuators` in `rollout`.

    Parameters
    ----------
    robot : Robot
        Robot, as returned by `fb.load`.
    delay : float
        Delay T, rounded to whole nanoseconds [s]. With 0, torques are passed on at once.

    Notes
    -----
    [FBR]_, App. B.
    """

    def __init__(self, robot: Robot, delay: float):
        self.robot = as_instance("robot", robot, Robot)
        self.delay = as_positive("delay", delay, "s", allow_zero=True, maximum=_MAX_TIME)
        self.reset()

    def reset(
        self, tau: npt.ArrayLike | None = None, q_joints: npt.ArrayLike | None = None
    ) -> None:
        """Set the torques that have been requested but have not arrived yet.

        Parameters
        ----------
        tau : array_like, shape (d,), optional
            Torques [N·m]; zero by default.
        q_joints : array_like, shape (d,), optional
            Joint angles [rad], not used; hydraulic actuators have the same parameter.
        """
        self._queue = deque(
            [(round(self.delay / _TIME_UNIT), _checked_reset(self.robot, tau, q_joints))]
        )

    def step(
        self,
        tau_desired: npt.ArrayLike,
        q_joints: npt.ArrayLike,
        v_joints: npt.ArrayLike,
        dt: float,
    ) -> Array:
        """Advance by a time step and return the torques that arrive during it.

        Parameters
        ----------
        tau_desired : array_like, shape (d,)
            Desired torques during the step [N·m].
        q_joints : array_like, shape (d,)
            Joint angles [rad], not used.
        v_joints : array_like, shape (d,)
            Joint velocities [rad/s], not used.
        dt : float
            Length of the step [s].

        Returns
        -------
        ndarray, shape (d,)
            Torques [N·m], averaged over the step if they change during it.
        """
        step = remaining = _time_units(dt)
        self._queue.append((step, _checked_desired(self.robot, tau_desired, q_joints, v_joints)))
        tau = np.zeros(self.robot.d)
        while remaining:
            length, arriving = self._queue.popleft()
            duration = min(length, remaining)
            tau += duration / step * arriving
            remaining -= duration
            if duration < length:
                self._queue.appendleft((length - duration, arriving))
        return tau


class FirstOrderLag:
    """Actuators whose torques follow as τ̇ = ω (τ_d - τ); usable as `actuators` in `rollout`.

    Parameters
    ----------
    robot : Robot
        Robot, as returned by `fb.load`.
    bandwidth : float
        Bandwidth ω / 2π, where the amplitude of the torque has dropped by 3 dB [Hz]. At a time 1/ω
        after a step of τ_d, the torque has completed 63 % of the change.

    Attributes
    ----------
    tau : ndarray, shape (d,)
        Present torques [N·m].

    Notes
    -----
    [FBR]_, App. B.
    """

    def __init__(self, robot: Robot, bandwidth: float):
        self.robot = as_instance("robot", robot, Robot)
        self.bandwidth = as_positive("bandwidth", bandwidth, "Hz")
        self.reset()

    def reset(
        self, tau: npt.ArrayLike | None = None, q_joints: npt.ArrayLike | None = None
    ) -> None:
        """Set the present torques.

        Parameters
        ----------
        tau : array_like, shape (d,), optional
            Torques [N·m]; zero by default.
        q_joints : array_like, shape (d,), optional
            Joint angles [rad], not used; hydraulic actuators have the same parameter.
        """
        self.tau = _checked_reset(self.robot, tau, q_joints)

    def step(
        self,
        tau_desired: npt.ArrayLike,
        q_joints: npt.ArrayLike,
        v_joints: npt.ArrayLike,
        dt: float,
    ) -> Array:
        """Advance by a time step and return the torques at its end, exact for a constant τ_d.

        Parameters
        ----------
        tau_desired : array_like, shape (d,)
            Desired torques during the step [N·m].
        q_joints : array_like, shape (d,)
            Joint angles [rad], not used.
        v_joints : array_like, shape (d,)
            Joint velocities [rad/s], not used.
        dt : float
            Length of the step [s].

        Returns
        -------
        ndarray, shape (d,)
            Torques at the end of the step [N·m].
        """
        desired = _checked_desired(self.robot, tau_desired, q_joints, v_joints)
        time = as_positive("dt", dt, "s", maximum=_MAX_TIME)
        fraction = -np.expm1(-2.0 * np.pi * self.bandwidth * time)
        self.tau = read_only(self.tau + fraction * (desired - self.tau))
        return self.tau


def _time_units(dt: float) -> int:
    """Return the length of a step in whole nanoseconds, at least one."""
    return max(1, round(as_positive("dt", dt, "s", maximum=_MAX_TIME) / _TIME_UNIT))


def _checked_reset(
    robot: Robot, tau: npt.ArrayLike | None, q_joints: npt.ArrayLike | None
) -> Array:
    """Check the arguments of a reset and return the torques, zero by default."""
    if q_joints is not None:
        as_array("q_joints", q_joints, (robot.d,), "rad")
    return read_only(as_array("tau", np.zeros(robot.d) if tau is None else tau, (robot.d,), "N·m"))


def _checked_desired(
    robot: Robot, tau_desired: npt.ArrayLike, q_joints: npt.ArrayLike, v_joints: npt.ArrayLike
) -> Array:
    """Check the arguments of a step and return the desired torques."""
    as_array("q_joints", q_joints, (robot.d,), "rad")
    as_array("v_joints", v_joints, (robot.d,), "rad/s")
    return read_only(as_array("tau_desired", tau_desired, (robot.d,), "N·m"))
