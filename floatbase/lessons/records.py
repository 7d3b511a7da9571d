"""Texts of the course as data: tables in TOML files, which authors edit without programming."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, TypeVar

from floatbase.errors import InputError

Record = TypeVar("Record")


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file. A line break in a text counts as a space."""
    try:
        return dict(_joined_lines(tomllib.loads(path.read_text(encoding="utf-8"))))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path.name} is not a TOML file: {error}.") from None


def _joined_lines(value: Any) -> Any:
    if isinstance(value, str):
        return " ".join(value.split())
    if isinstance(value, dict):
        return {key: _joined_lines(part) for key, part in value.items()}
    return [_joined_lines(part) for part in value] if isinstance(value, list) else value


def records(rows: list[dict[str, Any]], kind: type[Record]) -> list[Record]:
    """Convert rows of a table to objects of a class, whose fields are the entries of a row."""
    found = []
    for row in rows:
        try:
            found.append(kind(**row))
        except TypeError as error:
            raise InputError(f"{row} has a wrong or missing entry: {error}.") from None
    return found
