"""Lesson X: `BlackBox`, the record of a fall."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array, Value, as_integer, read_only
from floatbase.robots import Robot


@dataclass(frozen=True, eq=False)
class BlackBox(Value):
    """Record of a robot that was to twist on four feet, with one row for each of n control steps.

    The arrays are read-only. The joint torques were not measured.

    Parameters
    ----------
    name : str
        Name of the case.
    robot : Robot
        Data sheet of the robot, which is correct.
    contacts : Contacts
        What the controller assumed about the ground: feet, friction, normals.
    time : ndarray, shape (n,)
        Start of each control step [s]; all have the same duration.
    q, v : ndarray, shape (n, nq) and (n, nv)
        Measured configuration and velocity before the control step.
    measured : ndarray, shape (n, k)
        Measured contact forces, their mean during the control step, in the world frame [N].
    tau : ndarray, shape (n, d)
        Torques that the controller commanded [N·m].
    planned : ndarray, shape (n, k)
        Contact forces that it planned with them, in the world frame [N].
    qdd : ndarray, shape (n, nv)
        Acceleration that it planned with them, as in v [m/s², rad/s²].
    """

    name: str
    robot: Robot
    contacts: fb.Contacts
    time: Array
    q: Array
    v: Array
    measured: Array
    tau: Array
    planned: Array
    qdd: Array

    def __post_init__(self) -> None:
        for field in fields(self)[3:]:
            object.__setattr__(self, field.name, read_only(getattr(self, field.name)))

    def __len__(self) -> int:
        return int(self.time.size)

    def state(self, i: int | np.integer[Any]) -> fb.State:
        """Return the state in row i."""
        row = as_integer("row", i, -len(self), len(self) - 1)
        return fb.State(self.robot, self.q[row], self.v[row])

    def equations(self, i: int | np.integer[Any]) -> fb.EquationsOfMotion:
        """Return the equations of motion in row i, with the contacts that the controller assumed.

        Notes
        -----
        [FBR]_, eq. (7).
        """
        return fb.equations_of_motion(self.state(i), self.contacts)

    @property
    def fell(self) -> bool:
        """Whether the robot has fallen at the end.

        A robot has fallen if its base is tilted by 45° or more, or is at half its height or less.
        """
        x, y = self.q[-1, 3:5]
        return bool(
            1.0 - 2.0 * (x**2 + y**2) < np.cos(np.pi / 4) or self.q[-1, 2] < 0.5 * self.q[0, 2]
        )

    def __repr__(self) -> str:
        return (
            f"BlackBox({self.name}: {self.robot.name}, {self.time[-1]:.1f} "
            f"s{', fell' if self.fell else ''})"
        )
