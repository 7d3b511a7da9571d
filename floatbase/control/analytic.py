"""The controller of objectives alone (§3.1): no limits, one closed-form minimum each tick."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, Value, as_array, as_instance, as_positive, read_only
from floatbase.affine import Quadratic
from floatbase.dynamics import Contacts, EquationsOfMotion, equations_of_motion, feasible_space
from floatbase.errors import InputError
from floatbase.objectives import (
    centroidal_inertia,
    cost_on_space,
    desired_wrench,
    force_bias,
    wrench_objective,
)
from floatbase.robots import Robot, State


@dataclass(frozen=True, eq=False)
class AnalyticCommand(Value):
    """One answer of `AnalyticController`, read-only.

    tau: (d,) N·m, joint torques to apply. forces: (k,) N, world, and qdd: (nv,), planned with them.
    """

    tau: Array
    forces: Array
    qdd: Array

    def __repr__(self) -> str:
        return (
            f"AnalyticCommand(|tau|={np.linalg.norm(self.tau):.3g} N·m, "
            f"|forces|={np.linalg.norm(self.forces):.3g} N)"
        )


class AnalyticController(Value):
    """(22) + (23) + terms for posture and torque, minimised in closed form over β (17) at every
    tick.

    The desired wrench is f̃_c = m (a - g) with a = -kp e - kd ė, where e leads from `com` to the
    centre of mass; τ̃_c does the same for the base's rotation, with the robot's inertia about its
    centre of mass. Nothing keeps forces in their cones or torques within limits. Source: [FBR],
    §3.1.

    robot: the robot to control.
    contacts: its contacts with the ground.
    state: the posture to return to, with its base orientation.
    com: (3,) m, world, desired centre of mass; that of `state` by default.
    alpha: ≥ 0, weight of the normal forces' distance from `a`, beside that of the tangential
        forces, in (23).
    a: N, the normal force that (23) prefers at each point; the weight's even share by default.
    kp: 1/s², stiffness.
    kd: 1/s, damping.
    bias_weight: weight of (23) beside (22).
    posture_weight: per (rad/s²)², weight of the joints' return to `state`.
    torque_weight: per (N·m)², weight of ‖τ‖².

    `posture_weight` and `torque_weight` settle what (22)(23) leave open (d > k). Where nothing is
    left open they compete with the desired wrench; a light robot feels the weight of the posture
    more. Raises `InputError` for values that do not fit.
    """

    robot: Robot
    contacts: Contacts
    com: Array
    _desired_state: State
    _force_bias: Quadratic
    _kp: float
    _kd: float
    _posture_weight: float
    _torque_weight: float

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        state: State,
        *,
        com: npt.ArrayLike | None = None,
        alpha: float = 0.1,
        a: float | None = None,
        kp: float = 100.0,
        kd: float = 20.0,
        bias_weight: float = 1e-3,
        posture_weight: float = 1e-3,
        torque_weight: float = 1e-6,
    ):
        as_instance("robot", robot, Robot)
        as_instance("contacts", contacts, Contacts)
        as_instance("the state to hold", state, State)
        if state.robot != robot:
            raise InputError(f"the state to hold belongs to another robot than {robot.name}.")
        equations_of_motion(state, contacts)  # frames that do not exist show now, not in the loop
        weight_share = robot.weight / max(contacts.n_points, 1)
        vars(self).update(
            robot=robot,
            contacts=contacts,
            com=as_array("com", state.com if com is None else com, (3,), "m"),
            _desired_state=state,
            _force_bias=as_positive("bias_weight", bias_weight)
            * force_bias(contacts, alpha, weight_share if a is None else a),
            _kp=as_positive("kp", kp, "1/s²"),
            _kd=as_positive("kd", kd, "1/s"),
            _posture_weight=as_positive("posture_weight", posture_weight),
            _torque_weight=as_positive("torque_weight", torque_weight),
        )

    def objective(self, eom: EquationsOfMotion) -> tuple[Quadratic, Quadratic, Quadratic]:
        """The costs on q̈, τ and λ whose sum is minimised."""
        state = as_instance("eom", eom, EquationsOfMotion).state
        if state.robot != self.robot:
            raise InputError(
                f"the equations are of {state.robot.name}, the controller of another robot, "
                f"{self.robot.name}."
            )
        a = -self._kp * (state.com - self.com) - self._kd * state.com_velocity
        R = state.frame_pose("base").rotation
        R_desired = self._desired_state.frame_pose("base").rotation
        angular_acceleration = (
            -self._kp * pin.log3(R @ R_desired.T) - self._kd * state.frame_velocity("base")[3:]
        )
        wrench = desired_wrench(state, a, centroidal_inertia(state) @ angular_acceleration)
        force_cost = wrench_objective(state, eom.contacts, *wrench) + self._force_bias
        joint_acceleration = (
            -self._kp * state.difference(self._desired_state.q) - self._kd * state.v
        )[eom.nv - eom.d :]
        qdd_cost = Quadratic.from_residual(eom.S.T, joint_acceleration, self._posture_weight)
        return (
            qdd_cost,
            Quadratic.from_residual(np.eye(eom.d), np.zeros(eom.d), self._torque_weight),
            force_cost,
        )

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> AnalyticCommand:
        """The tick: the minimum over β, mapped back to (q̈, τ, λ)."""
        v = as_array("v", v, (self.robot.nv,))  # State takes None for rest; here it is a slip
        eom = equations_of_motion(State(self.robot, q, v), self.contacts, t)
        space = feasible_space(eom)
        qdd, tau, forces = space(cost_on_space(space, *self.objective(eom)).minimiser())
        return AnalyticCommand(read_only(tau), read_only(forces), read_only(qdd))
