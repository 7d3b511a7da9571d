"""The sections, equations and notes of the course text, read from `formulas.toml`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from floatbase.lessons.records import read_toml, records


@dataclass(frozen=True)
class Section:
    """A section of the course text, such as "§2.1" or "App. A", with a summary."""

    number: str
    title: str
    summary: str


@dataclass(frozen=True)
class Formula:
    """An equation of the course text."""

    number: str
    section: str
    title: str
    latex: str
    meaning: str


_DATA = read_toml(Path(__file__).with_name("formulas.toml"))
SECTIONS = records(_DATA["section"], Section)
FORMULAS = records(_DATA["formula"], Formula)
NOTES: dict[str, str] = _DATA["notes"]
