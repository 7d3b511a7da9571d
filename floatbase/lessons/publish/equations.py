"""The page of equations: each equation with its functions and lessons.

A public docstring that cites the course text, as in "[FBR]_, eq. (9)." or "[FBR]_, App. A.",
implements that equation. Public names are those that a package exports. A lesson counts if the
metadata of one of its cells says that it teaches the equation. `formulas` contains the equations
themselves. The checks of the repository require a test that names each function.
"""

from __future__ import annotations

import ast
import inspect
import pkgutil
import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import floatbase
from floatbase.lessons.publish.contents import GENERATED, equations_taught, title_of
from floatbase.lessons.publish.formulas import FORMULAS, NOTES, SECTIONS, Formula
from floatbase.lessons.publish.workspace import NOTEBOOKS, lesson_notebooks

TITLES = {formula.number: formula.title for formula in FORMULAS}
_CITATION = re.compile(
    r"\[FBR\]_,\s+(?:eqs?\.\s+)?((?:(?:\(\d+\)|App\. [ABC])(?:,?\s+(?:and\s+)?|-)?)+)"
)
_LEADING_NUMBERS = re.compile(r"\s*((?:\(\d+\))+|App\. [ABC])")
_NUMBER = re.compile(r"\(\d+\)|App\. [ABC]")
_TESTS = Path(floatbase.__file__).parents[1] / "tests"
_SKIPPED_PACKAGES = ("viewer", "lessons", "playground")  # packages that show and teach them


@dataclass(frozen=True)
class Entry:
    """A public name that implements equations."""

    path: str
    equations: tuple[str, ...]
    tests: tuple[str, ...]


def entries() -> list[Entry]:
    """List every public name whose docstring cites an equation or an appendix, with its tests."""
    named = _tests_by_name()
    found = []
    for path, docstring, makers in _public_objects():
        cited = " ".join(_CITATION.findall(docstring))
        if start := _LEADING_NUMBERS.match(docstring):
            cited = start[1] + cited
        if cited:
            tests = set().union(*(named.get(maker, set()) for maker in makers))
            if path.count(".") > 1:  # package.Class.member
                tests &= named.get(path.rsplit(".", 1)[1], set())
            found.append(
                Entry(path, tuple(dict.fromkeys(_NUMBER.findall(cited))), tuple(sorted(tests)))
            )
    return found


def table() -> str:
    """Write the page as Markdown."""
    found = entries()
    taught = {path.name: equations_taught(path) for path in lesson_notebooks().values()}
    lines = [
        "# Equations",
        "",
        "Every equation of the course text *Controlling Floating-Based Robots*, by section, with "
        "the functions that implement it and",
        "the lessons that teach it. Import a function such as `dynamics.forces_from_torques` with",
        "`from floatbase.dynamics import forces_from_torques`.",
    ]
    for section in SECTIONS:
        lines += ["", f"## {section.number} {section.title}", "", section.summary]
        for formula in (formula for formula in FORMULAS if formula.section == section.number):
            lessons = [name for name, those in taught.items() if formula.number in those]
            lines += _equation_lines(
                formula, [entry for entry in found if formula.number in entry.equations], lessons
            )
    lines += ["", "## Notes of the course text", "", "The lessons name some of them by number.", ""]
    lines += [f"{number}. {note}" for number, note in NOTES.items()]
    return "\n".join([*lines, "", GENERATED]) + "\n"


def _equation_lines(formula: Formula, found: list[Entry], lessons: list[str]) -> list[str]:
    """Write the lines of one equation: formula, meaning, functions, lessons."""
    appendix = formula.number == formula.section
    tag = "" if appendix else f" \\tag{{{formula.number.strip('()')}}}"
    return [
        *([] if appendix else ["", f"### {formula.number} {formula.title}"]),
        *("", f"$${formula.latex}{tag}$$", "", formula.meaning, ""),
        f"- functions: {', '.join(f'`{entry.path}`' for entry in found)}",
        f"- lessons: {', '.join(f'[{title_of(NOTEBOOKS / name)}]({name})' for name in lessons)}",
    ]


def _public_objects() -> Iterator[tuple[str, str, list[str]]]:
    """Yield path, docstring and the names of makers of every public name and member, once each."""
    own = list(_exported_objects())
    for package, name, value in own:
        makers = [name] + [maker for _, maker, made in own if _returns(made) == name]
        yield f"{package}.{name}", inspect.getdoc(value) or "", makers
        for member, thing in (
            vars(value).items() if inspect.isclass(value) and not _is_protocol(value) else ()
        ):
            if not member.startswith("_"):
                yield f"{package}.{name}.{member}", inspect.getdoc(thing) or "", makers


def _exported_objects() -> Iterator[tuple[str, str, object]]:
    """Yield package, name and value of each object that a package exports and defines itself."""
    for found in pkgutil.iter_modules(floatbase.__path__):
        if found.name.startswith("_") or found.name in _SKIPPED_PACKAGES:
            continue
        package = import_module(f"floatbase.{found.name}")
        for name in getattr(package, "__all__", vars(package)):
            value, home = getattr(package, name), f"{package.__name__}."
            if not name.startswith("_") and f"{getattr(value, '__module__', None)}.".startswith(
                home
            ):
                yield found.name, name, value


def _is_protocol(value: type) -> bool:
    """Whether a class is a protocol."""
    return bool(getattr(value, "_is_protocol", False))


def _returns(value: object) -> str:
    """Return the annotated return type of a function, as text."""
    return str(getattr(value, "__annotations__", {}).get("return", ""))


def _tests_by_name() -> dict[str, set[str]]:
    """Map each name to the tests that use it, directly or through a helper of the same file."""
    found: dict[str, set[str]] = {}
    for path in sorted(_TESTS.rglob("test_*.py")):
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        functions = {
            node.name: _identifiers(node) for node in nodes if isinstance(node, ast.FunctionDef)
        }
        for test, names in functions.items():
            if test.startswith("test_"):
                address = f"{path.relative_to(_TESTS).as_posix()}::{test}"
                helpers = [functions[name] for name in sorted(names) if name in functions]
                for name in sorted(names.union(*helpers)):
                    found.setdefault(name, set()).add(address)
    return found


def _identifiers(node: ast.AST) -> set[str]:
    """Return all names and attributes below a node."""
    names = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
    return names | {n.attr for n in ast.walk(node) if isinstance(n, ast.Attribute)}
