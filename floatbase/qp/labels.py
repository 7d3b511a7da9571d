"""Labels of QP constraints: a name, the kind of the constraint, and its owner."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from floatbase._validation import as_strings, short_repr
from floatbase.errors import InputError


class ConstraintLabel(str):
    """The name of a constraint, with its kind and owner.

    A label equals its text, so `"FL_foot facet 2" in command.active` works.

    Parameters
    ----------
    text : str
        Name of the constraint.
    kind : str, optional
        Kind of the constraint, such as "friction", "upper torque limit" or "dynamics". Plain
        strings have the kind "other constraints".
    owner : str, optional
        Foot, joint or contact that the constraint belongs to; the text itself by default.
    number : int, optional
        Index among the constraints of this kind and owner; None if the owner has only one.
    """

    __slots__ = ("kind", "number", "owner")

    kind: str
    owner: str
    number: int | None

    def __new__(
        cls,
        text: str,
        kind: str = "other constraints",
        owner: str | None = None,
        number: int | None = None,
    ) -> ConstraintLabel:
        """Make a label; see the class for its parameters."""
        label = super().__new__(cls, text)
        label.kind, label.owner, label.number = kind, text if owner is None else owner, number
        return label

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle a label with its kind, owner and number."""
        return ConstraintLabel, (str(self), self.kind, self.owner, self.number)


def constraint_labels(names: Iterable[str], count: int, kind: str) -> tuple[ConstraintLabel, ...]:
    """Return a label for each row of a matrix."""
    if isinstance(names, tuple) and set(map(type, names)) == {ConstraintLabel}:
        labels = names  # of another QP, checked
    else:
        labels = tuple(
            name if isinstance(name, ConstraintLabel) else ConstraintLabel(name)
            for name in as_strings(f"{kind}_names", names)
        )
    labels = labels or tuple(ConstraintLabel(f"{kind} {i}") for i in range(count))
    if len(labels) != count:
        raise InputError(
            f"There are {len(labels)} {kind} names for {count} rows. Pass one name per row, or "
            f"none at all."
        )
    if len(set(labels)) != count:
        duplicate = next(label for label in labels if labels.count(label) > 1)
        raise InputError(
            f"Duplicate {kind} name {short_repr(str(duplicate))}. Names must be unique."
        )
    return labels
