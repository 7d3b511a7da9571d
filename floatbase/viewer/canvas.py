"""The canvas: it is given whole pictures, and sends the window only what changes from one to the next."""

from __future__ import annotations

from floatbase.viewer import wire
from floatbase.viewer.shapes import Item, Picture, tidy
from floatbase.viewer.window import Window

ROOT = "/meshcat/"


class Canvas:
    """Draws whole pictures (path -> item) into a window. What the next picture does not contain is removed.

    picture: what the window shows now.
    """

    def __init__(self, window: Window):
        self.window = window
        self.picture: Picture = {}
        self._interrupted = False
        self._settings: dict[wire.Key, bytes] = {}

    def draw(self, picture: Picture, *settings: wire.Update) -> int:
        """Show this picture and nothing else. Returns how many commands that took; all go into one frame.

        settings: of the page, as for `set`, that go into the same frame.
        """
        picture = tidy(picture)
        updates = [wire.delete(ROOT)] if self._interrupted else []
        old: Picture = {} if self._interrupted else self.picture
        gone = [path for path, item in old.items() if not _stays(item, picture.get(path))]
        updates += [wire.delete(ROOT + path) for path in gone]
        deleted = tuple(f"{path}/" for path in gone)
        for path, item in picture.items():
            updates += _changes(ROOT + path, None if f"{path}/".startswith(deleted) else old.get(path), item)
        fresh = self._fresh(settings)
        updates += fresh
        if updates:
            self._interrupted = True  # stays so when an interrupt comes before the end: the next picture is drawn anew
            self.window.put(updates)
        self.picture = picture
        self._interrupted = False
        self._settings.update(fresh)
        return len(updates)

    def set(self, *updates: wire.Update) -> None:
        """Send settings of the page (background, camera, title and the like), except those that were sent already."""
        fresh = self._fresh(updates)
        if fresh:
            self.set_again(*fresh)

    def set_again(self, *updates: wire.Update) -> None:
        """Send settings of the page, also those that were sent already: the reader may have changed them in the page."""
        self.window.put(updates)
        self._settings.update(updates)

    def _fresh(self, updates: tuple[wire.Update, ...]) -> list[wire.Update]:
        """Those settings that were not sent already."""
        return [(key, command) for key, command in updates if self._settings.get(key) != command]


def _stays(old: Item, new: Item | None) -> bool:
    """Whether the item at a path can become `new`. One that loses its colour is drawn anew: no command takes it back."""
    return new is not None and (old.colour is None or new.colour is not None)


def _changes(path: str, old: Item | None, new: Item) -> list[wire.Update]:
    """The commands that change the item at a path from `old`, None if there is none, to `new`."""
    updates = []
    anew = old is None or old.shape is not new.shape
    if anew:
        updates.append(wire.set_object(path, new.shape.packed))
    if old is None or (old.matrix is not new.matrix and old.matrix.tobytes() != new.matrix.tobytes()):
        updates.append(wire.set_transform(path, new.matrix))
    if new.colour is not None and (anew or old is None or old.colour != new.colour):
        updates.append(wire.set_property(path, "color", list(new.colour)))
    return updates
