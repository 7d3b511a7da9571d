"""The analytic controller: no limits, one closed-form minimum per control step."""

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
    """One answer of `AnalyticController`; its arrays are read-only."""

    tau: Array
    forces: Array
    qdd: Array

    def __repr__(self) -> str:
        return (
            f"AnalyticCommand(|tau|={np.linalg.norm(self.tau):.3g} N·m, "
            f"|forces|={np.linalg.norm(self.forces):.3g} N)"
        )


class AnalyticController(Value):
    """Controller that minimizes a sum of quadratic costs in closed form at every control step.

    The costs are the error of the wrench about the centre of mass, a bias of the contact forces,
    and regularization of posture and torques. No constraint keeps forces in their friction cones or
    torques within limits.

    Parameters
    ----------
    robot : Robot
        The robot to control.
    contacts : Contacts
        Contacts of the robot with the ground.
    state : State
        Desired posture, with the desired orientation of the base.
    com : array_like, shape (3,), optional
        Desired position of the centre of mass in the world frame [m]. The default is that of
        `state`.
    alpha : float, optional
        Weight ≥ 0 of the normal forces' deviation from `a`, relative to the tangential forces, in
        eq. (23) [-].
    a : float, optional
        Normal force that eq. (23) prefers at each point [N]. The default is an equal share of the
        weight.
    kp : float, optional
        Stiffness [1/s²].
    kd : float, optional
        Damping [1/s].
    bias_weight : float, optional
        Weight of the force bias, eq. (23), relative to the wrench error, eq. (22) [-].
    posture_weight : float, optional
        Weight of the joints' return to `state` [1/(rad/s²)²].
    torque_weight : float, optional
        Weight of ‖τ‖² [1/(N·m)²].

    Raises
    ------
    InputError
        If an argument has a wrong type, shape or value, if `state` belongs to a different robot, or
        if forces of the contacts do not act at points.
    UnknownNameError
        If a contact refers to a frame that the robot does not have.

    Notes
    -----
    [FBR]_, eqs. (22), (23). The minimum is taken over β of eq. (17).

    The desired force is f̃_c = m (a - g) with a = -kp e - kd ė, where e is the position of the
    centre of mass relative to `com`. The desired moment τ̃_c follows in the same way from the
    base's rotation, with the robot's inertia about its centre of mass. The posture and torque
    weights resolve the freedom that eqs. (22) and (23) leave open (d > k). Without such freedom
    they compete with the desired wrench, and the posture weight affects a light robot more.
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
        as_instance("state", state, State)
        if state.robot != robot:
            raise InputError(
                f"state belongs to the robot {state.robot.name}. The controller's robot is "
                f"{robot.name}. Pass a state of that robot."
            )
        equations_of_motion(state, contacts)  # unknown frames raise here, not in the loop
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
        """Return the costs on q̈, τ and λ whose sum is minimized.

        Parameters
        ----------
        eom : EquationsOfMotion
            Equations of motion at a state of the robot.

        Returns
        -------
        tuple of Quadratic
            Costs on q̈, τ and λ.

        Raises
        ------
        InputError
            If the equations belong to a different robot.
        """
        state = as_instance("eom", eom, EquationsOfMotion).state
        if state.robot != self.robot:
            raise InputError(
                f"eom belongs to the robot {state.robot.name}. The controller's robot is "
                f"{self.robot.name}. Pass the equations of that robot."
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
        """Compute the command of one control step: the minimum over β, mapped back to (q̈, τ, λ).

        Parameters
        ----------
        q : array_like, shape (nq,)
            Configuration.
        v : array_like, shape (nv,)
            Generalized velocity: the base's linear [m/s] and angular [rad/s] part in the base
            frame, then the joints [rad/s or m/s].
        t : float, optional
            Time [s].

        Returns
        -------
        AnalyticCommand
            Torques, with the forces and accelerations planned with them.
        """
        v = as_array("v", v, (self.robot.nv,))  # State takes None for rest; here it is a mistake
        eom = equations_of_motion(State(self.robot, q, v), self.contacts, t)
        space = feasible_space(eom)
        qdd, tau, forces = space(cost_on_space(space, *self.objective(eom)).minimizer())
        return AnalyticCommand(read_only(tau), read_only(forces), read_only(qdd))
