"""The times at which cells of a notebook run."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from typing import Any


class CellEvents:
    """Whether a notebook cell is running; outside IPython, none ever is."""

    def __init__(self) -> None:
        shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
        self.is_running = shell is not None  # the code that creates this object runs in a cell
        self.ended_at = 0.0
        self._events = None if shell is None else shell.events
        self._hooks = {"pre_run_cell": self._begin, "post_run_cell": self._end}
        if self._events is not None:
            for name, hook in self._hooks.items():
                self._events.register(name, hook)

    def unregister(self) -> None:
        """Stop listening to the notebook's events."""
        if self._events is not None:
            for name, hook in self._hooks.items():
                with suppress(ValueError):  # it is no longer registered
                    self._events.unregister(name, hook)
        self.is_running = False

    def _begin(self, _: object) -> None:
        """Note that a cell has started."""
        self.is_running = True

    def _end(self, _: object) -> None:
        """Note that a cell has ended."""
        self.is_running, self.ended_at = False, time.monotonic()


def receive_during_cells(widget: Any) -> None:
    """Let a new widget receive messages while a cell runs, where the notebook uses subshells."""
    getattr(widget.comm, "__dict__", {}).pop("_reply_subshell_id", None)
