"""The rows of a sweep in a JSON Lines file, from which an interrupted sweep resumes."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from floatbase._validation import short_repr
from floatbase.errors import InputError

if TYPE_CHECKING:
    from pandas import DataFrame

RESERVED_NAMES = ("point", "error")  # columns that the store itself writes
Row = dict[str, Any]


def require(library: str) -> Any:
    """Import an optional library of sweeps. Raises `InputError` if it is not installed."""
    try:
        return import_module(library)
    except ImportError:
        raise InputError(f'A sweep needs {library}: pip install "floatbase[sweep]".') from None


def read_sweep(path: str | Path) -> DataFrame:
    """Read the file of a sweep, finished or not, as a `pandas.DataFrame` like that of `sweep`.

    The index holds the numbers of the points that are done. Raises `InputError` for a file that
    cannot be read or holds no sweep.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    return as_frame(_read_rows(path, content))


def as_frame(rows: Mapping[int, Row]) -> DataFrame:
    """Rows, number of the point -> row, as a `pandas.DataFrame` whose last column is "error"."""
    pandas, points = require("pandas"), sorted(rows)
    names = dict.fromkeys(name for i in points for name in rows[i] if name != "error")
    return pandas.DataFrame(
        [rows[i] for i in points],
        index=pandas.Index(points, name="point"),
        columns=[*names, "error"],
    )


class RowStore:
    """The rows of a sweep, number of the point -> row; with a path, also in a file, to which they
    are added as they come.

    The file is JSON Lines: first a line that says what is swept, then a line for each point that is
    done. It is locked while the store is open. A last line that was not written to its end is cut
    off.

    path: of the file; None keeps nothing.
    name: of the function.
    points: parameters of all points, in plain values.
    Raises `InputError` for a file that holds something else, that another sweep is writing to, or
    that cannot be written to.
    """

    def __init__(self, path: str | Path | None, name: str, points: Sequence[Row]):
        self.rows: dict[int, Row] = {}
        self._path, self._points, self._file = path, points, -1
        if path is None:
            return
        if not isinstance(path, str | os.PathLike):
            raise InputError(
                f'file must be the path of a file, such as "rows.jsonl", not {short_repr(path)}.'
            )
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._resume(path, _header(name, points))
        except BlockingIOError:
            self.close()
            raise InputError(
                f"another sweep is writing to {path}; wait for its end, or give another file."
            ) from None
        except OSError as error:
            self.close()
            raise InputError(f"{path} cannot be written to: {error.strerror}.") from None
        except BaseException:
            self.close()
            raise

    def add(self, i: int, row: Row) -> None:
        """Keep the row of point i, in plain values, and write it to the file at once.

        Raises `InputError` if the file cannot be written to, such as on a full disk.
        """
        self.rows[i] = row
        if self._file >= 0:
            self._write(json.dumps({"point": i, **row}))

    def close(self) -> None:
        """Close the file, and free it for others."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _resume(self, path: str | Path, header: Row) -> None:
        """Read what the file holds, after checking that it is of this sweep; begin it where it is
        empty.
        """
        content = Path(path).read_bytes()
        complete_lines = content[: content.rfind(b"\n") + 1]
        if not complete_lines and json.dumps(header).encode().startswith(content):
            os.ftruncate(self._file, 0)
            self._write(json.dumps(header))
            return
        found = _read_header(path, content)
        for key, what in (
            ("sweep", "the function"),
            ("parameters", "the parameters"),
            ("points", "the number of points"),
        ):
            if found[key] != header[key]:
                raise _wrong_file_error(
                    path, f"of {what} {_joined(found[key])}, this sweep has {_joined(header[key])}"
                )
        if found["grid"] != header["grid"]:
            raise _wrong_file_error(path, "of the same parameters at other values")
        self.rows = _read_rows(path, complete_lines)
        for i, row in self.rows.items():
            point = self._points[i] if 0 <= i < len(self._points) else {}
            if not point or json.dumps({name: row.get(name) for name in point}) != json.dumps(
                point
            ):
                raise _wrong_file_error(
                    path, f"where point {i} has other parameters: it was changed by hand"
                )
        os.ftruncate(self._file, len(complete_lines))

    def _write(self, line: str) -> None:
        data = line.encode() + b"\n"
        try:
            while data:  # what a full disc takes is a part: the next attempt says why
                data = data[os.write(self._file, data) :]
        except OSError as error:
            again = (
                "The rows before are kept: once the file takes more, the same sweep goes on "
                "from them."
            )
            raise InputError(
                f"{self._path} cannot be written to: {error.strerror}. {again}"
            ) from None


def as_json_value(what: str, value: Any) -> Any:
    """A value as JSON gives it back: numbers, texts, booleans, None, lists and dicts of them;
    numpy's become Python's.

    Raises `InputError` with `what`, a name, for anything else.
    """
    try:
        return json.loads(json.dumps(value, default=_from_numpy))
    except (TypeError, ValueError) as error:
        kinds = "numbers, texts, booleans, None, and lists, dicts or numpy arrays of them"
        raise InputError(f"{what} cannot be stored: {error}. A table holds {kinds}.") from None


def _from_numpy(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"it holds a value of type {type(value).__name__}")


def _header(name: str, points: Sequence[Row]) -> Row:
    """The first line of a file: what is swept."""
    parameters = list(dict.fromkeys(name for point in points for name in point))
    digest = hashlib.sha256("\n".join(json.dumps(point) for point in points).encode()).hexdigest()
    return {"sweep": name, "parameters": parameters, "points": len(points), "grid": digest[:16]}


def _read_header(path: str | Path, content: bytes) -> Row:
    """The first line of a file of a sweep."""
    try:
        found = json.loads(content.split(b"\n", 1)[0])
        if set(found) == set(_header("", [])):
            return dict(found)
    except (ValueError, TypeError):
        pass
    raise _wrong_file_error(path, "of no sweep")


def _read_rows(path: str | Path, content: bytes) -> dict[int, Row]:
    """Number of the point -> row, of all whole lines of a file of a sweep."""
    _read_header(path, content)
    rows: dict[int, Row] = {}
    for number, line in enumerate(content.split(b"\n")[1:-1], start=2):
        try:
            row = json.loads(line)
            rows[int(row.pop("point"))] = row
        except (ValueError, TypeError, KeyError, AttributeError):
            advice = "Remove it, and sweep again."
            raise InputError(
                f"line {number} of {path} is no row of a sweep: {line[:80]!r}. {advice}"
            ) from None
    return rows


def _joined(value: Any) -> str:
    return ", ".join(value) if isinstance(value, list) else str(value)


def _wrong_file_error(path: str | Path, what: str) -> InputError:
    return InputError(
        f"{path} is a file {what}; it is left as it is. Give another file, or remove this one."
    )
