"""Lesson X, The crash investigation: `BlackBox`, what is left of a fall."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array, Value, as_integer, read_only
from floatbase.robots import Robot


@dataclass(frozen=True, eq=False)
class BlackBox(Value):
    """The record of a robot that was to stand on four feet and twist. One row for each of n ticks;
    read-only.

    name: of the case.
    robot: its data sheet, which is right.
    contacts: what the controller was told of the ground: feet, friction, normals.

    What the sensors saw:
    time: (n,) s, when each tick begins; they are equally long.
    q, v: (n, nq) and (n, nv), before the tick.
    measured: (n, k) N, world, forces of the ground at the feet, their mean during the tick.

    What the controller had in mind:
    tau: (n, d) N·m, the torques it ordered.
    planned: (n, k) N, world, the forces it planned with them.
    qdd: (n, nv) m/s² and rad/s², the acceleration it planned with them, as in v.

    Nobody measured the torques of the joints.
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
        """The state at row i."""
        row = as_integer("row", i, -len(self), len(self) - 1)
        return fb.State(self.robot, self.q[row], self.v[row])

    def equations(self, i: int | np.integer[Any]) -> fb.EquationsOfMotion:
        """(7) at row i by the data sheet, with the contacts as the controller was told them."""
        return fb.equations_of_motion(self.state(i), self.contacts)

    @property
    def fell(self) -> bool:
        """Whether the robot lies at the end: its base tilted by 45° or more, or at half its height
        or less.
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
