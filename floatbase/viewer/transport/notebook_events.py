"""When cells of a notebook run."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from typing import Any


class CellEvents:
    """Whether a cell runs. Outside IPython none ever does.

    is_running: whether one runs now. ended_at: when the last one ended, s of `time.monotonic`.
    """

    def __init__(self) -> None:
        shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
        self.is_running = shell is not None  # what asks for this is part of a cell
        self.ended_at = 0.0
        self._events = None if shell is None else shell.events
        self._hooks = {"pre_run_cell": self._begin, "post_run_cell": self._end}
        if self._events is not None:
            for name, hook in self._hooks.items():
                self._events.register(name, hook)

    def unregister(self) -> None:
        """Listen no more."""
        if self._events is not None:
            for name, hook in self._hooks.items():
                with suppress(ValueError):  # it is registered no more
                    self._events.unregister(name, hook)
        self.is_running = False

    def _begin(self, _: object) -> None:
        self.is_running = True

    def _end(self, _: object) -> None:
        self.is_running, self.ended_at = False, time.monotonic()


def receive_during_cells(widget: Any) -> None:
    """Let a new widget be heard while a cell runs too, where the notebook asks for it, by a
    subshell of the kernel.

    ipykernel 7.4 gives a page's messages to the thread that opened the widget, and not to the one
    that the page asks for.
    """
    getattr(widget.comm, "__dict__", {}).pop("_reply_subshell_id", None)
