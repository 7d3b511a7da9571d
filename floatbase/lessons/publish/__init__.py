"""Tools that run, store, map and publish the lessons: `python -m floatbase.lessons.publish`."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from floatbase.lessons.publish.contents import README, lesson_table, readme_with_table, title_of
from floatbase.lessons.publish.duration import lesson_counts, lesson_minutes
from floatbase.lessons.publish.notebooks import (
    execute_notebook,
    lesson_file,
    read_notebook,
    run_and_store,
    with_solutions,
    write_solutions,
)
from floatbase.lessons.publish.workspace import (
    MY_FOLDER,
    NOTEBOOKS,
    lesson_notebooks,
    prepare_workspace,
)

if TYPE_CHECKING:
    from floatbase.lessons.publish import conventions, equations, grades, pictures, site

# imported at first use; the last needs the extra `site`
_LAZY_MODULES = ("conventions", "equations", "grades", "pictures", "site")

__all__ = [
    "MY_FOLDER",
    "NOTEBOOKS",
    "README",
    "conventions",
    "equations",
    "execute_notebook",
    "grades",
    "lesson_counts",
    "lesson_file",
    "lesson_minutes",
    "lesson_notebooks",
    "lesson_table",
    "pictures",
    "prepare_workspace",
    "read_notebook",
    "readme_with_table",
    "run_and_store",
    "site",
    "title_of",
    "with_solutions",
    "write_solutions",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _LAZY_MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}.")
    return import_module(f"{__name__}.{name}")
