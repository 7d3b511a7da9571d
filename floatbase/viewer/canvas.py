"""The picture that a window shows: told what it should be, it sends only what is different."""

from __future__ import annotations

from floatbase.viewer import wire
from floatbase.viewer.shapes import Item, Picture
from floatbase.viewer.window import Window

ROOT = "/meshcat/"


class Canvas:
    """A window that is drawn on by whole pictures: path -> item. What a picture does not hold is removed."""

    def __init__(self, window: Window):
        self.window = window
        self.picture: Picture = {}
        self._torn = False
        self._settings: dict[wire.Key, bytes] = {}

    def draw(self, picture: Picture) -> int:
        """Show this picture and nothing else, in one frame; return how many commands that took."""
        updates = [wire.delete(ROOT)] if self._torn else []
        old: Picture = {} if self._torn else self.picture
        updates += [wire.delete(ROOT + path) for path in old if path not in picture]
        for path, item in picture.items():
            updates += _changes(ROOT + path, old.get(path), item)
        if updates:
            self._torn = True  # stays so when an interrupt comes between here and the end: the next picture starts afresh
            self.window.put(updates)
        self.picture = dict(picture)
        self._torn = False
        return len(updates)

    def set(self, *updates: wire.Update) -> None:
        """Send settings of the page, as background, camera and title, but those that are so already."""
        fresh = [(key, command) for key, command in updates if self._settings.get(key) != command]
        if fresh:
            self.set_again(*fresh)

    def set_again(self, *updates: wire.Update) -> None:
        """Send settings of the page, also those that are so already: the reader may have changed them there."""
        self.window.put(updates)
        self._settings.update(updates)


def _changes(path: str, old: Item | None, new: Item) -> list[wire.Update]:
    """The commands that lead from one item to another at the same path."""
    updates = []
    anew = old is None or old.shape is not new.shape
    if anew:
        updates.append(wire.set_object(path, new.shape.packed))
    if old is None or (old.matrix is not new.matrix and old.matrix.tobytes() != new.matrix.tobytes()):
        updates.append(wire.set_transform(path, new.matrix))
    if new.colour is not None and (anew or old is None or old.colour != new.colour):
        updates.append(wire.set_property(path, "color", list(new.colour)))
    return updates
