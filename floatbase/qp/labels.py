"""The label of a row of a `QP`: its name, which is a text, and what kind of row it is, of which
owner.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from floatbase._validation import as_strings
from floatbase.errors import InputError


class ConstraintLabel(str):
    """The name of a row, such as "FL_foot facet 2", that also knows what it names.

    text: the name; label and text are equal, so `"FL_foot facet 2" in command.active` asks as one
        expects.
    kind: what the row says, such as "friction", "upper torque limit" or "dynamics"; "other
        constraints" for a plain text.
    owner: the foot, joint or contact that it says it of; the text itself by default.
    number: which of its owner's rows of that kind, or None where the owner has one.
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
        label = super().__new__(cls, text)
        label.kind, label.owner, label.number = kind, text if owner is None else owner, number
        return label

    def __reduce__(self) -> tuple[Any, ...]:
        return ConstraintLabel, (str(self), self.kind, self.owner, self.number)


def constraint_labels(names: Iterable[str], count: int, kind: str) -> tuple[ConstraintLabel, ...]:
    """A label for each of the rows: the names as labels, or "equality 0", "equality 1", … where
    there are none.

    kind: "equality" or "inequality". Raises `InputError` for another number of names, or one that
        stands twice.
    """
    labels = tuple(
        name if isinstance(name, ConstraintLabel) else ConstraintLabel(name)
        for name in as_strings(f"{kind}_names", names)
    )
    labels = labels or tuple(ConstraintLabel(f"{kind} {i}") for i in range(count))
    if len(labels) != count:
        raise InputError(
            f"{len(labels)} {kind} names for {count} rows; give one for each row, or none at all."
        )
    if len(set(labels)) != count:
        duplicate = next(label for label in labels if labels.count(label) > 1)
        raise InputError(
            f"{kind} name {str(duplicate)!r} stands twice; each row needs a name of its own."
        )
    return labels
