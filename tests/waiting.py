"""How tests wait for what another thread, process or page does."""

import time
from collections.abc import Callable

# s for what takes a moment on an idle machine: no test may fail because others keep the machine
# busy
PATIENCE = 60.0


def until(
    condition: Callable[[], bool], wait: Callable[[], object] = lambda: time.sleep(0.01)
) -> None:
    """Wait until a condition holds; with a page, `wait` must let it work."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        wait()
