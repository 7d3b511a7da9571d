"""Several displays of one viewer in a notebook: the newest is live, each earlier one keeps its
picture.
"""

from __future__ import annotations

from floatbase.viewer.scene.store import Scene

# pictures at most; they share their commands with each other and with the live scene
MAX_FROZEN = 20


class OutputHistory:
    """The displays of one scene, numbered from 1 in the order in which they open.

    A new display usually shows what its cell has just drawn. So the display before it keeps the
    scene as it was when that cell began, or when the display before it opened, if that was later.
    `begin_cell` must be called before each cell.
    """

    def __init__(self, scene: Scene):
        self.newest = 0
        self._scene = scene
        self._before = scene.copy()
        self._frozen: dict[int, Scene] = {}

    def begin_cell(self) -> None:
        """From now on, what is drawn belongs to the next display."""
        self._before = self._scene.copy()

    def open(self) -> int:
        """Open a display and return its number. The display before it keeps its picture from now
        on.
        """
        if self.newest:
            self._frozen[self.newest] = self._before
            self._frozen.pop(self.newest - MAX_FROZEN, None)
        self.newest += 1
        self.begin_cell()
        return self.newest

    def frozen(self, number: int) -> Scene | None:
        """The scene that a display keeps; None for a display that is live, unknown, or too old."""
        return self._frozen.get(number)
