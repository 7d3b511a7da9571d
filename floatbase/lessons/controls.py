"""A panel of sliders under a live picture. A slider calls a quick function; nothing waits, so the kernel stays free."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ipywidgets as widgets

from floatbase.errors import FloatbaseError
from floatbase.viewer.scene import Viewer


def slider_panel(
    view: Viewer,
    draw: Callable[..., str | None],
    wait: bool = False,
    beside: bool = False,
    **ranges: tuple[float, float, float] | tuple[float, float, float, str],
) -> widgets.VBox:
    """The live picture with a slider for each of `ranges`: name=(lowest, first, highest) or (lowest, first, highest, unit).

    "_" in a name shows as a blank. draw: called at once and at every move as draw(name=value, …), in the kernel's thread, so
    it should take a few milliseconds. What it returns, HTML or plain text, stands between the picture and the sliders, or to
    the right of the picture with `beside`. wait: call it only when a slider is let go, for functions that take a little
    longer. Should it raise an error of the package, that stands there instead.
    """
    note = widgets.HTML()
    sliders = {name: _slider(name, *bounds, wait=wait) for name, bounds in ranges.items()}

    def moved(_: Any = None) -> None:
        try:
            note.value = draw(**{name: slider.value for name, slider in sliders.items()}) or ""
        except FloatbaseError as error:
            note.value = str(error)

    for slider in sliders.values():
        slider.observe(moved, names="value")
    moved()
    picture = widgets.HTML(layout=widgets.Layout(width="62%" if beside else "auto"))
    top = [widgets.HBox([picture, note])] if beside else [picture, note]
    return _Panel(view, picture, [*top, *sliders.values()])


class _Panel(widgets.VBox):
    """A panel whose picture is put in when it is displayed: by then the camera has been placed, which a still picture keeps."""

    def __init__(self, view: Viewer, picture: widgets.HTML, children: list[widgets.Widget]):
        super().__init__(children)
        self._view, self._picture = view, picture

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        self._picture.value = self._view._repr_html_()
        return super()._repr_mimebundle_(**kwargs)


def _slider(name: str, low: float, first: float, high: float, unit: str = "", *, wait: bool) -> widgets.FloatSlider:
    return widgets.FloatSlider(
        value=first,
        min=low,
        max=high,
        step=(high - low) / 100,
        description=name.replace("_", " ") + (f" [{unit}]" if unit else ""),
        readout_format=".2f" if high - low < 20 else ".0f",
        continuous_update=not wait,
        style={"description_width": "12em"},
        layout=widgets.Layout(width="80%"),
    )
