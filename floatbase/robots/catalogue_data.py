"""Data that the catalogue adds to the robots of example-robot-data; `loading` reads it."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from floatbase.robots.robot import Foot


@dataclass(frozen=True)
class CatalogueEntry:
    """Data that the catalogue adds to a robot of example-robot-data."""

    description: str
    feet: tuple[Foot, ...] = ()
    torque_limit: float | None = None
    joints: Mapping[str, float] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)


def _feet(frames: tuple[str, ...] = (), **shape: Any) -> tuple[Foot, ...]:
    """Return feet of one shape, the fields of a `Foot`, at several frames."""
    return tuple(Foot(frame, **shape) for frame in frames)


_TABLES = tomllib.loads(Path(__file__).with_name("catalogue.toml").read_text(encoding="utf-8"))
CATALOGUE: Mapping[str, CatalogueEntry] = {
    name: CatalogueEntry(**{**table, "feet": _feet(**table.get("feet", {}))})
    for name, table in _TABLES.items()
}
