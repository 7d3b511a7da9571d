"""Connections to pages: what each page has received, and when it receives the rest.

A `Connection` sends the changes of the scene that its page has not received, as fast as the page
draws. A connection uses a `Channel`: a websocket (`server`) or the notebook's own connection
(`notebook_widget`).
"""

from __future__ import annotations

import json
import logging
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from floatbase.errors import ViewerError
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.store import Scene

# s; a page that takes longer for one frame is disconnected, and reconnects by itself
TIMEOUT = 30.0
# s between frames for a page whose answers are delayed until a cell has ended
UNANSWERED_INTERVAL = 0.05
# bytes in flight to it: half an hour of a walking robot's frames, or the whole scene many times
MAX_UNANSWERED = 32 << 20


class Host(Protocol):
    """Interface that a connection needs from its server."""

    scene: Scene
    clients: list[Connection]
    on_control: Callable[[str, Any], None] | None

    def flush(self) -> None:
        """Send a frame soon."""


class Channel:
    """A way to send frames to one page."""

    max_in_flight = 1
    min_interval = 0.0

    @property
    def answers_since(self) -> float | None:
        """Time from which the page's answers arrive [s]; None while they are delayed."""
        return 0.0

    def send_frame(self, number: int, data: bytes) -> None:
        """Send a frame."""
        raise NotImplementedError

    async def deliver_rest(self) -> None:
        """Deliver what must not be lost when the window closes."""

    def close_page(self, reason: str) -> None:
        """Disconnect the page. The page may connect again as a new one."""
        raise NotImplementedError


class Connection:
    """The connection to one page."""

    def __init__(self, host: Host, channel: Channel):
        self.host, self.channel = host, channel
        self.sent = 0
        self._frames, self._last = 0, 0.0  # number of frames sent, and time of the last one
        # number, time and size of each frame
        self._in_flight: deque[tuple[int, float, int]] = deque()
        host.clients.append(self)

    def close(self) -> None:
        """Remove the page from its server."""
        if self in self.host.clients:
            self.host.clients.remove(self)

    def receive(self, message: str | bytes) -> None:
        """Handle a message from the page."""
        try:
            answer = json.loads(message)
        except (ValueError, RecursionError):
            return
        kind = answer.get("type") if isinstance(answer, dict) else None
        if kind == "done":
            self._drawn(answer.get("number"))
            self.host.flush()
        elif kind == "control":
            self._control(answer.get("name"), answer.get("value"), str(answer.get("by"))[:40])

    def _drawn(self, number: Any) -> None:
        """Note that the page has drawn the frames up to `number`, or the oldest if it is None."""
        if self._in_flight and number is None:
            self._in_flight.popleft()
        while self._in_flight and isinstance(number, int) and self._in_flight[0][0] <= number:
            self._in_flight.popleft()

    def _control(self, name: Any, value: Any, page: str) -> None:
        """Show a control's new value in every page, and report it to the window."""
        try:
            value = self.host.scene.set_control_value(name, value, page)
        except (ViewerError, UnicodeEncodeError):  # an unpaired surrogate in the page's name
            return
        self.host.flush()
        try:
            if self.host.on_control is not None:
                self.host.on_control(name, value)
        except Exception:
            # an error in the user's callback is reported, and must not end the connection
            logger = logging.getLogger("floatbase.viewer")
            logger.exception("The callback of the control %r failed.", name)

    def next_frame(self) -> float:
        """Send the changes that the page has not received, if a frame may be sent now."""
        now = time.monotonic()
        wait = self._wait(now)
        if wait > 0.0:
            return wait
        newest, commands = self.host.scene.since(self.sent)
        if commands:
            frame = protocol.frame(commands)
            self._frames, self.sent = self._frames + 1, newest
            self._last = now
            self._in_flight.append((self._frames, now, len(frame)))
            self.channel.send_frame(self._frames, frame)
        return math.inf

    def _wait(self, now: float) -> float:
        """Return how long the next frame must wait [s]; disconnect a page that has timed out."""
        if not self._frames:
            return 0.0
        answers_since = self.channel.answers_since
        if self._in_flight and answers_since is None:
            is_full = sum(size for *_, size in self._in_flight) > MAX_UNANSWERED
            return math.inf if is_full else max(self._last + UNANSWERED_INTERVAL - now, 0.0)
        if self._in_flight and now - max(self._in_flight[0][1], answers_since or 0.0) > TIMEOUT:
            self.close()
            self.channel.close_page("the page does not respond")
            return math.inf
        if len(self._in_flight) >= self.channel.max_in_flight:
            return math.inf
        return max(self._last + self.channel.min_interval - now, 0.0)
