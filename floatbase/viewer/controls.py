"""What a reader can set in the page: sliders, choices, check boxes, buttons, terms of an equation;
texts, and a live strip.
"""

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
)
from floatbase.errors import InputError
from floatbase.viewer.scene import protocol
from floatbase.viewer.transport.window import Window

COLUMNS = ("", "model", "reality")


class Controls:
    """The controls of a window's page, in a panel beside the picture.

    section: heading that a control stands under; "" for the top, which is always open.
    """

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
        """Add a slider to the panel in the page.

        name: its label.
        changed: called with the new value when the reader moves it, in the window's thread.
        value: where it stands at first, and again after a double click.
        low, high, step: its range and its smallest step.
        section: heading that it stands under.
        column: "model" or "reality" for a part of a row of two, whose name ends in that word.
        at_most: a word that stands for its highest value, as "perfect".
        on_release: whether `changed` is called only when the reader releases the slider.
        """
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
        """Add a button to the panel in the page; `pressed()` is called in the window's thread."""
        as_callable("pressed", pressed, "pressed()")
        self._add_control(name, lambda _: pressed(), **_placement(name, section))

    def add_checkbox(
        self, name: str, changed: Callable[[bool], None], value: bool, section: str = ""
    ) -> None:
        """Add a check box to the panel in the page; `changed(value)` is called in the window's
        thread.
        """
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
        """Add a list to choose from to the panel in the page.

        name: its label.
        changed: called with the number of the chosen text, in the window's thread.
        choices: texts, at least one.
        value: number of the one that is chosen at first.
        section: heading that it stands under.
        """
        choices = as_strings("choices", choices)
        if not choices:
            raise InputError("choices is empty; give at least one text.")
        changed = as_callable("changed", changed, "changed(value)")
        value = as_integer("value", value, 0, len(choices) - 1)
        self._add_control(
            name, changed, value=value, choices=list(choices), **_placement(name, section)
        )

    def add_toggle(
        self, name: str, changed: Callable[[bool], None], value: bool, symbol: str, part: str
    ) -> None:
        """Add a switch of a term of an equation, over the picture.

        name: what it switches, for its tooltip and for screen readers.
        changed: called with whether it is on, in the window's thread.
        value: whether it is on at first.
        symbol: the term as it is written; switches of one symbol stand below each other.
        part: "shown" for the symbol itself, else what is written on the switch.
        """
        changed = as_callable("changed", changed, "changed(value)")
        self._add_control(
            name,
            changed,
            value=as_bool("value", value),
            term=as_string("symbol", symbol),
            part=as_string("part", part),
        )

    def add_text(self, name: str, words: str, section: str = "", code: bool = False) -> None:
        """Write a text into the panel, or change it.

        name: which text; words: what it says.
        section: heading that it stands under.
        code: whether it is a program, with a button that copies it.
        """
        place = _placement(name, section)
        self.window.put(
            [
                protocol.page_command(
                    "set_text",
                    name=name,
                    text=as_string("words", words),
                    code=as_bool("code", code),
                    **place,
                )
            ]
        )

    def add_plot_point(self, name: str, t: float, value: float, unit: str = "") -> None:
        """Add a point to the line of a number over the last seconds, at the top of the panel.

        name: of the number; t: s; unit: of the value.
        """
        point = {
            "t": as_number("t", t, "s"),
            "value": as_number("value", value),
            "unit": as_string("unit", unit),
        }
        self.window.put(
            [protocol.page_command("add_plot_point", name=as_string("name", name), **point)]
        )

    def set_control_value(self, name: str, value: float | bool) -> None:
        """Show a control at another value, without calling what it calls. Raises `ViewerError`
        where there is none.
        """
        self.window.scene.set_control_value(as_string("name", name), value, "")
        self.window.put([])

    def _add_control(self, name: str, callback: Callable[[Any], None], **kind: Any) -> None:
        self._controls[as_string("name", name)] = callback
        controls = self._controls  # not self, so that the window does not keep its viewer alive
        self.window.on_control(
            lambda which, value: controls[which](value) if which in controls else None
        )
        self.window.put([protocol.set_control(name, **kind)])


def _placement(name: str, section: str, column: str = "") -> dict[str, str]:
    """Where a control stands, as its command says it. Raises `InputError` for another column, or a
    name without it.
    """
    if (
        not isinstance(column, str)
        or column not in COLUMNS
        or not as_string("name", name).endswith(column)
    ):
        raise InputError(
            f'column is {column!r} of {name!r}; it must be "model" or "reality", and end the name.'
        )
    return {"section": as_string("section", section), **({"column": column} if column else {})}
