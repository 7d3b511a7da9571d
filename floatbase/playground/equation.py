"""Terms of eq. (7) in the playground: their symbols and their switches."""

from __future__ import annotations

from typing import NamedTuple


class Term(NamedTuple):
    """A term of eq. (7).

    Parameters
    ----------
    name : str
        Name in `Settings.assumed_off` and `Settings.actual_off`.
    symbol : str
        Symbol shown over the picture.
    assumed_switch : str
        Name of the switch for the controller's model; "" if there is none.
    actual_switch : str
        Name of the switch for the simulation; "" if there is none.
    mismatch_option : str
        Option of `ModelMismatch` that switches the term; "" if a flag is not enough.
    perturbation_option : str
        Option of `Perturbation` that switches the term; "" if a flag is not enough.
    """

    name: str
    symbol: str
    assumed_switch: str = ""
    actual_switch: str = ""
    mismatch_option: str = ""
    perturbation_option: str = ""

    @property
    def switches(self) -> dict[str, str]:
        """Names of the existing switches, keyed by the field of `Settings` that they set."""
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
