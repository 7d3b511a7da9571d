"""A page and what it is owed: the rules of all pages, whatever the way to them.

A `Connection` knows what its page shows and has seen, and sends the rest when the way is free. A `Line` is the way: a websocket
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
from floatbase.viewer import wire
from floatbase.viewer.displays import Displays
from floatbase.viewer.scene import Scene

PATIENCE = 30.0  # s; a page that takes longer over one frame is let go, and connects again by itself
BLIND = 0.05  # s from frame to frame for a page whose answers wait until a cell has ended
MOST_BLIND = 32 << 20  # bytes under way to it: half an hour of a walking robot's frames, or the whole scene many times


class Hub(Protocol):
    """What a connection needs of its server."""

    scene: Scene
    displays: Displays
    clients: list[Connection]
    on_control: Callable[[str, Any], None] | None

    def flush(self) -> None:
        """Send a frame soon."""


class Line:
    """The way to one page.

    most: frames that may be under way, not yet drawn by the page. pace: least time from one frame to the next, s; 0 leaves it
    to the server. heard_since: time from which on the page's answers arrive; None while they do not, however well it draws.
    Then frames go at the pace `BLIND`, as long as those under way hold fewer bytes than `MOST_BLIND`.
    """

    most = 1
    pace = 0.0

    @property
    def heard_since(self) -> float | None:
        return 0.0

    def frame(self, number: int, data: bytes) -> None:
        """Send frame `number`, see `wire.frame`."""
        raise NotImplementedError

    def text(self, message: str) -> None:
        """Send a request, as JSON."""
        raise NotImplementedError

    def end(self, reason: str) -> None:
        """Let the page go. It may come back as a new one."""
        raise NotImplementedError


class Connection:
    """One page. While frames are under way to it, what changes goes into the next one.

    scene: what the page is to show. shown: what it shows now. seen: number of the newest change that it was sent.
    """

    def __init__(self, hub: Hub, line: Line, display: int = 0):
        self.hub, self.line = hub, line
        self.scene = self.shown = hub.scene
        self.seen = 0
        self._display = display
        self._frames, self._last = 0, 0.0  # how many were sent, and when the last one
        self._under_way: deque[tuple[int, float, int]] = deque()  # number of a frame, when it was sent, bytes
        self._requests: list[str] = []
        self._pictures: dict[int, Future[str]] = {}
        hub.clients.append(self)
        kept = hub.displays.kept(display)
        if kept is not None:
            self.scene, self.shown = kept, Scene()  # the page shows nothing yet: the first frame is the whole kept scene

    def keep(self) -> None:
        """Keep the display's picture when a newer display has opened, unless the reader has made this page live again."""
        if self.scene is self.hub.scene:
            self.scene = self.hub.displays.kept(self._display) or self.scene
            self.next_frame()

    def end(self) -> None:
        """The page has gone."""
        if self in self.hub.clients:
            self.hub.clients.remove(self)
        for picture in self._pictures.values():
            picture.set_exception(ViewerError("the browser closed before the picture was taken; open it again."))
        self._pictures.clear()

    def hear(self, message: str | bytes) -> None:
        """Deal with what the page says. What no page of ours says is ignored: any program of this machine can connect."""
        try:
            answer = json.loads(message)
        except (ValueError, RecursionError):
            return
        kind = answer.get("type") if isinstance(answer, dict) else None
        if kind == "done":
            self._done(answer.get("number"))
            self.hub.flush()
        elif kind == "live":
            self._display, self.scene = 0, self.hub.scene
            self.next_frame()
        elif kind == "image" and isinstance(answer.get("id"), int) and answer["id"] in self._pictures:
            self._pictures.pop(answer["id"]).set_result(str(answer.get("data")))
        elif kind == "control":
            self._control(answer.get("name"), answer.get("value"), str(answer.get("by"))[:40])

    def _done(self, number: Any) -> None:
        """The page has drawn the frames up to `number`, or, when it does not say, the oldest under way."""
        if self._under_way and number is None:
            self._under_way.popleft()
        while self._under_way and isinstance(number, int) and self._under_way[0][0] <= number:
            self._under_way.popleft()

    def _control(self, name: Any, value: Any, page: str) -> None:
        """Show the new value of a control in every page, and report it to the window."""
        try:
            value = self.hub.scene.move_control(name, value, page)
        except (ViewerError, UnicodeEncodeError):  # half a character in the page's name
            return
        self.hub.flush()
        try:
            if self.hub.on_control is not None:
                self.hub.on_control(name, value)
        except Exception:  # an error in the user's callback is reported, and must not end the connection
            logging.getLogger("floatbase.viewer").exception("the control %r failed", name)

    def request_picture(self, answer: Future[str]) -> None:
        """Request a picture of the scene as it is now."""
        number = id(answer)
        self._pictures[number] = answer
        self._requests.append(json.dumps({"type": "capture", "id": number}))
        self.next_frame()

    def next_frame(self) -> float:
        """Send what the page has not seen, if it may be sent now; s after which to try again, infinite for none."""
        now = time.monotonic()
        wait = self._wait(now)
        if wait > 0.0:
            return wait
        newest, commands = self._unseen()
        if commands:
            frame = wire.frame(commands)
            self._frames, self.seen = self._frames + 1, newest
            self._last = now
            self._under_way.append((self._frames, now, len(frame)))
            self.line.frame(self._frames, frame)
        for request in self._requests:
            self.line.text(request)
        self._requests.clear()
        return math.inf

    def _wait(self, now: float) -> float:
        """How long the next frame must wait, s. It may let the page go."""
        if not self._frames:
            return 0.0
        heard_since, rest = self.line.heard_since, self._last + self.line.pace - now
        if self._under_way and heard_since is None:
            is_full = sum(size for *_, size in self._under_way) > MOST_BLIND
            return math.inf if is_full else max(self._last + BLIND - now, 0.0)
        if self._under_way and now - max(self._under_way[0][1], heard_since or 0.0) > PATIENCE:
            self.end()
            self.line.end("the page does not read")
            return math.inf
        return math.inf if len(self._under_way) >= self.line.most else max(rest, 0.0)

    def _unseen(self) -> tuple[int, list[bytes]]:
        """Number of the newest change, and the commands that bring the page to it."""
        if self.shown is self.scene:
            return self.scene.since(self.seen)
        before, self.shown = self.shown, self.scene
        is_kept = wire.page_command("set_kept", kept=self.scene is not self.hub.scene)[1]
        return self.scene.newest, [*self.scene.change_from(before), is_kept]
