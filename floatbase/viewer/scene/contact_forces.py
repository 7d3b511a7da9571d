"""Contact forces, measured and planned, as pictures show them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, as_array, numeric_copy, short_repr
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.viewer.scene.colours import MEASURED, PLANNED, RGB


@dataclass(frozen=True, eq=False)
class Forces:
    """Contact forces in the world frame: all of λ, shape (k,), or those at n points, (n, 3) [N]."""

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

    def at_points(self, contacts: Contacts) -> Forces:
        """Return the forces at the points of contacts, shape (n, 3)."""
        parts = [contacts.force_slice(contact.name) for contact in contacts.friction_contacts]
        return Forces(
            *(
                values
                if values is None or values.ndim == 2
                else np.concatenate([values[:0], *(values[p] for p in parts)]).reshape(-1, 3)
                for values in (self.measured, self.planned)
            )
        )


def as_forces(name: str, value: npt.ArrayLike | None, contacts: Contacts | None) -> Array | None:
    """Check forces: all of λ, shape (k,), or those at n points, which become (n, 3)."""
    if value is None:
        return None
    if contacts is None:
        raise InputError(
            f"{name} were given without contacts, so their points are unknown. Pass contacts=… "
            f"as well."
        )
    array = numeric_copy(value)
    n, k = contacts.n_points, contacts.k
    shapes = f"({3 * n},) or ({n}, 3)" + f", or ({k},) with all constraints" * (k != 3 * n)
    if array is None:
        raise InputError(f"{name} must be numbers of shape {shapes} [N], not {short_repr(value)}.")
    if array.shape not in ((3 * n,), (n, 3), (k,)):
        raise InputError(
            f"{name} has shape {array.shape}. {n} contact points "
            f"({', '.join(contacts.point_names)}) need shape {shapes}."
        )
    array = as_array(name, array, array.shape, "N")
    return array.reshape(n, 3) if array.size == 3 * n else array
