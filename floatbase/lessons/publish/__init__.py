"""What runs, stores, maps and publishes the lessons: `python -m floatbase.lessons.publish`."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from floatbase.lessons.publish.contents import README, lesson_table, readme_with_table, title_of
from floatbase.lessons.publish.notebooks import execute, read, run, solved, write_solutions
from floatbase.lessons.publish.workspace import FOLDER, MINE, prepare

if TYPE_CHECKING:
    from floatbase.lessons.publish import conventions, equations, grades, pictures, site

_PARTS = ("conventions", "equations", "grades", "pictures", "site")  # imported at first use; the last needs the extra `site`

__all__ = [
    "FOLDER", "MINE", "README", "conventions", "equations", "execute", "grades", "lesson_table", "pictures", "prepare",
    "read", "readme_with_table", "run", "site", "solved", "title_of", "write_solutions",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _PARTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.{name}")
