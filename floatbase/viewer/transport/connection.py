"""A page and what it is owed: the rules of all pages, whatever the way to them.

A `Connection` knows what its page shows and has seen, and sends the rest when the way is free. A
`Channel` is the way: a websocket
(`server`) or a notebook's own connection (`notebook`).
"""

from __future__ import annotations

import json
import logging
import math
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Protocol

from floatbase.errors import ViewerError
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.store import Scene
from floatbase.viewer.transport.output_history import OutputHistory

TIMEOUT = 30.0  # s; a page that takes longer over one frame is let go, and connects again by itself
# s from frame to frame for a page whose answers wait until a cell has ended
UNANSWERED_INTERVAL = 0.05
MAX_UNANSWERED = (
    32 << 20
)  # bytes under way to it: half an hour of a walking robot's frames, or the whole scene many times


class Host(Protocol):
    """What a connection needs of its server."""

    scene: Scene
    outputs: OutputHistory
    clients: list[Connection]
    on_control: Callable[[str, Any], None] | None

    def flush(self) -> None:
        """Send a frame soon."""


class Channel:
    """The way to one page.

    max_in_flight: frames that may be under way, not yet drawn by the page. min_interval: least time
        from one frame to
    the next, s; 0 leaves it
    to the server. answers_since: time from which on the page's answers arrive; None while they do
    not, however well it draws. Then frames go at the pace `UNANSWERED_INTERVAL`, as long as those
    under way hold fewer bytes than `MAX_UNANSWERED`.
    """

    max_in_flight = 1
    min_interval = 0.0

    @property
    def answers_since(self) -> float | None:
        return 0.0

    def send_frame(self, number: int, data: bytes) -> None:
        """Send frame `number`, see `protocol.frame`."""
        raise NotImplementedError

    def send_text(self, message: str) -> None:
        """Send a request, as JSON."""
        raise NotImplementedError

    def close_page(self, reason: str) -> None:
        """Let the page go. It may come back as a new one."""
        raise NotImplementedError


class Connection:
    """One page. While frames are under way to it, what changes goes into the next one.

    scene: what the page is to show. displayed: what it shows now. sent: number of the newest change
        that it was sent.
    """

    def __init__(self, host: Host, channel: Channel, output: int = 0):
        self.host, self.channel = host, channel
        self.scene = self.displayed = host.scene
        self.sent = 0
        self._output = output
        self._frames, self._last = 0, 0.0  # how many were sent, and when the last one
        self._in_flight: deque[tuple[int, float, int]] = (
            deque()
        )  # number of a frame, when it was sent, bytes
        self._requests: list[str] = []
        self._pictures: dict[int, Future[str]] = {}
        host.clients.append(self)
        frozen = host.outputs.frozen(output)
        if frozen is not None:
            self.scene, self.displayed = (
                frozen,
                Scene(),
            )  # the page shows nothing yet: the first frame is the whole kept scene

    def freeze(self) -> None:
        """Keep the display's picture when a newer display has opened, unless the reader has made
        this page live again.
        """
        if self.scene is self.host.scene:
            self.scene = self.host.outputs.frozen(self._output) or self.scene
            self.next_frame()

    def close(self) -> None:
        """The page has gone."""
        if self in self.host.clients:
            self.host.clients.remove(self)
        for picture in self._pictures.values():
            picture.set_exception(
                ViewerError("the browser closed before the picture was taken; open it again.")
            )
        self._pictures.clear()

    def receive(self, message: str | bytes) -> None:
        """Deal with what the page says. What no page of ours says is ignored: any program of this
        machine can connect.
        """
        try:
            answer = json.loads(message)
        except (ValueError, RecursionError):
            return
        kind = answer.get("type") if isinstance(answer, dict) else None
        if kind == "done":
            self._drawn(answer.get("number"))
            self.host.flush()
        elif kind == "live":
            self._output, self.scene = 0, self.host.scene
            self.next_frame()
        elif (
            kind == "image" and isinstance(answer.get("id"), int) and answer["id"] in self._pictures
        ):
            self._pictures.pop(answer["id"]).set_result(str(answer.get("data")))
        elif kind == "control":
            self._control(answer.get("name"), answer.get("value"), str(answer.get("by"))[:40])

    def _drawn(self, number: Any) -> None:
        """The page has drawn the frames up to `number`, or, when it does not say, the oldest under
        way.
        """
        if self._in_flight and number is None:
            self._in_flight.popleft()
        while self._in_flight and isinstance(number, int) and self._in_flight[0][0] <= number:
            self._in_flight.popleft()

    def _control(self, name: Any, value: Any, page: str) -> None:
        """Show the new value of a control in every page, and report it to the window."""
        try:
            value = self.host.scene.set_control_value(name, value, page)
        except (ViewerError, UnicodeEncodeError):  # half a character in the page's name
            return
        self.host.flush()
        try:
            if self.host.on_control is not None:
                self.host.on_control(name, value)
        except (
            Exception
        ):  # an error in the user's callback is reported, and must not end the connection
            logging.getLogger("floatbase.viewer").exception("the control %r failed", name)

    def request_picture(self, answer: Future[str]) -> None:
        """Request a picture of the scene as it is now."""
        number = id(answer)
        self._pictures[number] = answer
        self._requests.append(json.dumps({"type": "capture", "id": number}))
        self.next_frame()

    def next_frame(self) -> float:
        """Send what the page has not seen, if it may be sent now; s after which to try again,
        infinite for none.
        """
        now = time.monotonic()
        wait = self._wait(now)
        if wait > 0.0:
            return wait
        newest, commands = self._unseen()
        if commands:
            frame = protocol.frame(commands)
            self._frames, self.sent = self._frames + 1, newest
            self._last = now
            self._in_flight.append((self._frames, now, len(frame)))
            self.channel.send_frame(self._frames, frame)
        for request in self._requests:
            self.channel.send_text(request)
        self._requests.clear()
        return math.inf

    def _wait(self, now: float) -> float:
        """How long the next frame must wait, s. It may let the page go."""
        if not self._frames:
            return 0.0
        answers_since, rest = (
            self.channel.answers_since,
            self._last + self.channel.min_interval - now,
        )
        if self._in_flight and answers_since is None:
            is_full = sum(size for *_, size in self._in_flight) > MAX_UNANSWERED
            return math.inf if is_full else max(self._last + UNANSWERED_INTERVAL - now, 0.0)
        if self._in_flight and now - max(self._in_flight[0][1], answers_since or 0.0) > TIMEOUT:
            self.close()
            self.channel.close_page("the page does not read")
            return math.inf
        return math.inf if len(self._in_flight) >= self.channel.max_in_flight else max(rest, 0.0)

    def _unseen(self) -> tuple[int, list[bytes]]:
        """Number of the newest change, and the commands that bring the page to it."""
        if self.displayed is self.scene:
            return self.scene.since(self.sent)
        before, self.displayed = self.displayed, self.scene
        is_frozen = protocol.page_command("set_frozen", frozen=self.scene is not self.host.scene)[1]
        return self.scene.newest, [*self.scene.commands_from(before), is_frozen]
