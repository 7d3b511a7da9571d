"""Terms of eq. (7) in the playground and on the live page: their symbols and their switches."""

from __future__ import annotations

from typing import NamedTuple

from floatbase.live.settings import TERMS


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
    arrow : str
        What the arrows of the term are; "" if the viewer draws the term itself.
    page_arrow : bool
        Whether the live page draws these arrows, too.
    is_shown : bool
        Whether the term is drawn initially.
    """

    name: str
    symbol: str
    assumed_switch: str = ""
    actual_switch: str = ""
    mismatch_option: str = ""
    perturbation_option: str = ""
    arrow: str = ""
    page_arrow: bool = False
    is_shown: bool = False

    @property
    def switches(self) -> dict[str, str]:
        """Names of the existing switches, keyed by the field of `Settings` that they set."""
        names = {"assumed_off": self.assumed_switch, "actual_off": self.actual_switch}
        return {field: name for field, name in names.items() if name}


EQUATION = tuple(Term(**row) for row in TERMS)
