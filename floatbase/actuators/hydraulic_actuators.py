"""App. B: the force loop that drives the cylinders, so that one layer up the torque can be taken
for granted.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, Value, as_array, as_instance, as_positive, read_only
from floatbase.actuators.hydraulics import CylinderGeometry, Cylinders, Hydraulics
from floatbase.errors import InputError
from floatbase.robots import Robot

_MAX_STEP = 2e-4  # s, of the oil's integration: torques come out within 1 % of the limit at 0.2 ms
# s in one call: torques and velocities that stay the same for longer are a slip of units
_MAX_DURATION = 10.0
# of a step: 1 ms is 5 steps of 0.2 ms, whatever the last digit of the quotient
_STEP_ROUNDING = 1e-9
# of the loop's bandwidth: the integral's corner frequency; it costs the loop 3° of phase
_INTEGRAL_FRACTION = 0.05
# of the crank: a shorter lever asks for forces beyond all pressure, whatever the torque
_MIN_LEVER_FRACTION = 1e-9
_StateArrays = tuple[
    Array, Array, Array
]  # the parts of a `HydraulicState`, between the steps of the integration


@dataclass(frozen=True, eq=False)
class HydraulicState(Value):
    """What d cylinders and their loops remember.

    opening: (d,), of the valves, -1 to 1.
    pressures: (2, d) Pa over the air outside, chambers A and B.
    integral: (d,) N·s, the loops' sums of errors.
    """

    opening: Array
    pressures: Array
    integral: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            object.__setattr__(self, field.name, read_only(getattr(self, field.name)))


class HydraulicActuators:
    """App. B: a hydraulic cylinder on every joint of a robot, each with a force loop. Usable as
    `actuators` in `rollout`.

    The loop desires Ḟ = ω (e + ω_i ∫e dt) with e = F_desired - F, ω = 2π times the loop's bandwidth
    and ω_i a twentieth of it, and gives the valve the opening for it (`Cylinders.opening_for`); the
    integral rests while the valve is all open. The torque follows up to the loop's bandwidth, as
    long as that lies below the valve's.

    Sizes: each cylinder is HyQ's, scaled until the supply pressure gives the robot's torque limit
        at the lever's best angle
    and in the weaker direction, rod going in. Friction of the pistons is left out. A load that
    pulls the rod out fast starves chamber A: its oil boils, and torque is missing until the chamber
    is full again.

    robot: as from `fb.load`; hydraulics: the cylinder that is scaled, HyQ's by default;
        max_lever_angle: (d,) rad, the angles at which
    the levers are longest, those of `robot.standing()` by default. `state` is the present
    `HydraulicState`, `cylinders` the equations.
    Source of the loop: Boaventura et al., Model-based hydraulic impedance control for dynamic
    robots, IEEE T-RO 31, 2015. Raises `InputError` for a joint without a torque limit and for
    joints that slide.
    """

    def __init__(
        self,
        robot: Robot,
        hydraulics: Hydraulics | None = None,
        max_lever_angle: npt.ArrayLike | None = None,
    ):
        self.robot = as_instance("robot", robot, Robot)
        hydraulics = (
            Hydraulics()
            if hydraulics is None
            else as_instance("hydraulics", hydraulics, Hydraulics)
        )
        for joint, limit in zip(robot.joint_names, robot.torque_limits, strict=True):
            kind = robot.model.joints[robot.model.getJointId(joint)].shortname()
            if not kind.startswith("JointModelR"):
                raise InputError(
                    f"{joint} of {robot.name} slides ({kind}); hydraulic actuators here turn "
                    f"joints by a crank."
                )
            if not np.isfinite(limit):
                raise InputError(
                    f"{joint} of {robot.name} has no torque limit, so its cylinder has no scale: "
                    f'load the robot with one, fb.load("{robot.name}", torque_limits=…).'
                )
        if max_lever_angle is None:
            # the difference to the neutral configuration holds the joints' angles, where q has cos
            # and sin
            max_lever_angle = robot.standing().difference(robot.neutral().q)[robot.nv - robot.d :]
        self.cylinders = Cylinders(
            hydraulics, robot.torque_limits / hydraulics.weakest_torque, max_lever_angle
        )
        self.reset()

    def reset(
        self, tau: npt.ArrayLike | None = None, q_joints: npt.ArrayLike | None = None
    ) -> None:
        """Close the valves, with pressures that give torques tau, (d,) N·m, zero by default, as far
        as the supply goes.

        q_joints: (d,) rad, `Cylinders.max_lever_angle` by default. A robot that is to stand from
            the start needs the torques it stands with.
        The integrals begin empty: torques are off, by what leaks, until they have learned how much
        that is.
        """
        cylinders = self.cylinders
        tau = as_array("tau", np.zeros(cylinders.d) if tau is None else tau, (cylinders.d,), "N·m")
        force = self._desired_forces(
            tau, cylinders.geometry(cylinders.max_lever_angle if q_joints is None else q_joints)
        )
        # a valve with equal edges holds a force with as much pressure missing at A as there is too
        # much at B
        lines = cylinders.hydraulics.supply_pressure + cylinders.hydraulics.tank_pressure
        a = (force + cylinders.areas[1] * lines) / cylinders.areas.sum(axis=0)
        self.state = HydraulicState(
            np.zeros(cylinders.d), np.array([a, lines - a]), np.zeros(cylinders.d)
        )

    def torques(self, q_joints: npt.ArrayLike) -> Array:
        """The torques that the oil makes at joint angles, shape (d,) rad: L F, shape (d,), N·m."""
        return self.cylinders.geometry(q_joints).lever * self.cylinders.force(self.state.pressures)

    def step(
        self,
        tau_desired: npt.ArrayLike,
        q_joints: npt.ArrayLike,
        v_joints: npt.ArrayLike,
        dt: float,
    ) -> Array:
        """Let time pass; the joints' torques at its end, shape (d,), N·m.

        tau_desired: (d,) N·m.
        q_joints, v_joints: (d,) rad and rad/s at the start. The oil's spring answers to them and
            acts on the next ones, which is stable (symplectic Euler) for √(L² k / inertia) dt < 2;
            at 1 ms the catalogue's robots reach 1.7.
        dt: s, integrated in equal steps of 0.2 ms at most: the spool exactly, the pressures by
            linearly implicit Euler.
        """
        cylinders = self.cylinders
        geometry = cylinders.geometry(q_joints)
        force = self._desired_forces(
            as_array("tau_desired", tau_desired, (cylinders.d,), "N·m"), geometry
        )
        v = as_array("v_joints", v_joints, (cylinders.d,), "rad/s")
        steps = max(
            1,
            int(
                np.ceil(
                    as_positive("dt", dt, "s", maximum=_MAX_DURATION) / _MAX_STEP - _STEP_ROUNDING
                )
            ),
        )
        state = (self.state.opening, self.state.pressures, self.state.integral)
        for _ in range(steps):
            state = self._advance(state, force, geometry, v, dt / steps)
        self.state = HydraulicState(*state)
        return geometry.lever * cylinders.force(self.state.pressures)

    def _desired_forces(self, tau: Array, geometry: CylinderGeometry) -> Array:
        """The piston forces for joint torques, shape (d,), N, within what supply and tank allow."""
        min_lever = _MIN_LEVER_FRACTION * self.cylinders.crank
        lever = np.where(np.abs(geometry.lever) < min_lever, min_lever, geometry.lever)
        return np.clip(tau / lever, *self.cylinders.force_limits())

    def _advance(
        self, state: _StateArrays, force: Array, geometry: CylinderGeometry, v: Array, step: float
    ) -> _StateArrays:
        """Opening, pressures and integral `step` s later when the loop desires `force`, (d,) N, at
        joint velocities v.
        """
        cylinders, (opening, pressures, integral) = self.cylinders, state
        rate = 2.0 * np.pi * cylinders.hydraulics.loop_bandwidth
        error = force - cylinders.force(pressures)
        force_rate = rate * (error + _INTEGRAL_FRACTION * rate * integral)
        u = cylinders.opening_for(force_rate, pressures, geometry, v)
        integral = integral + step * np.where(np.abs(u) < 1.0, error, 0.0)
        u = np.minimum(np.maximum(u, -1.0), 1.0)
        return *cylinders.advance(opening, pressures, u, geometry, v, step), integral
