"""Which page of a window shows what: the newest display in a notebook is live, earlier ones keep the picture they had."""

from __future__ import annotations

from floatbase.viewer.wire import Scene

KEPT = 20  # pictures kept at most; what they share with each other and with the live scene is held once


class Displays:
    """The displays of one scene, numbered from 1 as they open.

    A new display usually shows what its cell has just drawn. So an earlier one keeps the scene as it was before that cell
    began, or when the last display opened, whichever is later; `mark` is to be called before each cell.
    """

    def __init__(self, scene: Scene):
        self.newest = 0
        self._scene = scene
        self._before = scene.copy()
        self._kept: dict[int, Scene] = {}

    def mark(self) -> None:
        """What is drawn from here on belongs to the next display."""
        self._before = self._scene.copy()

    def open(self) -> int:
        """Open a display and return its number; the one before keeps its picture from here on."""
        if self.newest:
            self._kept[self.newest] = self._before
            self._kept.pop(self.newest - KEPT, None)
        self.newest += 1
        self.mark()
        return self.newest

    def kept(self, number: int) -> Scene | None:
        """The scene that a display keeps; None for one that is live, unknown, or too old."""
        return self._kept.get(number)
