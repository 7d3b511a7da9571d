"""The controls of the live page, the playground and the lessons.

`settings.json` has one row for each control, `equation.json` one for each term of eq. (7),
`challenges.json` one for each challenge, and `limits.json` has the sentences about what limits a
robot. Name, unit, range and initial value of a control are the same in all of its places. The live
page contains the tables (`make web`), and its engine accepts no other values.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple


def _table(name: str) -> Any:
    """Return a table that the live page contains, too."""
    return json.loads(Path(__file__).with_name(name).read_text(encoding="utf-8"))


_ROWS: dict[str, dict[str, Any]] = _table("settings.json")
TERMS: list[dict[str, Any]] = _table("equation.json")  # of eq. (7)
CHALLENGE_TABLE: dict[str, Any] = _table("challenges.json")
LIMIT_TABLE: dict[str, Any] = _table("limits.json")  # sentences about what limits a robot


class Setting(NamedTuple):
    """A control: its name, its range in its own unit, and its initial value."""

    name: str
    places: str = ""  # "live", "playground", "lesson": the pages that have it
    symbol: str = ""
    unit: str = ""
    section: str = ""  # of the panel
    low: float = 0.0
    high: float = 0.0  # of a push in robot weights, of a payload in robot masses
    step: float = 0.0
    first: float = 0.0  # of a push in robot weights
    scale: float = 1.0  # SI units per unit

    @property
    def range(self) -> tuple[float, float, float]:
        """Smallest and largest value, and step."""
        return self.low, self.high, self.step

    def of_weight(self, weight: float) -> Setting:
        """Return the setting of a push in newtons, for a robot of this weight [N]."""
        return self._replace(
            high=5.0 * math.ceil(self.high * weight / 5.0),
            first=max(self.step, round(self.first * weight)),
        )

    @property
    def label(self) -> str:
        """Text of the control, such as "CoM x [cm]"."""
        unit = f"[{self.unit}]" if self.unit else ""
        return " ".join(part for part in (self.name, self.symbol, unit) if part)


SETTINGS = {key: Setting(**row) for key, row in _ROWS.items()}


def push_settings(weight: float) -> dict[str, Setting]:
    """Return the settings of a push of a robot of this weight [N]."""
    force = SETTINGS["push"].of_weight(weight)
    return {"force": force, "towards": SETTINGS["towards"], "duration": SETTINGS["duration"]}
