"""Controllers of the lessons: constant torques, a servo in every joint, and one whose QP somebody
else solves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_array, as_callable, as_instance, as_positive
from floatbase.control import WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.qp import QP
from floatbase.robots import State

# s to each side for the central difference of a path: smooth over a second, it is off by 1e-8 of
# its velocity
_DIFFERENCE_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class TorqueCommand:
    """What a rollout reads from a controller's answer.

    tau: shape (d,), N·m. forces: the contact forces that the controller predicts, shape (k,), N,
        world; None without a
    prediction.
    """

    tau: Array
    forces: Array | None = None


class ConstantTorques:
    """A controller that gives the same torques in every state.

    tau: shape (d,), N·m.
    contacts: the stance for which forces are recorded; all feet by default.
    predict: contact forces that a theory expects in a configuration q with velocity v, (q, v) ->
        shape (k,), N, world. They are recorded as planned forces and change nothing.
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
        """The torques, and the prediction for configuration q and velocity v."""
        return TorqueCommand(self.tau, self._predict(q, v) if self._predict is not None else None)


class SolverController:
    """A controller that hands the QP of every tick to a solver.

    controller: makes the QP. solver: is called with it, and returns x = (q̈, τ, λ), shape (n,).
    """

    def __init__(
        self, controller: WholeBodyController, solver: Callable[[QP], npt.ArrayLike]
    ) -> None:
        self.robot, self.contacts = controller.robot, controller.contacts
        self.controller, self.solver = controller, solver

    def qp(self, state: State, t: float = 0.0) -> QP:
        """The QP of one tick."""
        return self.controller.qp(state, t)

    def __call__(self, q: Array, v: Array, t: float) -> TorqueCommand:
        """The torques for configuration q and velocity v."""
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
    """A controller that knows joints only: τ = tau - stiffness · (position error) - damping ·
    (velocity error), per joint.

    state: its joints are the desired ones.
    tau: torques that hold the joints at rest, shape (d,), N·m; 0 by default.
    path: offset of the desired joints at time t in s, t -> shape (d,), rad; 0 by default.
    stiffness: N·m/rad.
    damping: N·m·s/rad.
    """
    d = as_instance("state", state, State).robot.d
    joints = slice(state.robot.nv - d, None)
    holding_torques = np.zeros(d) if tau is None else as_array("tau", tau, (d,), "N·m")
    stiffness, damping = (
        as_positive("stiffness", stiffness, allow_zero=True),
        as_positive("damping", damping, allow_zero=True),
    )
    offset = as_callable("path", path, "path(t)") if path is not None else lambda t: np.zeros(d)

    def controller(q: Array, v: Array, t: float) -> TorqueCommand:
        rate = (offset(t + _DIFFERENCE_STEP) - offset(t - _DIFFERENCE_STEP)) / (
            2.0 * _DIFFERENCE_STEP
        )
        error = -state.difference(q)[joints] - offset(t)
        return TorqueCommand(holding_torques - stiffness * error - damping * (v[joints] - rate))

    return controller
