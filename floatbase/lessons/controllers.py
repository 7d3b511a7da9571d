"""Controllers of the lessons: constant torques, joint servos, and a QP with a custom solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_array, as_callable, as_instance, as_positive
from floatbase.actuators import JointTargets
from floatbase.control import WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.qp import QP
from floatbase.robots import State

# s to each side, for the central difference of a path: for a path that is smooth over a second,
# the relative error of the velocity is 1e-8
_DIFFERENCE_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class TorqueCommand:
    """Command of a controller, as a rollout reads it.

    Parameters
    ----------
    tau : ndarray, shape (d,)
        Torques [N·m].
    forces : ndarray, shape (k,), or None
        Contact forces that the controller predicts, in the world frame [N]; None without a
        prediction.
    """

    tau: Array
    forces: Array | None = None


class ConstantTorques:
    """Controller that commands the same torques in every state.

    Parameters
    ----------
    tau : array_like, shape (d,)
        Torques [N·m].
    contacts : Contacts, optional
        Contacts whose forces are recorded; by default all feet.
    predict : callable, optional
        Contact forces that a theory predicts: a function of configuration q and velocity v that
        returns forces, shape (k,), in the world frame [N]. They are recorded as planned forces and
        have no effect.
    """

    def __init__(
        self,
        tau: npt.ArrayLike,
        contacts: Contacts | None = None,
        predict: Callable[[Array, Array], Array] | None = None,
    ):
        self.tau = as_array("tau", tau, (None,), "N·m")
        self.contacts = None if contacts is None else as_instance("contacts", contacts, Contacts)
        self._predict = (
            None if predict is None else as_callable("predict", predict, "predict(q, v)")
        )

    def __call__(self, q: Array, v: Array, t: float) -> TorqueCommand:
        """Return the torques, and the prediction for configuration q and velocity v."""
        return TorqueCommand(self.tau, self._predict(q, v) if self._predict is not None else None)


class SolverController:
    """Controller that passes the QP of every control step to a custom solver.

    Parameters
    ----------
    controller : WholeBodyController
        Controller that builds the QP.
    solver : callable
        Function of the QP that returns x = (q̈, τ, λ), shape (n,).
    """

    def __init__(
        self, controller: WholeBodyController, solver: Callable[[QP], npt.ArrayLike]
    ) -> None:
        self.robot, self.contacts = controller.robot, controller.contacts
        self.controller, self.solver = controller, solver

    def qp(self, state: State, t: float = 0.0) -> QP:
        """Return the QP of one control step."""
        return self.controller.qp(state, t)

    def __call__(self, q: Array, v: Array, t: float) -> TorqueCommand:
        """Return the torques for configuration q and velocity v."""
        qp = self.qp(State(self.robot, q, v), t)
        x = as_array("x", self.solver(qp), (qp.n,))
        return TorqueCommand(x[qp.blocks["tau"]], x[qp.blocks["forces"]])


def joint_servo(
    state: State,
    tau: npt.ArrayLike | None = None,
    path: Callable[[float], Array] | None = None,
    stiffness: float = 100.0,
    damping: float = 10.0,
) -> Callable[[Array, Array, float], TorqueCommand]:
    """Return a controller that servoes each joint separately.

    The torques are τ = tau - stiffness · (position error) - damping · (velocity error), per joint.

    Parameters
    ----------
    state : State
        State with the desired joint positions.
    tau : array_like, shape (d,), optional
        Torques that hold the joints at rest [N·m]; zero by default.
    path : callable, optional
        Offset of the desired joint positions: a function of time [s] that returns an array, shape
        (d,), [rad]; zero by default.
    stiffness : float, optional
        Stiffness [N·m/rad].
    damping : float, optional
        Damping [N·m·s/rad].

    Returns
    -------
    callable
        The controller, a function of configuration q, velocity v and time t [s].
    """
    d = as_instance("state", state, State).robot.d
    joints = slice(state.robot.nv - d, None)
    holding_torques = np.zeros(d) if tau is None else as_array("tau", tau, (d,), "N·m")
    stiffness = as_positive("stiffness", stiffness, allow_zero=True)
    damping = as_positive("damping", damping, allow_zero=True)
    offset = as_callable("path", path, "path(t)") if path is not None else lambda t: np.zeros(d)

    def controller(q: Array, v: Array, t: float) -> TorqueCommand:
        rate = (offset(t + _DIFFERENCE_STEP) - offset(t - _DIFFERENCE_STEP)) / (
            2.0 * _DIFFERENCE_STEP
        )
        targets = JointTargets(
            offset(t), rate, np.array(stiffness), np.array(damping), holding_torques
        )
        return TorqueCommand(targets.torques(-state.difference(q)[joints], v[joints]))

    return controller
