"""The terms of (7) in the playground: how each is written, and which switches it has."""

from __future__ import annotations

from typing import NamedTuple


class Term(NamedTuple):
    """A term of (7).

    name: in `Settings.assumed_off` and `Settings.actual_off`. symbol: as it is written over the
        picture.
    assumed_switch, actual_switch: the names of its switches on the page; "" for none.
    mismatch_option, perturbation_option: the options of `ModelMismatch` and of `Perturbation` that
        switch it; "" where that takes more than a flag.
    """

    name: str
    symbol: str
    assumed_switch: str = ""
    actual_switch: str = ""
    mismatch_option: str = ""
    perturbation_option: str = ""

    @property
    def switches(self) -> dict[str, str]:
        """The names of the switches that there are, by the field of `Settings` that they set."""
        names = {"assumed_off": self.assumed_switch, "actual_off": self.actual_switch}
        return {field: name for field, name in names.items() if name}


EQUATION = (
    Term("inertia", "M q̈"),
    Term(
        "velocity", "+ C q̇",
        "Coriolis and centrifugal forces in the model",
        "Coriolis and centrifugal forces in reality",
        "velocity_forces", "velocity_forces",
    ),
    Term("gravity", "+ g", "gravity in the model", "gravity in reality", "gravity", "gravity"),
    Term("zeros", "= S τ", "zeros of S in the model", "zeros of S in reality", "underactuated"),
    Term("forces", "+ Jᵀλ", "force of one leg in the model", "force of one leg in reality"),
    Term("drift", "J̇ q̇", "drift of the contacts in the model", "", "drift"),
    Term(
        "cones", "nᵀλ ≥ 0",
        "unilateral contacts in the model",
        "unilateral contacts in reality",
        "cones",
    ),
)  # fmt: skip
SYMBOLS = {term.name: term.symbol for term in EQUATION}
