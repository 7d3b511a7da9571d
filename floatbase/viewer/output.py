"""Output of a viewer: saved files, static pages, and displays in notebooks."""

from __future__ import annotations

import html
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    """Saves and displays the scene of a viewer."""

    robot: Robot
    height: int
    window: Window
    renderer: DiffRenderer

    def save(
        self, path: str | Path, title: str | None = None, size: tuple[int, int] = (960, 600)
    ) -> Path:
        """Write the scene to a file, by its name's ending, and return its path.

        path: .html is one page, still or moving, that needs neither server nor network. .mp4 and
            .gif are the recording at the speed of `play`, .png its first picture; these need a
            browser and `pip install "floatbase[video]"`.
        title: of the page.
        size: (width, height) of films and images in pixels, even numbers.

        Raises `ViewerError` when nothing is drawn yet, for another ending, and when it cannot be
        written.
        """
        target = Path(path if isinstance(path, Path) else as_string("path", path))
        if self.window.scene.is_empty:
            raise ViewerError(
                "nothing is drawn yet, so there is nothing to save; call show(state) or "
                "play(rollout) first."
            )
        size = film.checked_size(size)
        if target.suffix.lower() not in (".html", ".htm", *film.FRAME_RATES):
            raise ViewerError(
                f"cannot save {target.name!r}: end the name in .html, .mp4, .gif or .png."
            )
        try:
            if target.suffix.lower() in film.FRAME_RATES:
                film.capture(self.static_html(title), target, size)
            else:
                target.write_text(self.static_html(title), encoding="utf-8")
        except OSError as error:
            raise ViewerError(
                f"cannot write {target} ({error.strerror}); choose a folder that exists."
            ) from None
        return target

    def static_html(self, title: str | None = None) -> str:
        """The scene as it is now, as one HTML page that needs neither server nor network."""
        title = "" if title is None else as_string("title", title)
        return pages.file_page(self.window.scene.file_commands(), title or self.robot.name)

    def widget(self) -> Widget:
        """A widget that shows the picture, for panels: live, until the viewer is displayed again;
        then it shows the image of the picture with which it opened. Raises `ViewerError` without
        anywidget.

        Where FLOATBASE_VIEWER=static is in the environment, and when the viewer is closed, it is a
        still copy of the scene.
        """
        if self._is_static:
            import ipywidgets

            return ipywidgets.HTML(self._static_frame(), layout=ipywidgets.Layout(width="auto"))
        return self.window.widget(
            self.robot.name,
            self.height,
            thumbnail.render_png(self.renderer.picture, self.window.scene, self.height),
        )

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        """The live picture, and an image of it for wherever no widget can be; a program that stores
        notebooks may have another, see `MIMEBUNDLES`.
        """
        if (bundle := MIMEBUNDLES.get(display_mode())) is not None:
            return bundle(self)
        if self._is_static:
            return {"text/html": self._static_frame()}
        picture = self.widget()
        data, metadata = thumbnail.with_thumbnail(picture._repr_mimebundle_(**kwargs), picture)
        return {**data, "text/plain": repr(self)}, metadata

    @property
    def _is_static(self) -> bool:
        """Whether a display is a copy of the scene and no more."""
        return display_mode() == "static" or not self.window.is_open

    def _static_frame(self) -> str:
        """HTML of the scene as it is now, which needs no kernel."""
        name, style = (
            html.escape(self.robot.name),
            f"width: 100%; height: {self.height}px; border: 0; border-radius: 6px",
        )
        return (
            f'<iframe srcdoc="{html.escape(self.static_html())}" title="{name}" '
            f'style="{style}"></iframe>'
        )
