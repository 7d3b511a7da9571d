"""Contact forces, measured and planned, as pictures show them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy.typing as npt

from floatbase._validation import Array, as_array, numeric_copy, short_repr
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.viewer.scene.colours import MEASURED, PLANNED, RGB


@dataclass(frozen=True, eq=False)
class Forces:
    """Contact forces at n points in the world frame [N]."""

    measured: Array | None
    planned: Array | None

    @property
    def kinds(self) -> list[tuple[str, Array | None, RGB]]:
        """Name, forces and colour of the measured and of the planned forces."""
        return [("measured", self.measured, MEASURED), ("planned", self.planned, PLANNED)]

    @property
    def cone_forces(self) -> Array | None:
        """Forces that colour the cones: the measured ones, or else the planned ones."""
        return self.planned if self.measured is None else self.measured


def as_point_forces(
    name: str, value: npt.ArrayLike | None, contacts: Contacts | None
) -> Array | None:
    """Check forces, and arrange them as one row per contact point."""
    if value is None:
        return None
    if contacts is None:
        raise InputError(
            f"{name} were given without contacts, so their points are unknown. Pass contacts=… "
            f"as well."
        )
    array = numeric_copy(value)
    n = contacts.n_points
    if array is None:
        raise InputError(
            f"{name} must be numbers of shape ({3 * n},) or ({n}, 3) [N], not {short_repr(value)}."
        )
    if array.shape not in ((3 * n,), (n, 3)):
        raise InputError(
            f"{name} has shape {array.shape}. {n} contact points "
            f"({', '.join(contacts.point_names)}) need shape "
            f"({3 * n},) or ({n}, 3)."
        )
    return as_array(name, array.reshape(n, 3), (n, 3), "N")
