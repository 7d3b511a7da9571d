"""Damping that the motors apply when the controller is off."""

from __future__ import annotations

import numpy as np

from floatbase._validation import Array, as_instance, as_positive
from floatbase.robots import State

# s: time constant with which the damping stops a joint if nothing else moves it
_TIME_CONSTANT = 0.05


def joint_damping(state: State, period: float) -> Array:
    """Return the damping that each motor applies when the controller is off.

    The damping is the joint's effective inertia in this state, 1 / (M⁻¹)ᵢᵢ, divided by 0.05 s.

    Parameters
    ----------
    state : State
        The state in which the controller is switched off.
    period : float
        Time between two updates of the torques [s]. The damping stops a joint in two periods at
        the earliest.

    Returns
    -------
    ndarray, shape (d,)
        Damping of each joint [N·m·s/rad].

    Raises
    ------
    InputError
        If an argument is of the wrong type, or if the period is not positive.
    """
    M, period = as_instance("state", state, State).M, as_positive("period", period, "s")
    inverse_inertia = np.diag(np.linalg.inv(M))[state.robot.nv - state.robot.d :]
    return np.array(1.0 / (max(_TIME_CONSTANT, 2.0 * period) * inverse_inertia))
