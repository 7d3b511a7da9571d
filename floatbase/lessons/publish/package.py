"""Copy the package to a folder: for students of an assignment, and for an autograder."""

from __future__ import annotations

import ast
import base64
import json
import re
import shutil
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

from floatbase._files import write_whole
from floatbase.errors import InputError
from floatbase.lessons import assignment
from floatbase.lessons.predictions import lesson_name
from floatbase.lessons.publish.contents import title_of
from floatbase.lessons.publish.workspace import NOTEBOOKS, lesson_notebooks, write_without_outputs

_ROOT = NOTEBOOKS.parent
_INSTALL = ("pyproject.toml", "environment.txt", "README.md", "LICENSE", "CITATION.cff")
_FOLDERS = ("floatbase", "assets/meshes", "assets/models")
_HUB = ".binder/jupyterhub_config.py"
_README = """# floatbase

Lessons of an interactive course on controlling floating-base robots:

{lessons}

You need make, and Python 3.11 to 3.14 or uv. `make lab` opens the lessons in JupyterLab. The first
run takes a minute or two. Your copies of the lessons are in `notebooks/my`.
[Installation and troubleshooting](docs/installation.md) helps when something fails, and
[How to use the course](notebooks/how_to.md) explains how to hand in your answers.
"""
_FIRST_LESSON = "00"  # explains how a lesson works
# arguments of an Exercise that give its answer away -> what replaces them
_SECRET = {"solution": '""', "explanation": '""', "examples": "tuple"}
_SOLUTION_MODULE = "lessonX/investigation.py"  # whose text is the solution of exercise X.3
# functions with which a lesson continues if an exercise is not solved
_DEFAULTS = {"lessonC/helpers.py": ("longest_step", "row_to_drop")}
_WORD = re.compile(r"\w+")
_Change: TypeAlias = tuple[ast.stmt | ast.expr, str]  # part of a module, and what replaces it


def lesson_paths(lessons: Sequence[str]) -> dict[str, Path]:
    """Return the notebook of each lesson, by its name."""
    known = lesson_notebooks()
    names = [lesson_name(name) for name in lessons]
    if unknown := [name for name in names if name not in known]:
        raise InputError(f"There is no lesson {unknown[0]!r}. The lessons are {', '.join(known)}.")
    return {name: known[name] for name in known if name in names}


@contextmanager
def package_copy(folder: Path) -> Iterator[None]:
    """Copy what `pip install` needs to a new folder: no tests and nothing that was built.

    The folder is removed if the block ends with an error, such as a full disk.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder} exists already. Choose a new folder: --to FOLDER.")
    unwanted = shutil.ignore_patterns("__pycache__", "node_modules", "test", assignment.FILE.name)
    try:
        for name in _FOLDERS:
            shutil.copytree(_ROOT / name, folder / name, ignore=unwanted)
        for name in (*_INSTALL, "assets/LICENSES.md"):
            shutil.copy(_ROOT / name, folder / name)
        yield
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def write_assignment(
    folder: Path,
    lessons: Sequence[str],
    *,
    teacher: str = "",
    until: str = "",
    with_solutions: bool = False,
) -> None:
    """Write a package for students with some lessons, and without solutions."""
    paths = lesson_paths([_FIRST_LESSON]) | lesson_paths(lessons)
    with package_copy(folder):
        _add_lessons(folder, paths)
        if with_solutions:
            return
        _remove_solutions(folder)
        found = {"lessons": list(lessons), "teacher": teacher, "until": until}
        target = folder / assignment.FILE.relative_to(_ROOT)
        write_whole(target, json.dumps(found, indent=1).encode())


def _add_lessons(folder: Path, paths: Mapping[str, Path]) -> None:
    """Add lessons with solutions, and what opens them, to a copy of the package."""
    shutil.copy(_ROOT / "Makefile", folder)
    shutil.copy(_ROOT / ".gitignore", folder)
    (folder / _HUB).parent.mkdir()
    shutil.copy(_ROOT / _HUB, folder / _HUB)
    names = "\n".join(f"- {title_of(path)}" for path in paths.values())
    (folder / "README.md").write_text(_README.format(lessons=names), encoding="utf-8")
    # the texts for teachers and contributors are not part of it
    (folder / "docs").mkdir()
    shutil.copy(_ROOT / "docs" / "installation.md", folder / "docs")
    (folder / "notebooks").mkdir()
    for source in [*paths.values(), *sorted(NOTEBOOKS.glob("*.md"))]:
        write_without_outputs(source, folder / "notebooks" / source.name)


def _remove_solutions(folder: Path) -> None:
    """Remove solutions, and the functions and constants that only solutions use."""
    lessons = folder / "floatbase/lessons"
    (lessons / _SOLUTION_MODULE).unlink()
    modules = {path: path.read_text(encoding="utf-8") for path in lessons.glob("lesson*/*.py")}
    modules = {path: _without_answers(text) for path, text in modules.items()}
    for name, functions in _DEFAULTS.items():
        modules[lessons / name] = _encoded(modules[lessons / name], functions)
    others = [path for path in folder.rglob("*") if path.suffix in (".py", ".ipynb")]
    elsewhere = Counter(
        _WORD.findall(
            "".join(path.read_text(encoding="utf-8") for path in others if path not in modules)
        )
    )
    while True:
        words = elsewhere + Counter(_WORD.findall("".join(modules.values())))
        pruned = {
            path: text if path.name == "__init__.py" else _without_unused(text, words)
            for path, text in modules.items()
        }
        if pruned == modules:
            break
        modules = pruned
    for path, text in modules.items():
        write_whole(path, text.encode())


def _without_answers(text: str) -> str:
    """Replace the arguments of exercises that give the answer away."""
    tree, module = ast.parse(text), Path(_SOLUTION_MODULE).stem
    replaced: list[_Change] = [
        (keyword.value, _SECRET[keyword.arg])
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and ast.unparse(call.func) == "Exercise"
        for keyword in call.keywords
        if keyword.arg in _SECRET
    ]
    replaced += [
        (node, "")
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and module in [alias.name for alias in node.names]
    ]
    return _replace(text, replaced)


def _encoded(text: str, functions: Sequence[str]) -> str:
    """Encode functions of a module: they still work, but cannot be read by accident."""
    replaced: list[_Change] = []
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef) and node.name in functions:
            source = ast.get_source_segment(text, node) or ""
            data = base64.b64encode(zlib.compress(source.encode())).decode()
            decode = '__import__("zlib").decompress(__import__("base64").b64decode'
            replaced.append((node, f'exec({decode}("{data}")))'))
    return _replace(text, replaced)


def _without_unused(text: str, words: Counter[str]) -> str:
    """Remove what nothing uses: imported names, and functions and constants of a module."""
    here = Counter(_WORD.findall(text))
    replaced: list[_Change] = []
    for node in ast.parse(text).body:
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("floatbase.lessons"):
            used = [alias.name for alias in node.names if here[alias.name] > 1]
            if len(used) < len(node.names):
                line = f"from {node.module} import {', '.join(used)}" if used else ""
                replaced.append((node, line))
        elif isinstance(node, ast.FunctionDef) and not node.decorator_list:
            replaced += [(node, "")] if words[node.name] == 1 else []
        elif isinstance(node, ast.Assign):
            targets = _WORD.findall(" ".join(ast.unparse(target) for target in node.targets))
            replaced += [(node, "")] if all(words[name] == 1 for name in targets) else []
    return _replace(text, replaced)


def _replace(text: str, nodes: Sequence[_Change]) -> str:
    """Replace the source of some nodes of a module's syntax tree."""
    data = text.encode()
    starts = [0]  # byte at which each line begins; the columns of `ast` are bytes
    for line in data.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    spans = [
        (
            starts[node.lineno - 1] + node.col_offset,
            starts[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0),
            new,
        )
        for node, new in nodes
    ]
    for start, end, new in sorted(spans, reverse=True):
        data = data[:start] + new.encode() + data[end:]
    return data.decode()
