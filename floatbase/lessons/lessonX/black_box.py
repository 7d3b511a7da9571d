"""Lesson X: `BlackBox`, the record of a fall."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array, Value, as_integer, read_only
from floatbase.robots import Robot


@dataclass(frozen=True, eq=False)
class BlackBox(Value):
    """Record of a robot that should have twisted on four feet, one row per control step."""

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
        """Return the equations of motion in row i, with the contacts of the controller."""
        return _equations(self, as_integer("row", i, -len(self), len(self) - 1))

    @property
    def fell(self) -> bool:
        """Whether the robot has fallen at the end."""
        x, y = self.q[-1, 3:5]
        return bool(
            1.0 - 2.0 * (x**2 + y**2) < np.cos(np.pi / 4) or self.q[-1, 2] < 0.5 * self.q[0, 2]
        )

    def __repr__(self) -> str:
        return (
            f"BlackBox({self.name}: {self.robot.name}, {self.time[-1]:.1f} "
            f"s{', fell' if self.fell else ''})"
        )


@lru_cache(maxsize=1024)  # the rows of a box or two, which several diagnoses read in turn
def _equations(box: BlackBox, row: int) -> fb.EquationsOfMotion:
    """Return the equations of motion in a row."""
    return fb.equations_of_motion(box.state(row), box.contacts)
