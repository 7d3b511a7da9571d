"""How fast a run is, compared with real time: a machine that cannot hold it is slower, and the page
says by how much.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable


class RealTimeFactor:
    """Simulated time per real time. clock: gives real time, s. over: s of real time, back from now,
    that count.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic, over: float = 2.0):
        self._clock, self._over = clock, over
        self._seen: deque[tuple[float, float]] = deque()  # clock and simulated time, s

    def update(self, simulated: float) -> float | None:
        """The pace when the simulation's clock has come to `simulated` s; None for half a second
        after a start or a pause.
        """
        now = self._clock()
        if self._seen and (simulated < self._seen[-1][1] or now - self._seen[-1][0] > self._over):
            self._seen.clear()
        self._seen.append((now, simulated))
        while now - self._seen[0][0] > self._over:
            self._seen.popleft()
        since, start = self._seen[0]
        return (simulated - start) / (now - since) if now - since > 0.5 else None
