"""Hydraulic actuators with a force loop that makes each joint follow a desired torque.

[FBR]_, App. B.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import ceil

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, Value, as_array, as_instance, as_positive, read_only
from floatbase.actuators.hydraulics import CylinderGeometry, Cylinders, Hydraulics
from floatbase.errors import InputError
from floatbase.robots import Robot

# s, substep for the oil: at 0.2 ms, torques are accurate to 1 % of the torque limit
_MAX_STEP = 2e-4
# s, longest step: constant torques and velocities for longer indicate a wrong unit
_MAX_DURATION = 10.0
# fraction of a substep: 1 ms is 5 substeps of 0.2 ms, even if the quotient is rounded
_STEP_ROUNDING = 1e-9
# corner frequency of the integral, as a fraction of the loop bandwidth; it costs 3° of phase
_INTEGRAL_FRACTION = 0.05
# shortest lever, as a fraction of the crank: below it, any torque needs an impossible pressure
_MIN_LEVER_FRACTION = 1e-9
_StateArrays = tuple[Array, Array, Array]  # the parts of a `HydraulicState`, between substeps


@dataclass(frozen=True, eq=False)
class HydraulicState(Value):
    """State of d hydraulic cylinders and their force loops.

    Parameters
    ----------
    opening : array_like, shape (d,)
        Valve openings, -1 to 1, dimensionless.
    pressures : array_like, shape (2, d)
        Gauge pressures of the chambers A and B [Pa].
    integral : array_like, shape (d,)
        Integrals of the force errors in the loops [N·s].
    """

    opening: Array
    pressures: Array
    integral: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            object.__setattr__(self, field.name, read_only(getattr(self, field.name)))


class HydraulicActuators:
    """Hydraulic cylinders with force loops, one on every joint of a robot.

    Use them as `actuators` in `rollout`.

    Each loop commands Ḟ = ω (e + ω_i ∫e dt), where e = F_desired - F, ω is 2π times the bandwidth
    of the loop, and ω_i is a twentieth of ω. The loop sets the valve to the opening that gives this
    Ḟ (`Cylinders.opening_for`). The integral pauses while the valve is fully open. The torque
    follows up to the bandwidth of the loop, as long as that is below the bandwidth of the valve.

    Each cylinder is a scaled version of HyQ's. At the best angle of the lever and in the weaker
    direction, with the rod retracting, the supply pressure gives the torque limit of the joint.
    Friction of the pistons is neglected. A load that pulls the rod out quickly starves chamber A.
    The oil in the chamber boils, and torque is missing until the chamber is full again.

    Parameters
    ----------
    robot : Robot
        Robot, as returned by `fb.load`.
    hydraulics : Hydraulics, optional
        Cylinder to scale; HyQ's by default.
    max_lever_angle : array_like, shape (d,), optional
        Joint angles at which the levers are longest [rad]; those of `robot.standing()` by default.

    Attributes
    ----------
    state : HydraulicState
        Present state.
    cylinders : Cylinders
        Equations of the cylinders.

    Raises
    ------
    InputError
        If a joint has no torque limit, or if a joint is prismatic.

    Notes
    -----
    [FBR]_, App. B. HyQ: [Semini2011]_. The loop follows Boaventura et al., Model-based hydraulic
    impedance control for dynamic robots, IEEE T-RO 31, 2015.
    """

    def __init__(
        self,
        robot: Robot,
        hydraulics: Hydraulics | None = None,
        max_lever_angle: npt.ArrayLike | None = None,
    ):
        self.robot = as_instance("robot", robot, Robot)
        hydraulics = Hydraulics() if hydraulics is None else hydraulics
        as_instance("hydraulics", hydraulics, Hydraulics)
        for joint, limit in zip(robot.joint_names, robot.torque_limits, strict=True):
            kind = robot.model.joints[robot.model.getJointId(joint)].shortname()
            if not kind.startswith("JointModelR"):
                raise InputError(
                    f"{joint} of {robot.name} is prismatic ({kind}). Hydraulic actuators need a "
                    f"revolute joint, since they act through a crank."
                )
            if not np.isfinite(limit):
                raise InputError(
                    f"{joint} of {robot.name} has no torque limit, which is needed to scale its "
                    f'cylinder. Use fb.load("{robot.name}", torque_limits=…).'
                )
        if max_lever_angle is None:
            # the difference from the neutral configuration holds joint angles even if q holds cos
            # and sin
            max_lever_angle = robot.standing().difference(robot.neutral().q)[robot.nv - robot.d :]
        self.cylinders = Cylinders(
            hydraulics, robot.torque_limits / hydraulics.weakest_torque, max_lever_angle
        )
        self.reset()

    def reset(
        self, tau: npt.ArrayLike | None = None, q_joints: npt.ArrayLike | None = None
    ) -> None:
        """Close the valves and set the pressures so that the joints get the torques tau.

        The supply pressure limits the torques. The integrals start at zero, so the torques have an
        error due to leakage until the integrals have compensated for it.

        Parameters
        ----------
        tau : array_like, shape (d,), optional
            Torques [N·m]; zero by default. A robot that should stand from the start needs the
            torques of its stance.
        q_joints : array_like, shape (d,), optional
            Joint angles [rad]; `Cylinders.max_lever_angle` by default.
        """
        cylinders = self.cylinders
        tau = as_array("tau", np.zeros(cylinders.d) if tau is None else tau, (cylinders.d,), "N·m")
        force = self._desired_forces(
            tau, self._geometry(cylinders.max_lever_angle if q_joints is None else q_joints)
        )
        # a valve with equal edges maintains a force if the pressure missing at A equals the excess
        # at B
        lines = cylinders.hydraulics.supply_pressure + cylinders.hydraulics.tank_pressure
        a = (force + cylinders.areas[1] * lines) / cylinders.areas.sum(axis=0)
        self.state = HydraulicState(
            np.zeros(cylinders.d), np.array([a, lines - a]), np.zeros(cylinders.d)
        )

    def torques(self, q_joints: npt.ArrayLike) -> Array:
        """Return the joint torques L F due to the oil.

        Parameters
        ----------
        q_joints : array_like, shape (d,)
            Joint angles [rad].

        Returns
        -------
        ndarray, shape (d,)
            Torques [N·m].
        """
        return self._geometry(q_joints).lever * self.cylinders.force(self.state.pressures)

    def step(
        self,
        tau_desired: npt.ArrayLike,
        q_joints: npt.ArrayLike,
        v_joints: npt.ArrayLike,
        dt: float,
    ) -> Array:
        """Advance the actuators by a time step and return the joint torques at its end.

        The step is integrated in equal substeps of at most 0.2 ms: the valve spool exactly, the
        pressures by the linearly implicit Euler method.

        The joints are constant during the step, and the resulting torques act on the next one. With
        the spring of the oil, this is stable (symplectic Euler) for √(L² k / inertia) dt < 2. At 1
        ms the robots in the catalogue reach 1.7.

        Parameters
        ----------
        tau_desired : array_like, shape (d,)
            Desired torques [N·m].
        q_joints : array_like, shape (d,)
            Joint angles at the start of the step [rad].
        v_joints : array_like, shape (d,)
            Joint velocities at the start of the step [rad/s].
        dt : float
            Length of the step [s].

        Returns
        -------
        ndarray, shape (d,)
            Torques at the end of the step [N·m].
        """
        cylinders = self.cylinders
        geometry = self._geometry(q_joints)
        force = self._desired_forces(
            as_array("tau_desired", tau_desired, (cylinders.d,), "N·m"), geometry
        )
        v = as_array("v_joints", v_joints, (cylinders.d,), "rad/s")
        time = as_positive("dt", dt, "s", maximum=_MAX_DURATION)
        steps = max(1, ceil(time / _MAX_STEP - _STEP_ROUNDING))
        state = (self.state.opening, self.state.pressures, self.state.integral)
        for _ in range(steps):
            state = self._advance(state, force, geometry, v, dt / steps)
        self.state = HydraulicState(*state)
        return geometry.lever * cylinders.force(self.state.pressures)

    def _geometry(self, q_joints: npt.ArrayLike) -> CylinderGeometry:
        q = as_array("q_joints", q_joints, (self.cylinders.d,), "rad")
        return self.cylinders.geometry(q)

    def _desired_forces(self, tau: Array, geometry: CylinderGeometry) -> Array:
        """Return the piston forces for joint torques, shape (d,) [N].

        The forces are limited to what supply and tank allow.
        """
        min_lever = _MIN_LEVER_FRACTION * self.cylinders.crank
        lever = np.where(np.abs(geometry.lever) < min_lever, min_lever, geometry.lever)
        return np.clip(tau / lever, *self.cylinders.force_limits())

    def _advance(
        self, state: _StateArrays, force: Array, geometry: CylinderGeometry, v: Array, step: float
    ) -> _StateArrays:
        """Return opening, pressures and integral after `step` [s] for desired forces [N]."""
        cylinders, (opening, pressures, integral) = self.cylinders, state
        rate = 2.0 * np.pi * cylinders.hydraulics.loop_bandwidth
        error = force - cylinders.force(pressures)
        force_rate = rate * (error + _INTEGRAL_FRACTION * rate * integral)
        u = cylinders.opening_for(force_rate, pressures, geometry, v)
        integral = integral + step * np.where(np.abs(u) < 1.0, error, 0.0)
        u = np.minimum(np.maximum(u, -1.0), 1.0)
        return *cylinders.advance(opening, pressures, u, geometry, v, step), integral
