"""What a reader can set in the page: sliders, choices, check boxes, buttons, terms of an equation; texts, and a live strip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from floatbase._arrays import flag, function, number, positive, text, texts, whole
from floatbase.errors import InputError
from floatbase.viewer import wire
from floatbase.viewer.window import Window

COLUMNS = ("", "believed", "true")


class Controls:
    """The controls of a window's page, in a panel beside the picture.

    section: heading that a control stands under; "" for the top, which is always open.
    """

    window: Window

    def __init__(self) -> None:
        self._controls: dict[str, Callable[[Any], None]] = {}

    def slider(
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
    ) -> None:
        """Add a slider to the panel in the page.

        name: its label.
        changed: called with the new value when the reader moves it, in the window's thread.
        value: where it stands at first, and again after a double click.
        low, high, step: its range and its smallest step.
        section: heading that it stands under.
        column: "believed" or "true" for a part of a row of two, whose name ends in that word.
        at_most: a word that stands for its highest value, as "perfect".
        """
        low, high = number("low", low), number("high", high, least=number("low", low))
        value, step = number("value", value, "", low, high), positive("step", step)
        place = _place(name, section, column) | ({"at_most": word} if (word := text("at_most", at_most)) else {})
        changed = function("changed", changed, "changed(value)")
        self._control(name, changed, value=value, min=low, max=high, step=step, **place)

    def button(self, name: str, pressed: Callable[[], None], section: str = "") -> None:
        """Add a button to the panel in the page; `pressed()` is called in the window's thread."""
        function("pressed", pressed, "pressed()")
        self._control(name, lambda _: pressed(), **_place(name, section))

    def checkbox(self, name: str, changed: Callable[[bool], None], value: bool, section: str = "") -> None:
        """Add a check box to the panel in the page; `changed(value)` is called in the window's thread."""
        changed = function("changed", changed, "changed(value)")
        self._control(name, changed, value=flag("value", value), **_place(name, section))

    def choice(
        self, name: str, changed: Callable[[int], None], choices: Sequence[str], value: int = 0, section: str = ""
    ) -> None:
        """Add a list to choose from to the panel in the page.

        name: its label.
        changed: called with the number of the chosen text, in the window's thread.
        choices: texts, at least one.
        value: number of the one that is chosen at first.
        section: heading that it stands under.
        """
        choices = texts("choices", choices)
        if not choices:
            raise InputError("choices is empty; give at least one text.")
        changed = function("changed", changed, "changed(value)")
        value = whole("value", value, 0, len(choices) - 1)
        self._control(name, changed, value=value, choices=list(choices), **_place(name, section))

    def term(self, name: str, changed: Callable[[bool], None], value: bool, symbol: str, part: str) -> None:
        """Add a switch of a term of an equation, over the picture.

        name: what it switches, for its tooltip and for screen readers.
        changed: called with whether it is on, in the window's thread.
        value: whether it is on at first.
        symbol: the term as it is written; switches of one symbol stand below each other.
        part: "shown" for the symbol itself, else what is written on the switch.
        """
        changed = function("changed", changed, "changed(value)")
        self._control(name, changed, value=flag("value", value), term=text("symbol", symbol), part=text("part", part))

    def note(self, name: str, words: str, section: str = "", code: bool = False) -> None:
        """Write a text into the panel, or change it.

        name: which text; words: what it says.
        section: heading that it stands under.
        code: whether it is a program, with a button that copies it.
        """
        place = _place(name, section)
        self.window.put([wire.page_command("set_text", name=name, text=text("words", words), code=flag("code", code), **place)])

    def strip(self, name: str, t: float, value: float, unit: str = "") -> None:
        """Add a point to the line of a number over the last seconds, at the top of the panel.

        name: of the number; t: s; unit: of the value.
        """
        point = {"t": number("t", t, "s"), "value": number("value", value), "unit": text("unit", unit)}
        self.window.put([wire.page_command("set_strip", name=text("name", name), **point)])

    def move(self, name: str, value: float | bool) -> None:
        """Show a control at another value, without calling what it calls. Raises `ViewerError` where there is none."""
        self.window.scene.move_control(text("name", name), value, "")
        self.window.put([])

    def _control(self, name: str, callback: Callable[[Any], None], **kind: Any) -> None:
        self._controls[text("name", name)] = callback
        controls = self._controls  # not self, so that the window does not keep its viewer alive
        self.window.on_control(lambda which, value: controls[which](value) if which in controls else None)
        self.window.put([wire.set_control(name, **kind)])


def _place(name: str, section: str, column: str = "") -> dict[str, str]:
    """Where a control stands, as its command says it. Raises `InputError` for another column, or a name without it."""
    if not isinstance(column, str) or column not in COLUMNS or not text("name", name).endswith(column):
        raise InputError(f'column is {column!r} of {name!r}; it must be "believed" or "true", and end the name.')
    return {"section": text("section", section), **({"column": column} if column else {})}
