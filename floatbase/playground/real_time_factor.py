"""Real-time factor of a simulation: how fast it runs compared with real time."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from floatbase._validation import as_callable, as_number, as_positive


class RealTimeFactor:
    """Ratio of simulated time to real time over the last seconds.

    Parameters
    ----------
    clock : callable, optional
        Function that returns the real time [s].
    over : float, optional
        Length of the averaging window, in real time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic, over: float = 2.0):
        self._clock = as_callable("clock", clock, "clock()")
        self._over = as_positive("over", over, "s")
        self._seen: deque[tuple[float, float]] = deque()  # clock and simulated time, s

    def update(self, simulated: float) -> float | None:
        """Record the simulated time, and return the real-time factor.

        Parameters
        ----------
        simulated : float
            Current time of the simulation [s].

        Returns
        -------
        float or None
            Real-time factor [-]; None during the first half second after a start or a pause.
        """
        simulated, now = as_number("simulated", simulated, "s"), self._clock()
        if self._seen and (simulated < self._seen[-1][1] or now - self._seen[-1][0] > self._over):
            self._seen.clear()
        self._seen.append((now, simulated))
        while now - self._seen[0][0] > self._over:
            self._seen.popleft()
        since, start = self._seen[0]
        return (simulated - start) / (now - since) if now - since > 0.5 else None
