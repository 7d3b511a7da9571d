"""The house stands: floors import downwards, the front door stays small, every name is explained."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest

import floatbase

PACKAGE = Path(floatbase.__file__).parent
# from the ground up; rooms named on one line stand side by side on one floor and may see each other
FLOORS = (
    ("conventions", "errors", "_arrays", "_assets", "affine", "linear_algebra"),
    ("qp",),
    ("robots",),
    ("dynamics",),
    ("objectives",),
    ("friction",),
    ("control",),
    ("actuators",),
    ("simulation",),
    ("viewer",),
    ("lessons",),
    ("__main__",),
)
HEIGHT = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if "_assets" not in path.parts)
# the front door sees every floor; what it may load at once is the business of test_environment
INDOORS = [path for path in MODULES if path != PACKAGE / "__init__.py"]


def module_id(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Line and floatbase module of every import that happens when the program runs."""
    yield from _imports(ast.parse(path.read_text(encoding="utf-8")), ("floatbase", *path.relative_to(PACKAGE).parts[:-1]))


def _imports(node: ast.AST, package: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            for other in child.orelse:
                yield from _imports(other, package)
        elif isinstance(child, ast.Import):
            yield from ((child.lineno, alias.name) for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            base = package[: len(package) - child.level + 1] if child.level else ()
            module = ".".join([*base, *([child.module] if child.module else [])])
            # `from floatbase import viewer` names the room after the word import
            yield from ((child.lineno, f"{module}.{alias.name}" if module == "floatbase" else module) for alias in child.names)
        else:
            yield from _imports(child, package)


def test_every_room_has_a_floor() -> None:
    assert {room(path) for path in INDOORS} <= set(HEIGHT)


@pytest.mark.parametrize("path", INDOORS, ids=module_id)
def test_every_floor_imports_only_the_floors_below(path: Path) -> None:
    own = HEIGHT[room(path)]
    wrong = []
    for line, module in imports(path):
        package, *rest = module.split(".")
        if package != "floatbase" or not rest:
            continue  # `import floatbase as fb`: the front door, for the uppermost floors; checked below
        if HEIGHT.get(rest[0], -1) > own:
            wrong.append(f"{module_id(path)}:{line} imports {module}, a floor above its own")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("path", INDOORS, ids=module_id)
def test_only_lessons_and_the_command_line_use_the_front_door(path: Path) -> None:
    used = [line for line, module in imports(path) if module == "floatbase"]
    assert not used or HEIGHT[room(path)] >= HEIGHT["lessons"], f"{module_id(path)}:{used} imports floatbase itself"


@pytest.mark.parametrize("path", MODULES, ids=module_id)
def test_every_module_says_what_it_is_and_leaves_nothing_open(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    assert path.parent.name == "_assets" or ast.get_docstring(ast.parse(source)), f"{module_id(path)} has no docstring"
    assert not any(word in source for word in ("TODO", "FIXME", "XXX"))


def test_the_front_door_has_at_most_30_names() -> None:
    assert len(set(floatbase.__all__)) == len(floatbase.__all__) <= 30


@pytest.mark.parametrize("name", floatbase.__all__)
def test_every_name_resolves_and_has_a_docstring(name: str) -> None:
    value = getattr(floatbase, name)
    doc = inspect.getdoc(value)
    assert doc, f"floatbase.{name} has no docstring"
    assert not doc.startswith(f"{name}("), f"floatbase.{name} has only the docstring that dataclass writes"


def test_the_front_door_lists_what_it_has() -> None:
    assert set(floatbase.__all__) <= set(dir(floatbase))
    with pytest.raises(AttributeError, match="no attribute 'Robit'"):
        _ = floatbase.Robit
