"""The page of conventions: the text of `floatbase.conventions`, and every threshold of the code."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import floatbase
from floatbase import conventions
from floatbase.lessons.publish.contents import GENERATED

_PACKAGE = Path(floatbase.__file__).parent
# their numbers choose what is drawn, not what is answered
_SKIPPED_PACKAGES = ("lessons", "live", "viewer")
# NAME = 1e-9  # the reason; the value may be a tuple, a quotient, or a call of float() or int().
# The reason may be in comment lines above.
_VALUE = r"^_?([A-Z][A-Z0-9_]*)(?:: \w+)? = ((?:[-(\d]|float\(|int\()[^#\"\n]+)"
_TOLERANCE = re.compile(rf"((?:^# [^\n]+\n)*){_VALUE}(?:  # ([^\n]+))?$", re.MULTILINE)


def page() -> str:
    """Write the page as Markdown."""
    first, *rest = _with_symbol_table(conventions.__doc__ or "").split("\n", 1)
    rows = [
        f"| {package} | `{name}` | {value} | {reason} |"
        for package, name, value, reason in tolerances()
    ]
    return "\n".join(
        [
            "# Conventions",
            "",
            first,
            *rest,
            "",
            "Tolerances",
            "----------",
            "Every threshold in the code: where it is and why it has that value.",
            "",
            "| file | name | value | meaning and reason |",
            "|---|---|---|---|",
            *rows,
            "",
            GENERATED,
            "",
        ]
    )


def _with_symbol_table(text: str) -> str:
    """Turn the indented lines of the text, symbols and their meaning, into a table."""
    lines: list[str] = []
    symbol = re.compile(r"^    (\S.*?)\s{2,}(.+)$")
    for line in text.splitlines():
        found = symbol.match(line)
        if found and not (lines and lines[-1].startswith("| ")):
            lines += ["", "| symbol | meaning |", "|---|---|"]
        if found:
            lines.append(f"| {found[1]} | {re.sub(' +', ' ', found[2])} |")
        elif line.startswith("    "):
            lines[-1] = f"{lines[-1][:-2]} {line.strip()} |"
        else:
            lines.append(line)
    return "\n".join(lines)


def tolerances() -> Iterator[tuple[str, str, str, str]]:
    """Yield file, name, value and reason of every numeric constant, as the source states them."""
    for path in sorted(_PACKAGE.rglob("*.py")):
        place = path.relative_to(_PACKAGE)
        if place.parts[0] not in _SKIPPED_PACKAGES:
            for above, name, value, beside in _TOLERANCE.findall(path.read_text(encoding="utf-8")):
                reason = beside or " ".join(line[2:] for line in above.splitlines())
                if reason:
                    yield (
                        place.with_suffix("").as_posix(),
                        name,
                        value.strip(),
                        reason.replace("|", "\\|"),
                    )
