"""Rows of a sweep in a JSON Lines file, from which an interrupted sweep resumes."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from floatbase._files import LARGEST_DATA, file_errors, open_file, read_file
from floatbase.errors import InputError, SimulationWarning, require, warn

if TYPE_CHECKING:
    from pandas import DataFrame

RESERVED_NAMES = ("point", "error")  # columns that the store itself writes
Row = dict[str, Any]


def read_sweep(path: str | Path) -> DataFrame:
    """Read the file of a sweep, finished or not.

    Parameters
    ----------
    path : str or Path
        Path of the file.

    Returns
    -------
    pandas.DataFrame
        A table like that of `sweep`, with all rows of the file.

    Raises
    ------
    InputError
        If the file cannot be read or was not written by a sweep.
    """
    advice = "Pass the path of a sweep's file."
    with file_errors("path", path, "rows.jsonl", "cannot be read", advice):
        content = read_file(path, LARGEST_DATA)
    _, found = _read_rows(path, content)
    rows = [row for same in found.values() for row, _ in same]
    return as_frame(dict(enumerate(sorted(rows, key=itemgetter("point")))))


def as_frame(rows: Mapping[int, Row]) -> DataFrame:
    """Return rows, as point number -> row, as a `pandas.DataFrame` that ends in "error"."""
    pandas, points = require("pandas", "sweep"), sorted(rows)
    names = dict.fromkeys(name for i in points for name in rows[i] if name not in RESERVED_NAMES)
    index = pandas.Index(points, name="point")
    return pandas.DataFrame([rows[i] for i in points], index, [*names, "error"])


class RowStore:
    """Rows of a sweep, as point number -> row, which are also written to a file if there is one."""

    # a line that describes the sweep begins the file, and another one follows where the function
    # was edited; each other line is a completed point. The file is locked while the store is open,
    # and an incomplete last line is removed

    def __init__(self, path: str | Path | None, name: str, source: str, points: Sequence[Row]):
        self.rows: dict[int, Row] = {}
        self._path, self._file = path, -1
        if path is None:
            return
        with file_errors("file", path, "rows.jsonl", "cannot be written to", "Pass another file."):
            self._file = open_file(path, os.O_RDWR | os.O_CREAT | os.O_APPEND)
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._resume(path, _header(name, source, points), points)
            except BaseException:
                self.close()
                raise

    def add(self, i: int, row: Row) -> None:
        """Store the row of point i, as JSON values, and write it to the file at once."""
        self.rows[i] = row
        if self._file >= 0:
            self._write({"point": i, **row})

    def close(self) -> None:
        """Close the file and release its lock."""
        if self._file >= 0:
            if not os.fstat(self._file).st_nlink:
                warn(
                    f"{self._path} was removed while the sweep ran, so no file has its rows. They "
                    f"are in the table that sweep returns; save the table.",
                    SimulationWarning,
                )
            os.close(self._file)
            self._file = -1

    def _resume(self, path: str | Path, header: Row, points: Sequence[Row]) -> None:
        """Read the rows of these points after checking that the file belongs to this sweep."""
        content = read_file(path, LARGEST_DATA)
        complete_lines = content[: content.rfind(b"\n") + 1]
        if not complete_lines and json.dumps(header).encode().startswith(content):
            os.ftruncate(self._file, 0)
            self._write(header)
            return
        found, rows = _read_rows(path, content)
        there, here = _described(found), _described(header)
        if there != here:
            raise _wrong_file_error(path, f"holds a sweep of {there}, not of {here}")
        edited, present = 0, header["source"]  # "" if it is not known
        for i, point in enumerate(points):
            if same := rows.get(_key(point, header)):  # a point may be twice in the grid
                self.rows[i], source = same.pop(0)
                is_older = source != present and "" not in (source, present)
                edited += is_older and self.rows[i]["error"] is None
        if edited:
            warn(
                f"{found['sweep']}, its setup, or code that they use was edited after {edited} of "
                f"the rows in {path} were computed. These rows are kept. To compute them again, "
                f"pass another file, or remove this one.",
                SimulationWarning,
            )
        os.ftruncate(self._file, len(complete_lines))
        if found != header:
            self._write(header)

    def _write(self, row: Row) -> None:
        """Write a line to the file."""
        advice = (
            "All earlier rows are saved. "
            "Once the file can be written to again, run the same sweep to resume."
        )
        data = json.dumps(row).encode() + b"\n"
        with file_errors("file", self._path, "rows.jsonl", "cannot be written to", advice):
            while data:  # a full disk takes only part of a line: the next attempt gives the reason
                data = data[os.write(self._file, data) :]


def as_json_value(what: str, value: Any) -> Any:
    """Convert a value to what JSON returns for it; raise `InputError`, with its name `what`."""
    try:
        return json.loads(json.dumps(value, default=_from_numpy))
    except (TypeError, ValueError) as error:
        kinds = "numbers, strings, booleans, None, and lists, dicts or NumPy arrays of them"
        raise InputError(f"{what} cannot be stored: {error}. Use {kinds}.") from None


def _from_numpy(value: Any) -> Any:
    """Convert a value of NumPy for JSON."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"it holds a value of type {type(value).__name__}")


def _header(name: str, source: str, points: Sequence[Row]) -> Row:
    """Return the line of a file that describes the sweep."""
    parameters = sorted({name for point in points for name in point})
    return {"sweep": name, "parameters": parameters, "source": source}


def _key(row: Row, header: Row) -> str:
    """Return the parameters of a row as a string."""
    return json.dumps({name: row[name] for name in header["parameters"] if name in row})


def _read_rows(path: str | Path, content: bytes) -> tuple[Row, dict[str, list[tuple[Row, str]]]]:
    """Return the last description of the sweep, and by `_key` the rows of each point.

    Each row has the source of its function. Rows with an error count until a later one is there.
    """
    header: Row = {}
    rows: dict[str, list[tuple[Row, str]]] = {}
    lines = content.split(b"\n")
    for number, line in enumerate(lines[:-1] or lines, start=1):
        try:
            row = dict(json.loads(line))
            if "point" not in row:
                header = {name: row[name] for name in _header("", "", [])}
                continue
            key = _key(row, header)
            same = [old for old in rows.get(key, []) if old[0]["error"] is None]
            rows[key] = [*same, (row, header["source"])]
        except (ValueError, TypeError, LookupError, RecursionError):
            if not header:
                raise _wrong_file_error(path, "was not written by a sweep") from None
            raise InputError(
                f"Line {number} of {path} is not a row of a sweep: {line[:80]!r}. Remove the line, "
                "and run the sweep again."
            ) from None
    return header, rows


def _described(header: Row) -> str:
    """Return the function and the parameters of a sweep."""
    return f"{header['sweep']} over {', '.join(header['parameters']) or 'no parameters'}"


def _wrong_file_error(path: str | os.PathLike[str], what: str) -> InputError:
    """Return the error for a file that does not belong to this sweep."""
    return InputError(f"{path} {what}. It was not changed. Pass another file, or remove this one.")
