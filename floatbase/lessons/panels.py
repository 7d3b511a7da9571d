"""A panel of sliders under a live picture. A slider calls a quick function; nothing waits, so the kernel stays free."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import ipywidgets as widgets

from floatbase.errors import FloatbaseError
from floatbase.viewer import Viewer


def slider_panel(
    view: Viewer,
    draw: Callable[..., str | None],
    wait: bool = False,
    beside: bool = False,
    **ranges: tuple[float, float, float] | tuple[float, float, float, str],
) -> widgets.VBox:
    """The live picture with a slider for each of `ranges`: name=(lowest, first, highest) or (lowest, first, highest, unit).

    A slider goes in round steps that meet all three. "_" in a name shows as a blank. draw: called at once and at every move as
    draw(name=value, …) with the values as shown, in the kernel's thread, so it should take a few milliseconds. What it returns,
    HTML or plain text, stands between the picture and the sliders, or to the right of the picture with `beside`. wait: call it
    only when a slider is let go, for functions that take a little longer. Should it raise an error of the package, that stands
    there instead.
    """
    note = widgets.HTML()
    sliders = {name: _slider(name, *bounds, wait=wait) for name, bounds in ranges.items()}

    def moved(_: Any = None) -> None:
        try:
            note.value = draw(**{name: _shown(slider) for name, slider in sliders.items()}) or ""
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
    step = _round_step(low, first, high)
    return widgets.FloatSlider(
        value=first,
        min=low,
        max=high,
        step=step,
        description=name.replace("_", " ") + (f" [{unit}]" if unit else ""),
        readout_format=f".{max(0, -math.floor(math.log10(step)))}f",
        continuous_update=not wait,
        style={"description_width": "12em"},
        layout=widgets.Layout(width="80%"),
    )


def _round_step(*bounds: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that goes into all bounds, and 50 times or more from lowest to highest.

    Where none does, because a bound is not round itself, one that is too fine for that to be seen.
    """
    most = (max(bounds) - min(bounds)) / 50
    power = math.floor(math.log10(most)) if most > 0 else 0
    steps = [float(f"{digit}e{power - i}") for i in range(4) for digit in (5, 2, 1)]
    steps = [step for step in steps if step <= most * (1 + 1e-9)] or [1.0]
    return next((step for step in steps if all(abs(b / step - round(b / step)) < 1e-6 for b in bounds)), steps[-1])


def _shown(slider: widgets.FloatSlider) -> float:
    """The value as the slider shows it: a browser's sum of steps may be off in the last digits."""
    return float(format(slider.value, slider.readout_format)) + 0.0  # without a minus before a zero
