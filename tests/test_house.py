"""The house stands: floors import downwards, packages are entered by their fronts, files are small,
every name is explained.
"""

from __future__ import annotations

import ast
import inspect
import json
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import NamedTuple, get_origin

from messages import raises

import floatbase

PACKAGE = Path(floatbase.__file__).parent
ROOT = PACKAGE.parent
# from the ground up; packages named on one line stand side by side on one floor and may see each
# other
FLOORS = (
    ("conventions", "errors", "_validation", "_geometry", "_assets", "affine", "linear_algebra"),
    ("qp",),
    ("robots",),
    ("dynamics",),
    ("objectives",),
    ("friction",),
    ("control",),
    ("actuators",),
    ("simulation",),
    ("behaviours",),
    ("viewer",),
    ("lessons",),
    ("playground",),
    ("__main__",),
)
HEIGHT = {package: height for height, packages in enumerate(FLOORS) for package in packages}
MOST_LINES = 450  # of a file: more is two ideas
CIRCLE = {
    "robots/robot.py",
    "robots/standing.py",
    "robots/state.py",
}  # what robot.standing() and state.robot cost
COMPILED = {
    "floatbase.control.tick.jit",
    "floatbase.control.tick.tick",
}  # numba loads with them, so no front imports them
MODULES = sorted(
    path for path in PACKAGE.rglob("*.py") if "_assets" not in path.relative_to(PACKAGE).parts[:-1]
)
# the front door sees every floor; what it may load at once is the business of test_environment
INDOORS = [path for path in MODULES if path != PACKAGE / "__init__.py"]
TESTS = sorted((ROOT / "tests").rglob("*.py"))
OUTDOORS = [
    *TESTS,
    *sorted((ROOT / "benchmarks").rglob("*.py")),
    *sorted((ROOT / "notebooks").glob("*.ipynb")),
]
PACKAGES = [
    ".".join(path.parent.relative_to(ROOT).parts) for path in INDOORS if path.name == "__init__.py"
]


class Import(NamedTuple):
    """One name that is imported; `import module` names none."""

    line: int
    module: str
    name: str | None


def said(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def floor(path: Path) -> int:
    return HEIGHT[path.relative_to(PACKAGE).parts[0].removesuffix(".py")]


def file_of(module: str) -> Path | None:
    """Where a module of the package stands."""
    folder = ROOT.joinpath(*module.split("."))
    return next(
        (path for path in (folder / "__init__.py", folder.with_suffix(".py")) if path in MODULES),
        None,
    )


@cache
def parsed(path: Path) -> ast.Module:
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        source = "\n".join(
            "".join(cell["source"])
            for cell in json.loads(source)["cells"]
            if cell["cell_type"] == "code"
        )
    return ast.parse(source)


@cache
def imports(path: Path) -> list[Import]:
    """All imports from the package that happen when the program runs, inside functions too."""
    blocks = [
        node
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
    ]
    for_types = {inner for block in blocks for line in block.body for inner in ast.walk(line)}
    found = []
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import) and node not in for_types:
            found += [Import(node.lineno, alias.name, None) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node not in for_types:
            assert not node.level or path not in MODULES, (
                f"{said(path)}:{node.lineno} imports by dots, not by name"
            )
            for name in [alias.name for alias in node.names]:
                # `from floatbase import viewer` is the module behind the word import, `from
                # floatbase import Viewer` is a name
                inner, outer = f"{node.module}.{name}", str(node.module)
                found.append(
                    Import(node.lineno, inner, None)
                    if file_of(inner)
                    else Import(node.lineno, outer, name)
                )
    return [one for one in found if one.module.split(".")[0] == "floatbase"]


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Sets of files that reach one another."""
    reach = {node: set(targets) for node, targets in graph.items()}
    for middle in graph:  # Warshall: whoever reaches the middle reaches what the middle reaches
        for found in reach.values():
            if middle in found:
                found |= reach[middle]
    rings = {frozenset(other for other in reach[node] if node in reach[other]) for node in graph}
    return [set(ring) for ring in rings if ring]


def test_every_room_has_a_floor() -> None:
    assert {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in INDOORS} <= set(
        HEIGHT
    )


def test_every_floor_imports_only_the_floors_below() -> None:
    wrong = []
    for path in INDOORS:
        for found in imports(path):
            if found.module == "floatbase":
                if floor(path) < HEIGHT["lessons"]:
                    wrong.append(
                        f"{said(path)}:{found.line} imports floatbase itself, which is for the "
                        f"floors from lessons up"
                    )
            elif HEIGHT[found.module.split(".")[1]] > floor(path):
                wrong.append(
                    f"{said(path)}:{found.line} imports {found.module}, a floor above its own"
                )
    assert not wrong, "\n".join(wrong)


def test_rooms_are_entered_by_their_fronts() -> None:
    wrong = []
    for path in [*INDOORS, *OUTDOORS]:
        for found in imports(path):
            front, _, inner = found.module.rpartition(".")
            entered = file_of(front) if front and front != "floatbase" else None
            if found.module in COMPILED or (entered and entered.parent in path.parents):
                continue  # the latter is at home in the package
            if private(inner):
                continue  # shared between packages, but not part of the public API
            if found.module in PACKAGES:
                if found.name and found.name not in import_module(found.module).__all__:
                    wrong.append(
                        f"{said(path)}:{found.line} imports {found.name}, which {found.module} "
                        f"does not export"
                    )
            elif entered and inner not in import_module(front).__all__:
                wrong.append(
                    f"{said(path)}:{found.line} imports from {found.module}, a file inside {front}"
                )
    assert not wrong, "\n".join(dict.fromkeys(wrong))


def test_nothing_imports_in_a_circle_but_robot_state_and_standing() -> None:
    names = {path: path.relative_to(PACKAGE).as_posix() for path in INDOORS}
    graph = {
        names[path]: {
            names[to] for found in imports(path) if (to := file_of(found.module)) in names
        }
        for path in INDOORS
    }
    others = [" - ".join(sorted(circle)) for circle in circles(graph) if circle != CIRCLE]
    assert not others, "\n".join(others)


def test_every_module_is_short_says_what_it_is_and_leaves_nothing_open() -> None:
    wrong = []
    for path in MODULES:
        source = path.read_text(encoding="utf-8")
        if len(source.splitlines()) > MOST_LINES:
            wrong.append(f"{said(path)} has {len(source.splitlines())} lines")
        if not ast.get_docstring(parsed(path)):
            wrong.append(f"{said(path)} has no docstring")
        wrong += [
            f"{said(path)} holds a {word}" for word in ("TODO", "FIXME", "XXX") if word in source
        ]
    assert not wrong, "\n".join(wrong)


def test_every_exported_name_resolves_and_has_a_docstring() -> None:
    wrong = []
    for package in ["floatbase", *PACKAGES]:
        module = import_module(package)
        for name in getattr(module, "__all__", []):
            value = getattr(module, name)
            doc = inspect.getdoc(value) or ""
            explains_itself = inspect.ismodule(value) or (callable(value) and not get_origin(value))
            if explains_itself and (
                not doc or doc.startswith(f"{name}(")
            ):  # dataclass writes one that starts so
                wrong.append(f"{package}.{name} has no docstring of its own")
    assert not wrong, "\n".join(wrong)


def test_the_front_door_has_at_most_32_names_and_lists_them() -> None:
    assert len(set(floatbase.__all__)) == len(floatbase.__all__) <= 32
    assert set(floatbase.__all__) <= set(dir(floatbase))
    with raises(AttributeError, "Robit"):
        _ = floatbase.Robit


def test_tests_use_public_names() -> None:
    wrong = []
    for path in TESTS:
        for node in ast.walk(parsed(path)):
            if (
                isinstance(node, ast.Attribute)
                and private(node.attr)
                and ast.unparse(node.value) not in ("self", "cls")
            ):
                wrong.append(f"{said(path)}:{node.lineno} uses {ast.unparse(node)}")
        for found in imports(path):
            if private(found.name or ""):
                wrong.append(f"{said(path)}:{found.line} imports {found.name or found.module}")
    assert not wrong, "\n".join(wrong)


def private(name: str) -> bool:
    """Whether a name is one's own business; `_repr_html_` and `__main__` are agreed with others."""
    return name.startswith("_") and not name.endswith("_")
