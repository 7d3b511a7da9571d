"""Rows of a sweep in a JSON Lines file, from which an interrupted sweep resumes."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from floatbase._files import LARGEST_DATA, open_file, read_file
from floatbase._validation import short_repr
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
        A table like that of `sweep`; its index holds the numbers of the completed points.

    Raises
    ------
    InputError
        If the file cannot be read or was not written by a sweep.
    """
    with _file_errors("path", path, "cannot be read", "Give the path of a sweep's file."):
        content = read_file(path, LARGEST_DATA)
    return as_frame(_read_rows(path, content))


def as_frame(rows: Mapping[int, Row]) -> DataFrame:
    """Return rows, as point number -> row, as a `pandas.DataFrame` that ends in "error"."""
    pandas, points = require("pandas", "sweep"), sorted(rows)
    names = dict.fromkeys(name for i in points for name in rows[i] if name != "error")
    index = pandas.Index(points, name="point")
    return pandas.DataFrame([rows[i] for i in points], index, [*names, "error"])


class RowStore:
    """Rows of a sweep, as point number -> row, which are also written to a file if there is one."""

    # the first line of the file describes the sweep, and each further line is a completed point;
    # the file is locked while the store is open, and an incomplete last line is removed

    def __init__(self, path: str | Path | None, name: str, points: Sequence[Row]):
        self.rows: dict[int, Row] = {}
        self._path, self._file = path, -1
        if path is None:
            return
        with _file_errors("file", path, "cannot be written to", "Give another file."):
            self._file = open_file(path, os.O_RDWR | os.O_CREAT | os.O_APPEND)
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._resume(path, _header(name, points), points)
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
        """Read the file after checking that it belongs to this sweep, or begin an empty one."""
        content = read_file(path, LARGEST_DATA)
        complete_lines = content[: content.rfind(b"\n") + 1]
        if not complete_lines and json.dumps(header).encode().startswith(content):
            os.ftruncate(self._file, 0)
            self._write(header)
            return
        found = _read_header(path, content)
        labels = {"sweep": "function", "parameters": "parameters", "points": "number of points"}
        for key, what in labels.items():
            if (there := found[key]) != header[key]:
                what = f"with the {what} {_joined(there)}, not {_joined(header[key])}"
                raise _wrong_file_error(path, what)
        if found["grid"] != header["grid"]:
            raise _wrong_file_error(path, "with the same parameters but different values")
        self.rows = _read_rows(path, complete_lines)
        for i, row in self.rows.items():
            if i not in range(len(points)) or json.dumps(row | points[i]) != json.dumps(row):
                raise _wrong_file_error(
                    path, f"whose point {i} has other parameters, because the file was edited"
                )
        os.ftruncate(self._file, len(complete_lines))

    def _write(self, row: Row) -> None:
        """Write a line to the file."""
        advice = (
            "All earlier rows are saved. "
            "Once the file can be written to again, run the same sweep to resume."
        )
        data = json.dumps(row).encode() + b"\n"
        with _file_errors("file", self._path, "cannot be written to", advice):
            while data:  # a full disk takes only part of a line: the next attempt gives the reason
                data = data[os.write(self._file, data) :]


@contextmanager
def _file_errors(argument: str, path: Any, what: str, advice: str) -> Iterator[None]:
    """Raise `InputError` if the path does not name a file, or if the body cannot use the file."""
    if not isinstance(path, str | os.PathLike):
        raise InputError(
            f'{argument} must be a path, such as "rows.jsonl", not {short_repr(path)}.'
        )
    try:
        yield
    except InputError:
        raise
    except BlockingIOError:
        raise InputError(
            f"Another sweep is writing to {path}. Wait until it ends, or pass another file."
        ) from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = getattr(error, "strerror", error)
        raise InputError(f"{path} {what}: {reason}. {advice}") from None


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


def _header(name: str, points: Sequence[Row]) -> Row:
    """Return the first line of a file, which describes the sweep."""
    parameters = list(dict.fromkeys(name for point in points for name in point))
    digest = hashlib.sha256("\n".join(json.dumps(point) for point in points).encode()).hexdigest()
    return {"sweep": name, "parameters": parameters, "points": len(points), "grid": digest[:16]}


def _read_header(path: str | Path, content: bytes) -> Row:
    """Return the first line of a sweep's file, checked."""
    try:
        found = json.loads(content.split(b"\n", 1)[0])
        if set(found) == set(_header("", [])):
            return dict(found)
    except (ValueError, TypeError, RecursionError):
        pass
    raise _wrong_file_error(path, "that no sweep has written")


def _read_rows(path: str | Path, content: bytes) -> dict[int, Row]:
    """Return point number -> row for all complete lines of a sweep's file."""
    _read_header(path, content)
    rows: dict[int, Row] = {}
    for number, line in enumerate(content.split(b"\n")[1:-1], start=2):
        try:
            row = json.loads(line)
            rows[int(row.pop("point"))] = row
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            raise InputError(
                f"Line {number} of {path} is not a row of a sweep: {line[:80]!r}. Remove the line, "
                "and run the sweep again."
            ) from None
    return rows


def _joined(value: Any) -> str:
    """Return a value as a string; a list as its entries with commas."""
    return ", ".join(value) if isinstance(value, list) else str(value)


def _wrong_file_error(path: str | os.PathLike[str], what: str) -> InputError:
    """Return the error for a file that does not belong to this sweep."""
    return InputError(
        f"{path} is a file {what}. It was not changed. Give another file, or remove this one."
    )
