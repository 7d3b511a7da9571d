"""App. B: two plain models of an actuator that is late, a pure delay and a first-order lag, to
compare with the oil.
"""

from __future__ import annotations

from collections import deque

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_array, as_instance, as_positive, read_only
from floatbase.robots import Robot

# s: times are counted in whole nanoseconds, so that no rounding adds up from step to step
_TIME_UNIT = 1e-9
_MAX_TIME = 10.0  # s, of a delay and of a step: longer is a slip of units


class Delay:
    """App. B: torques that arrive late, τ(t) = τ_d(t - T), and are else as desired. Usable as
    `actuators` in `rollout`.

    robot: as from `fb.load`.
    delay: s, T, counted in whole nanoseconds; 0 hands the torques on.
    """

    def __init__(self, robot: Robot, delay: float):
        self.robot = as_instance("robot", robot, Robot)
        self.delay = as_positive("delay", delay, "s", allow_zero=True, maximum=_MAX_TIME)
        self.reset()

    def reset(
        self, tau: npt.ArrayLike | None = None, q_joints: npt.ArrayLike | None = None
    ) -> None:
        """Let the torques under way be tau, shape (d,), N·m, zero by default.

        q_joints: (d,) rad, not used: this actuator asks for no angles, but is called as the
            hydraulic ones are.
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
        """The torques that arrive in the next dt s, shape (d,), N·m: their mean where they change
        meanwhile.

        tau_desired: (d,) N·m, from now on, for dt s.
        q_joints, v_joints: (d,) rad and rad/s, not used.
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
    """App. B: torques that follow as a first-order lag does, τ̇ = ω (τ_d - τ). Usable as
    `actuators` in `rollout`.

    robot: as from `fb.load`.
    bandwidth: Hz, ω / 2π, where the torque's amplitude has fallen by 3 dB. After a step of τ_d, 63
        % have come after 1/ω.
    `tau` is the present torque, (d,) N·m.
    """

    def __init__(self, robot: Robot, bandwidth: float):
        self.robot = as_instance("robot", robot, Robot)
        self.bandwidth = as_positive("bandwidth", bandwidth, "Hz")
        self.reset()

    def reset(
        self, tau: npt.ArrayLike | None = None, q_joints: npt.ArrayLike | None = None
    ) -> None:
        """Let the present torques be tau, shape (d,), N·m, zero by default.

        q_joints: (d,) rad, not used: this actuator asks for no angles, but is called as the
            hydraulic ones are.
        """
        self.tau = _checked_reset(self.robot, tau, q_joints)

    def step(
        self,
        tau_desired: npt.ArrayLike,
        q_joints: npt.ArrayLike,
        v_joints: npt.ArrayLike,
        dt: float,
    ) -> Array:
        """Let dt s pass, exactly for a τ_d that stays; the torques at their end, shape (d,), N·m.

        tau_desired: (d,) N·m.
        q_joints, v_joints: (d,) rad and rad/s, not used.
        """
        desired = _checked_desired(self.robot, tau_desired, q_joints, v_joints)
        time = as_positive("dt", dt, "s", maximum=_MAX_TIME)
        fraction = -np.expm1(-2.0 * np.pi * self.bandwidth * time)
        self.tau = read_only(self.tau + fraction * (desired - self.tau))
        return self.tau


def _time_units(dt: float) -> int:
    """A step's time in whole nanoseconds, at least one."""
    return max(1, round(as_positive("dt", dt, "s", maximum=_MAX_TIME) / _TIME_UNIT))


def _checked_reset(
    robot: Robot, tau: npt.ArrayLike | None, q_joints: npt.ArrayLike | None
) -> Array:
    """What a reset is given, looked at: torques, zero by default."""
    if q_joints is not None:
        as_array("q_joints", q_joints, (robot.d,), "rad")
    return read_only(as_array("tau", np.zeros(robot.d) if tau is None else tau, (robot.d,), "N·m"))


def _checked_desired(
    robot: Robot, tau_desired: npt.ArrayLike, q_joints: npt.ArrayLike, v_joints: npt.ArrayLike
) -> Array:
    """What a step is given, looked at: the desired torques."""
    as_array("q_joints", q_joints, (robot.d,), "rad")
    as_array("v_joints", v_joints, (robot.d,), "rad/s")
    return read_only(as_array("tau_desired", tau_desired, (robot.d,), "N·m"))
