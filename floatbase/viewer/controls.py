"""Controls in the page: sliders, lists, check boxes, buttons, toggles, text and a plot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from floatbase._validation import (
    as_bool,
    as_callable,
    as_integer,
    as_number,
    as_positive,
    as_string,
    as_strings,
    short_repr,
)
from floatbase.errors import InputError
from floatbase.viewer.scene import protocol
from floatbase.viewer.transport.window import Window

COLUMNS = ("", "model", "reality")


class Controls:
    """The controls of a window's page, in a panel beside the picture."""

    window: Window

    def __init__(self) -> None:
        self._controls: dict[str, Callable[[Any], None]] = {}

    def add_slider(
        self,
        name: str,
        changed: Callable[[float], None],
        value: float,
        low: float,
        high: float,
        step: float = 0.01,
        section: str = "",
        column: str = "",
        at_most: str = "",
        on_release: bool = False,
    ) -> None:
        """Add a slider to the panel in the page."""
        low, high = as_number("low", low), as_number("high", high, minimum=as_number("low", low))
        value, step = as_number("value", value, "", low, high), as_positive("step", step)
        place: dict[str, Any] = _placement(name, section, column) | (
            {"at_most": word} if (word := as_string("at_most", at_most)) else {}
        )
        if as_bool("on_release", on_release):
            place["on_release"] = True
        changed = as_callable("changed", changed, "changed(value)")
        self._add_control(name, changed, value=value, min=low, max=high, step=step, **place)

    def add_button(self, name: str, pressed: Callable[[], None], section: str = "") -> None:
        """Add a button to the panel in the page."""
        as_callable("pressed", pressed, "pressed()")
        self._add_control(name, lambda _: pressed(), **_placement(name, section))

    def add_checkbox(
        self, name: str, changed: Callable[[bool], None], value: bool, section: str = ""
    ) -> None:
        """Add a check box to the panel in the page."""
        changed = as_callable("changed", changed, "changed(value)")
        self._add_control(name, changed, value=as_bool("value", value), **_placement(name, section))

    def add_dropdown(
        self,
        name: str,
        changed: Callable[[int], None],
        choices: Sequence[str],
        value: int = 0,
        section: str = "",
    ) -> None:
        """Add a drop-down list to the panel in the page."""
        choices = as_strings("choices", choices)
        if not choices:
            raise InputError("choices is empty; it must have at least one entry.")
        changed = as_callable("changed", changed, "changed(value)")
        value = as_integer("value", value, 0, len(choices) - 1)
        self._add_control(
            name, changed, value=value, choices=list(choices), **_placement(name, section)
        )

    def add_toggle(
        self, name: str, changed: Callable[[bool], None], value: bool, symbol: str, part: str
    ) -> None:
        """Add a toggle for a term of an equation, above the picture."""
        changed = as_callable("changed", changed, "changed(value)")
        value, symbol = as_bool("value", value), as_string("symbol", symbol)
        self._add_control(name, changed, value=value, term=symbol, part=as_string("part", part))

    def add_text(self, name: str, words: str, section: str = "", code: bool = False) -> None:
        """Write text into the panel, or change it."""
        place = _placement(name, section)
        text = {"text": as_string("words", words), "code": as_bool("code", code)}
        self.window.put([protocol.page_command("set_text", name=name, **text, **place)])

    def add_plot_point(self, name: str, t: float, value: float, unit: str = "") -> None:
        """Add a point to the plot of a quantity over the last seconds, at the top of the panel."""
        point = {
            "t": as_number("t", t, "s"),
            "value": as_number("value", value),
            "unit": as_string("unit", unit),
        }
        name = as_string("name", name)
        self.window.put([protocol.page_command("add_plot_point", name=name, **point)])

    def on_drag(self, pushed: Callable[[float, float], None], max_force: float) -> None:
        """Set the function that is called when the user drags the robot in the picture."""
        pushed = as_callable("pushed", pushed, "pushed(force, towards)")
        max_force = as_positive("max_force", max_force, "N")
        direction = 0.0

        def aim(towards: float) -> None:
            nonlocal direction
            direction = towards

        def let_go(force: float) -> None:
            pushed(force, direction)

        # hidden sliders; the page reports the direction first, see drag.js
        hidden = {"value": 0.0, "step": 1.0, "is_hidden": True}
        self._add_control("towards [°]", aim, min=-180.0, max=180.0, **hidden)
        self._add_control("push [N]", let_go, min=0.0, max=max_force, **hidden)

    def set_control_value(self, name: str, value: float | bool) -> None:
        """Show another value in a control, without calling its callback."""
        self.window.scene.set_control_value(as_string("name", name), value, "")
        self.window.put([])

    def _add_control(self, name: str, callback: Callable[[Any], None], **kind: Any) -> None:
        """Register a callback and add its control to the page."""
        self._controls[as_string("name", name)] = callback
        controls = self._controls  # not self, so that the window does not keep its viewer alive
        self.window.on_control(
            lambda which, value: controls[which](value) if which in controls else None
        )
        self.window.put([protocol.set_control(name, **kind)])


def _placement(name: str, section: str, column: str = "") -> dict[str, str]:
    """Return where a control appears, as its command encodes it, checked."""
    if (
        not isinstance(column, str)
        or column not in COLUMNS
        or not as_string("name", name).endswith(column)
    ):
        raise InputError(
            f"column of {short_repr(name)} is {short_repr(column)}; it must be "
            f'"model" or "reality", and the name must end in the same word.'
        )
    return {"section": as_string("section", section), **({"column": column} if column else {})}
