"""A lock that an interrupt does not leave locked."""

from __future__ import annotations

import _thread
from contextlib import suppress


class InterruptibleLock(_thread.RLock):  # type: ignore[misc]
    """Lock for `with`, released whenever Ctrl-C comes.

    Since Python 3.14, an interrupt may come after a lock is acquired and before `with` guards it.
    """

    def __enter__(self) -> bool:  # type: ignore[override]
        try:
            return self.acquire()
        except BaseException:
            with suppress(RuntimeError):  # raised if this thread was still waiting
                self.release()
            raise
