"""The page of conventions: the text of `floatbase.conventions`, and every tolerance with its reason."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import floatbase
from floatbase import conventions

_PACKAGE = Path(floatbase.__file__).parent
_WITHOUT_TOLERANCES = ("lessons", "viewer")  # their numbers choose what is drawn, not what is answered
# NAME = 1e-9  # the reason; or a tuple, a quotient, or a number made by float() or int()
_TOLERANCE = re.compile(r"^_?([A-Z][A-Z0-9_]*)(?:: \w+)? = ((?:[-(\d]|float\(|int\()[^#\"\n]*)  # (.+)$", re.MULTILINE)


def page() -> str:
    """The page of conventions as Markdown."""
    first, *rest = (conventions.__doc__ or "").split("\n", 1)
    rows = [f"| {room} | `{name}` | {value} | {reason} |" for room, name, value, reason in tolerances()]
    return "\n".join(
        [
            "# Conventions",
            "",
            first,
            *rest,
            "Tolerances",
            "----------",
            "Every number that decides a case, where it stands, and why it is what it is. Made from the code by",
            "`python -m floatbase.lessons.publish map`; do not edit.",
            "",
            "| file | name | value | meaning and reason |",
            "|---|---|---|---|",
            *rows,
            "",
        ]
    )


def tolerances() -> Iterator[tuple[str, str, str, str]]:
    """File, name, value and reason of every numeric constant of the package, each as its source states it."""
    for path in sorted(_PACKAGE.rglob("*.py")):
        place = path.relative_to(_PACKAGE)
        if place.parts[0] not in _WITHOUT_TOLERANCES:
            for name, value, reason in _TOLERANCE.findall(path.read_text(encoding="utf-8")):
                yield place.with_suffix("").as_posix(), name, value, reason.replace("|", "\\|")
