"""What runs, stores, maps and publishes the lessons: `python -m floatbase.lessons.publish`.

`pages` and `prose` are imported by name: they need the extra `pages`.
"""

from floatbase.lessons.publish.contents import lesson_table, title_of
from floatbase.lessons.publish.notebooks import execute, read, run, solved
from floatbase.lessons.publish.workspace import FOLDER, MINE, prepare, without_outputs

__all__ = ["FOLDER", "MINE", "execute", "lesson_table", "prepare", "read", "run", "solved", "title_of", "without_outputs"]
