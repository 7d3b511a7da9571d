"""What runs, stores, maps and publishes the lessons."""

from floatbase.lessons.publish.notebooks import FOLDER, execute, read, run, solved, without_outputs
from floatbase.lessons.publish.workspace import MINE, prepare

__all__ = [
    "FOLDER",
    "MINE",
    "execute",
    "prepare",
    "read",
    "run",
    "solved",
    "without_outputs",
]
