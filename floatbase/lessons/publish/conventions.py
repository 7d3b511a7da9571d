"""The page of conventions: the text of `floatbase.conventions`, and every tolerance with its
reason.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path

import floatbase
from floatbase import conventions

_PACKAGE = Path(floatbase.__file__).parent
_SKIPPED_PACKAGES = (
    "lessons",
    "viewer",
)  # their numbers choose what is drawn, not what is answered
_NAME = re.compile(r"_?([A-Z][A-Z0-9_]*)")
# a number, a tuple, a quotient, or a number made by float() or int()
_VALUE = re.compile(r"[-(\d]|float\(|int\(")


def page() -> str:
    """The page of conventions as Markdown."""
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
            "Every number that decides a case, where it stands, and why it is what it is. Made "
            "from the code by",
            "`python -m floatbase.lessons.publish map`; do not edit.",
            "",
            "| file | name | value | meaning and reason |",
            "|---|---|---|---|",
            *rows,
            "",
        ]
    )


def _with_symbol_table(text: str) -> str:
    """The text with its indented lines, which are symbols and their meaning, as a table of
    Markdown.
    """
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
    """File, name, value and reason of every numeric constant of the package, each as its source
    states it: the reason is the comment beside the constant or on the lines above.
    """
    for path in sorted(_PACKAGE.rglob("*.py")):
        place = path.relative_to(_PACKAGE)
        if place.parts[0] in _SKIPPED_PACKAGES:
            continue
        source = path.read_text(encoding="utf-8")
        for node in ast.parse(source).body:
            if isinstance(node, ast.AnnAssign | ast.Assign) and node.value is not None:
                target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
                name = _NAME.fullmatch(ast.unparse(target))
                value = _in_one_line(ast.get_source_segment(source, node.value) or "")
                reason = _comment(source.splitlines(), node.lineno, node.end_lineno or node.lineno)
                if name and reason and '"' not in value and _VALUE.match(value):
                    package = place.with_suffix("").as_posix()
                    yield package, name[1], value, reason.replace("|", "\\|")


def _in_one_line(value: str) -> str:
    words = " ".join(re.sub(r"#.*", "", value).split())
    return words.replace("( ", "(").replace(", )", ")")


def _comment(lines: list[str], first: int, last: int) -> str:
    """The comments on these lines, from 1, or where there are none, on the lines right above."""
    beside = [line.split("  # ", 1)[1] for line in lines[first - 1 : last] if "  # " in line]
    above = list(takewhile(lambda line: line.startswith("# "), reversed(lines[: first - 1])))
    return " ".join(beside or [line[2:] for line in reversed(above)])
