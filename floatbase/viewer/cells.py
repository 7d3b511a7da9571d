"""When cells of a notebook run."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any


class Cells:
    """Whether a cell runs. Outside IPython none ever does.

    before: called before each cell. runs: whether one runs now. ended: when the last one ended, s of `time.monotonic`.
    """

    def __init__(self, before: Callable[[], None]):
        shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
        self.runs = shell is not None  # what asks for this is part of a cell
        self.ended = 0.0
        self._before = before
        self._events = None if shell is None else shell.events
        self._hooks = {"pre_run_cell": self._begin, "post_run_cell": self._end}
        if self._events is not None:
            for name, hook in self._hooks.items():
                self._events.register(name, hook)

    def forget(self) -> None:
        """Listen no more."""
        if self._events is not None:
            for name, hook in self._hooks.items():
                with suppress(ValueError):  # it is registered no more
                    self._events.unregister(name, hook)
        self.runs = False

    def _begin(self, _: object) -> None:
        self.runs = True
        self._before()

    def _end(self, _: object) -> None:
        self.runs, self.ended = False, time.monotonic()


def hear_at_once(widget: Any) -> None:
    """Let a new widget be heard while a cell runs too, where the notebook asks for it, by a subshell of the kernel.

    ipykernel 7.4 gives a page's messages to the thread that opened the widget, and not to the one that the page asks for.
    """
    getattr(widget.comm, "__dict__", {}).pop("_reply_subshell_id", None)
