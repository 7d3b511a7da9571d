"""The canvas: it is given whole pictures, and sends the window only what changes from one to the
next.
"""

from __future__ import annotations

from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.shapes import Item, Picture, with_normal_paths
from floatbase.viewer.transport.window import Window

ROOT = "/meshcat/"


class DiffRenderer:
    """Draws whole pictures (path -> item) into a window. What the next picture does not contain is
    removed.

    picture: what the window shows now.
    """

    def __init__(self, window: Window):
        self.window = window
        self.picture: Picture = {}
        self._interrupted = False
        self._settings: dict[protocol.Key, bytes] = {}

    def draw(self, picture: Picture, *settings: protocol.Update) -> int:
        """Show this picture and nothing else. Returns how many commands that took; all go into one
        frame.

        settings: of the page, as for `set`, that go into the same frame.
        """
        picture = with_normal_paths(picture)
        updates = [protocol.delete(ROOT)] if self._interrupted else []
        old: Picture = {} if self._interrupted else self.picture
        removed_paths = [
            path for path, item in old.items() if not _can_become(item, picture.get(path))
        ]
        updates += [protocol.delete(ROOT + path) for path in removed_paths]
        deleted = tuple(f"{path}/" for path in removed_paths)
        for path, item in picture.items():
            updates += _changes(
                ROOT + path, None if f"{path}/".startswith(deleted) else old.get(path), item
            )
        new_settings = self._unsent(settings)
        updates += new_settings
        if updates:
            # stays so when an interrupt comes before the end: the next picture is drawn anew
            self._interrupted = True
            self.window.put(updates)
        self.picture = picture
        self._interrupted = False
        self._settings.update(new_settings)
        return len(updates)

    def set(self, *updates: protocol.Update) -> None:
        """Send settings of the page (background, camera, title and the like), except those that
        were sent already.
        """
        new_settings = self._unsent(updates)
        if new_settings:
            self.force_set(*new_settings)

    def force_set(self, *updates: protocol.Update) -> None:
        """Send settings of the page, also those that were sent already: the reader may have changed
        them in the page.
        """
        self.window.put(updates)
        self._settings.update(updates)

    def _unsent(self, updates: tuple[protocol.Update, ...]) -> list[protocol.Update]:
        """Those settings that were not sent already."""
        return [(key, command) for key, command in updates if self._settings.get(key) != command]


def _can_become(old: Item, new: Item | None) -> bool:
    """Whether the item at a path can become `new`. One that loses its colour is drawn anew: no
    command takes it back.
    """
    return new is not None and (old.colour is None or new.colour is not None)


def _changes(path: str, old: Item | None, new: Item) -> list[protocol.Update]:
    """The commands that change the item at a path from `old`, None if there is none, to `new`."""
    updates = []
    is_new = old is None or old.shape is not new.shape
    if is_new:
        updates.append(protocol.set_object(path, new.shape.packed))
    if old is None or (
        old.matrix is not new.matrix and old.matrix.tobytes() != new.matrix.tobytes()
    ):
        updates.append(protocol.set_transform(path, new.matrix))
    if new.colour is not None and (is_new or old is None or old.colour != new.colour):
        updates.append(protocol.set_property(path, "color", list(new.colour)))
    return updates
