"""Output of a viewer: saved files, static pages, and displays in notebooks."""

from __future__ import annotations

import html
from pathlib import Path
from typing import TYPE_CHECKING, Any

from floatbase._files import write_whole
from floatbase._validation import as_string
from floatbase.errors import ViewerError
from floatbase.robots import Robot
from floatbase.viewer.export import film, thumbnail
from floatbase.viewer.export.display_mode import MIMEBUNDLES, display_mode
from floatbase.viewer.scene.diff import DiffRenderer
from floatbase.viewer.transport.window import Window
from floatbase.viewer.web import pages

if TYPE_CHECKING:
    from ipywidgets import Widget


class Output:
    """Saved files and notebook displays of a viewer's scene."""

    robot: Robot
    height: int
    window: Window
    renderer: DiffRenderer

    def save(
        self, path: str | Path, title: str | None = None, size: tuple[int, int] = (960, 600)
    ) -> Path:
        """Write the scene to a file in the format of its extension."""
        target = Path(as_string("path", str(path) if isinstance(path, Path) else path))
        if self.window.scene.is_empty:
            raise ViewerError(
                "Nothing has been drawn yet, so there is nothing to save. Call show(state) or "
                "play(rollout) first."
            )
        size = film.checked_size(size)
        if target.suffix.lower() not in (".html", ".htm", *film.FRAME_RATES):
            raise ViewerError(
                f"Cannot save {target.name!r}: unknown file type. Use a name that ends in .html, "
                f".mp4, .gif or .png."
            )
        try:
            if target.suffix.lower() in film.FRAME_RATES:
                film.capture(self.static_html(title), target, size)
            else:
                write_whole(target, self.static_html(title).encode(), keep_link=True)
        except OSError as error:
            raise ViewerError(
                f"Cannot write {target} ({error.strerror}). Choose an existing folder in which you "
                f"may write, with free space."
            ) from None
        return target

    def static_html(self, title: str | None = None) -> str:
        """Return the current scene as one HTML page that needs neither server nor network."""
        title = "" if title is None else as_string("title", title)
        return pages.file_page(self.window.scene.file_commands(), title or self.robot.name)

    def widget(self) -> Widget:
        """Make a widget that shows the picture, for use in panels."""
        if self._is_static:
            import ipywidgets

            return ipywidgets.HTML(self._static_frame(), layout=ipywidgets.Layout(width="auto"))
        image = thumbnail.render_png(self.renderer.picture, self.window.scene, self.height)
        return self.window.widget(self.robot.name, self.height, image)

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        """Return the live picture, and an image of it for readers that cannot show widgets."""
        if (bundle := MIMEBUNDLES.get(display_mode())) is not None:
            return bundle(self)
        if self._is_static:
            return {"text/html": self._static_frame()}
        picture = self.widget()
        data, metadata = thumbnail.with_thumbnail(picture._repr_mimebundle_(**kwargs), picture)
        return {**data, "text/plain": repr(self)}, metadata

    @property
    def _is_static(self) -> bool:
        """Whether a display is only a copy of the scene."""
        return display_mode() == "static" or not self.window.is_open

    def _static_frame(self) -> str:
        """Return the current scene as an HTML frame that needs no kernel."""
        name = html.escape(self.robot.name)
        style = f"width: 100%; height: {self.height}px; border: 0; border-radius: 6px"
        return (
            f'<iframe srcdoc="{html.escape(self.static_html())}" title="{name}" '
            f'style="{style}"></iframe>'
        )
