"""The structure of the package: layers, public APIs and circular imports."""

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from messages import raises

import floatbase
from floatbase.lessons.publish import read_notebook

PACKAGE = Path(floatbase.__file__).parent
ROOT = PACKAGE.parent
# from the lowest; packages of one layer may import each other
LAYERS = """
    conventions errors _validation _assets _browser _files _geometry _locks affine linear_algebra
    qp _blas
    robots
    dynamics
    objectives
    friction
    control
    actuators
    simulation
    behaviours
    viewer
    live
    playground
    lessons
    doctor __main__
"""
LAYER_OF = {name: layer for layer, line in enumerate(LAYERS.split("\n")) for name in line.split()}
# the price of robot.standing() and state.robot
ALLOWED_CIRCLE = {"robots/robot.py", "robots/standing.py", "robots/state.py"}
# numba loads with them, so no __init__ imports them
COMPILED = {
    "floatbase.behaviours.walk.compiled_targets",
    "floatbase.control.tick.dynamics",
    "floatbase.control.tick.jit",
    "floatbase.control.tick.tick",
}
MODULES = sorted(
    path
    for path in PACKAGE.rglob("*.py")
    if not {"_assets", "node_modules"} & set(path.relative_to(PACKAGE).parts[:-1])
)
# floatbase/__init__.py may import every layer; test_environment checks what it loads
LAYERED = [path for path in MODULES if path != PACKAGE / "__init__.py"]
TESTS = sorted((ROOT / "tests").rglob("*.py"))
USERS = [
    *TESTS,
    *sorted((ROOT / "benchmarks").rglob("*.py")),
    *sorted((ROOT / "examples").rglob("*.py")),
    *sorted((ROOT / "notebooks").glob("*.ipynb")),
]
PACKAGES = [
    ".".join(path.parent.relative_to(ROOT).parts) for path in LAYERED if path.name == "__init__.py"
]


class Import(NamedTuple):
    """One imported name, None for `import module`."""

    line: int
    module: str
    name: str | None


def relative(path):
    return path.relative_to(ROOT).as_posix()


def layer(path):
    return LAYER_OF[path.relative_to(PACKAGE).parts[0].removesuffix(".py")]


@cache
def file_of(module):
    """The file of a module of the package."""
    folder = ROOT.joinpath(*module.split("."))
    files = (folder / "__init__.py", folder.with_suffix(".py"))
    return next((path for path in files if path in MODULES), None)


@cache
def parsed(path):
    if path.suffix == ".ipynb":
        cells = read_notebook(path).cells
        return ast.parse("\n".join(c.source for c in cells if c.cell_type == "code"))
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def nodes(path):
    return list(ast.walk(parsed(path)))


@cache
def imports(path):
    """All imports of the package's modules at run time, also inside functions."""
    branches = [node for node in nodes(path) if isinstance(node, ast.If)]
    blocks = [node for node in branches if "TYPE_CHECKING" in ast.unparse(node.test)]
    for_types = {inner for block in blocks for line in block.body for inner in ast.walk(line)}
    found = []
    for node in nodes(path):
        if isinstance(node, ast.Import) and node not in for_types:
            found += [Import(node.lineno, alias.name, None) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node not in for_types:
            assert not node.level or path not in MODULES, (
                f"{relative(path)}:{node.lineno} is a relative import"
            )
            for name in [alias.name for alias in node.names]:
                # `from floatbase import viewer` imports a module, `from floatbase import Viewer`
                # a name
                inner, outer = f"{node.module}.{name}", str(node.module)
                target = (inner, None) if file_of(inner) else (outer, name)
                found.append(Import(node.lineno, *target))
    return [one for one in found if one.module.split(".")[0] == "floatbase"]


def test_every_module_has_a_layer():
    assert {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in LAYERED} <= set(
        LAYER_OF
    )


def test_modules_import_only_their_own_layer_and_lower_ones():
    wrong = []
    for path in LAYERED:
        for found in imports(path):
            if found.module == "floatbase":
                if layer(path) < LAYER_OF["playground"]:
                    wrong.append(f"{relative(path)}:{found.line} imports floatbase itself")
            elif LAYER_OF[found.module.split(".")[1]] > layer(path):
                wrong.append(f"{relative(path)}:{found.line} imports {found.module}, a layer above")
    assert not wrong, "\n".join(wrong)


def test_no_module_of_the_package_is_imported_by_a_string():
    """Except by an `__init__`, which is lazy; lessons are found by the names of their folders."""
    wrong = []
    for path in [path for path in MODULES if path.name != "__init__.py"]:
        for node in nodes(path):
            if not isinstance(node, ast.Call) or not node.args:
                continue
            called, module = ast.unparse(node.func).rpartition(".")[2], node.args[0]
            if called in ("import_module", "__import__") and "floatbase" in ast.unparse(module):
                by_folder = isinstance(module, ast.JoinedStr) and "lessons" in path.parts
                if not by_folder:
                    wrong.append(f"{relative(path)}:{node.lineno} imports {ast.unparse(module)}")
    assert not wrong, "\n".join(wrong)


def test_packages_are_imported_by_their_public_names():
    """Or by a module with a leading underscore; a package whose `__all__` is empty has modules for
    the packages above it. A package's own modules may import one another.
    """
    wrong = []
    for path in [*LAYERED, *USERS]:
        for found in imports(path):
            outer, _, inner = found.module.rpartition(".")
            package = file_of(outer) if outer and outer != "floatbase" else None
            if found.module in COMPILED or inner.startswith("_"):
                continue
            if outer in ("floatbase.lessons", "floatbase.lessons.publish") and (
                path in TESTS or path.name == "__main__.py"
            ):
                continue  # the tools of the course, which no other package uses
            if package and (top_folder(package) in path.parents):
                continue
            if found.module in PACKAGES:
                if found.name and found.name not in public_names(found.module):
                    wrong.append(
                        f"{relative(path)}:{found.line} imports {found.name}, which "
                        f"{found.module} does not export"
                    )
            elif package and inner not in (public := public_names(outer)) and public:
                wrong.append(f"{relative(path)}:{found.line} imports {found.module}, a module")
    assert not wrong, "\n".join(dict.fromkeys(wrong))


@cache
def public_names(package):
    """Return the names in `__all__` or, as in a lesson, the names that `__init__` imports."""
    listed = getattr(import_module(package), "__all__", None)
    if listed is None:
        path = file_of(package)
        assert path
        return [found.name for found in imports(path) if found.name]
    return list(listed)


def top_folder(path):
    return PACKAGE / path.relative_to(PACKAGE).parts[0]


def test_only_robot_state_and_standing_import_one_another():
    """The order of the other modules has no circle, or graphlib raises and names it."""
    names = {path: path.relative_to(PACKAGE).as_posix() for path in LAYERED}
    TopologicalSorter(
        {
            name: {names[to] for found in imports(path) if (to := file_of(found.module)) in names}
            - (ALLOWED_CIRCLE if name in ALLOWED_CIRCLE else set())
            for path, name in names.items()
        }
    ).prepare()


def test_no_lock_stays_locked_after_an_interrupt():
    calls = {relative(path): re.findall(r"\bLock\(\)", path.read_text("utf-8")) for path in MODULES}
    assert not any(calls.values()), "use InterruptibleLock of floatbase._locks"


def test_floatbase_has_at_most_33_names_and_lists_them():
    assert len(set(floatbase.__all__)) == len(floatbase.__all__) <= 33
    assert set(floatbase.__all__) <= set(dir(floatbase))
    with raises(AttributeError, "Robit"):
        _ = floatbase.Robit


def test_tests_use_public_names():
    wrong = []
    for path in TESTS:
        for node in nodes(path):
            if (
                isinstance(node, ast.Attribute)
                and is_private(node.attr)
                and ast.unparse(node.value) not in ("self", "cls")
            ):
                wrong.append(f"{relative(path)}:{node.lineno} uses {ast.unparse(node)}")
        for found in imports(path):
            if is_private(found.name or ""):
                wrong.append(f"{relative(path)}:{found.line} imports {found.name}")
    assert not wrong, "\n".join(wrong)


def private_names_of_others(path, own_names):
    """Private attributes and imports of a module whose names its own package does not define."""
    found = []
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Attribute) and is_private(node.attr):
            used = ast.unparse(node)
            is_own = node.attr in own_names or ast.unparse(node.value) in ("self", "cls")
            if not is_own and used != "os._exit":
                found.append(f"{node.lineno} uses {used}")
        elif isinstance(node, ast.ImportFrom):
            names = [alias.name for alias in node.names if is_private(alias.name)]
            found += [
                f"{node.lineno} imports {name}"
                for name in names
                if name not in own_names and not file_of(f"{node.module}.{name}")
            ]
    return found


def defined_names(path):
    """All names that a module defines: functions, classes, variables and attributes."""
    names = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            names.add(node.attr if isinstance(node, ast.Attribute) else node.id)
    return names


def test_no_package_uses_private_names_of_another_package():
    names = {}
    for path in LAYERED:
        names.setdefault(top_folder(path), set()).update(defined_names(path))
    wrong = [
        f"{relative(path)}:{found}"
        for path in LAYERED
        for found in private_names_of_others(path, names[top_folder(path)])
    ]
    assert not wrong, "\n".join(wrong)


def test_private_names_of_another_package_are_found(tmp_path):
    path = tmp_path / "module.py"
    path.write_text(
        "from a import _b\nsim._c\nself._d\nwalk._own._own\nsim.made()._e\nx.__name__\n"
    )
    found = private_names_of_others(path, {"_own"})
    assert found == ["1 imports _b", "2 uses sim._c", "5 uses sim.made()._e"]


def is_private(name):
    """Whether a name is internal; `_repr_html_`, `__main__` and numba's `_getvalue` are not."""
    return name.startswith("_") and not name.endswith("_") and name != "_getvalue"
