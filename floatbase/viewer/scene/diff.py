"""Renderer that sends only the differences between successive pictures."""

from __future__ import annotations

from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.shapes import Item, Picture, with_normal_paths
from floatbase.viewer.transport.window import Window


class DiffRenderer:
    """Draws whole pictures into a window by sending only what changes."""

    def __init__(self, window: Window):
        self.window = window
        self.picture: Picture = {}
        self._interrupted = False
        self._settings: dict[protocol.Key, bytes] = {}

    def draw(self, picture: Picture, *settings: protocol.Update) -> int:
        """Show this picture and nothing else."""
        picture = with_normal_paths(picture)
        updates = [protocol.delete(protocol.ROOT)] if self._interrupted else []
        old: Picture = {} if self._interrupted else self.picture
        removed_paths = [
            path for path, item in old.items() if not _can_become(item, picture.get(path))
        ]
        updates += [protocol.delete(protocol.ROOT + path) for path in removed_paths]
        deleted = tuple(f"{path}/" for path in removed_paths)
        for path, item in picture.items():
            before = None if f"{path}/".startswith(deleted) else old.get(path)
            updates += _changes(protocol.ROOT + path, before, item)
        new_settings = self._unsent(settings)
        updates += new_settings
        if updates:
            # remains True if an interrupt comes before the end; the next picture is then drawn anew
            self._interrupted = True
            self.window.put(updates)
        self.picture = picture
        self._interrupted = False
        self._settings.update(new_settings)
        return len(updates)

    def set(self, *updates: protocol.Update) -> None:
        """Send the settings of the page that have changed, such as background, camera or title."""
        new_settings = self._unsent(updates)
        if new_settings:
            self.force_set(*new_settings)

    def force_set(self, *updates: protocol.Update) -> None:
        """Send settings of the page even if unchanged, because the user may have altered them."""
        self.window.put(updates)
        self._settings.update(updates)

    def _unsent(self, updates: tuple[protocol.Update, ...]) -> list[protocol.Update]:
        """Return the settings that differ from those already sent."""
        return [(key, command) for key, command in updates if self._settings.get(key) != command]


def _can_become(old: Item, new: Item | None) -> bool:
    """Return whether the item at a path can change into `new`."""
    return new is not None and (old.colour is None or new.colour is not None)


def _changes(path: str, old: Item | None, new: Item) -> list[protocol.Update]:
    """Return the commands that change the item at a path from `old` (None if absent) to `new`."""
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
