"""The settings that a learner can change in the live page and in the playground.

`settings.json` has one row for each setting, `equation.json` one for each term of eq. (7), and
`challenges.json` one for each challenge. They are the same on both pages. The live page contains
the tables (`make web`), and its engine accepts no other values.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple


def _table(name: str) -> Any:
    """Return a table that the live page contains, too."""
    return json.loads(Path(__file__).with_name(name).read_text(encoding="utf-8"))


_ROWS: dict[str, dict[str, Any]] = _table("settings.json")
TERMS: list[dict[str, Any]] = _table("equation.json")  # of eq. (7)
CHALLENGE_TABLE: dict[str, Any] = _table("challenges.json")


class Setting(NamedTuple):
    """A setting: its name, its range in its own unit, and its initial value."""

    name: str
    symbol: str = ""
    unit: str = ""
    section: str = ""  # of the panel
    low: float = 0.0
    high: float = 0.0  # of a push in robot weights, of a payload in robot masses
    step: float = 0.0
    first: float = 0.0
    scale: float = 1.0  # SI units per unit

    @property
    def range(self) -> tuple[float, float, float]:
        """Smallest and largest value, and step."""
        return self.low, self.high, self.step

    @property
    def label(self) -> str:
        """Text of the control, such as "CoM x [cm]"."""
        unit = f"[{self.unit}]" if self.unit else ""
        return " ".join(part for part in (self.name, self.symbol, unit) if part)


SETTINGS = {key: Setting(**row) for key, row in _ROWS.items()}
