"""The server of a window: a thread with a web server, and a connection to each page."""

from __future__ import annotations

import asyncio
import json
import logging
import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import Any

import tornado.httpserver
import tornado.web
import tornado.websocket

from floatbase.errors import ViewerError
from floatbase.viewer import page, wire
from floatbase.viewer.displays import Displays
from floatbase.viewer.scene import Scene

FRAME_TIME = 1.0 / 60.0  # s, the least time between two frames
LONGEST = 32 << 20  # bytes of a message from a page: a picture of the largest screens, which is the longest that pages send
PATIENCE = 30.0  # s; a page that takes longer over one frame is disconnected, and connects again by itself


class Server:
    """The thread that serves one scene. It has no reference to its `Window`, so a window that nobody refers to can end it."""

    def __init__(self, scene: Scene, sockets: list[socket.socket]):
        self.scene = scene
        self.port: int = sockets[0].getsockname()[1]
        self.displays = Displays(scene)
        self.clients: list[_Socket] = []
        self.on_control: Callable[[str, Any], None] | None = None
        self._sockets = sockets
        self._loop = asyncio.new_event_loop()
        # the newest change for which a wake-up was requested, and the newest that a wake-up has dealt with
        self._requested = self._sent = 0
        self._last_flush = 0.0
        self._timer: asyncio.TimerHandle | None = None
        ready = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(ready,), name=f"floatbase-window-{self.port}", daemon=True)
        self._thread.start()
        ready.wait()

    def wake(self, number: int) -> None:
        """Have change `number` sent. Any thread may call this; it costs little while a wake-up is under way."""
        if not self.clients:
            self.scene.seen_by_all = number
        elif self._requested <= self._sent:
            self._call(self.flush)
            self._requested = number  # after the call: an interrupt between the two causes a second wake-up, not a missing one

    def keep(self) -> None:
        """Make the pages of earlier displays keep their pictures."""
        self._call(self._keep)

    def capture(self) -> Future[str]:
        """Request a picture from the last page, as a data URL."""
        answer: Future[str] = Future()
        self._call(self._capture, answer)
        return answer

    def stop(self) -> None:
        """End the thread and free the port."""
        self._call(self._loop.stop)
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=5.0)

    def _call(self, function: Callable[..., Any], *args: Any) -> None:
        with suppress(RuntimeError):  # the loop may have closed since the caller checked
            self._loop.call_soon_threadsafe(function, *args)

    def _run(self, ready: threading.Event) -> None:
        asyncio.set_event_loop(self._loop)
        http = tornado.httpserver.HTTPServer(_application(self))
        http.add_sockets(self._sockets)
        self._loop.call_soon(ready.set)
        try:
            self._loop.run_forever()
            self._loop.run_until_complete(self._shut(http))
        finally:
            self._loop.close()

    async def _shut(self, http: tornado.httpserver.HTTPServer) -> None:
        http.stop()
        for client in list(self.clients):
            client.close(1001, "window closed")
        await http.close_all_connections()
        rest = asyncio.all_tasks() - {asyncio.current_task()}
        for task in rest:
            task.cancel()
        await asyncio.gather(*rest, return_exceptions=True)

    def flush(self) -> None:
        """Send a frame as soon as the last one is `FRAME_TIME` old. Runs in the loop's thread."""
        if self._timer is None:
            wait = self._last_flush + FRAME_TIME - self._loop.time()
            self._timer = self._loop.call_later(max(wait, 0.0), self._flush)

    def _flush(self) -> None:
        """Send a frame to every page that is idle. The others call `flush` when they have drawn theirs."""
        self._timer, self._last_flush = None, self._loop.time()
        self._sent = max(self.scene.newest, self._requested)
        for client in list(self.clients):
            client.next_frame()
        seen = (client.seen for client in self.clients if client.shown is self.scene)
        self.scene.seen_by_all = min(seen, default=self.scene.newest)

    def _keep(self) -> None:
        for client in list(self.clients):
            client.keep()

    def _capture(self, answer: Future[str]) -> None:
        live = [client for client in self.clients if client.scene is self.scene]
        if live:
            live[-1].request_picture(answer)
        elif self.clients:
            answer.set_exception(ViewerError("every open page keeps an earlier picture; press 'make live' in one of them."))
        else:
            answer.set_exception(ViewerError("the browser closed before the picture was taken; open it again."))


class _Guarded(tornado.web.RequestHandler):
    """Answers only requests to 127.0.0.1 or localhost, so that no foreign page reaches us under a host name of its own."""

    def prepare(self) -> None:
        if self.request.host_name not in ("127.0.0.1", "localhost"):
            raise tornado.web.HTTPError(403)


class _Page(_Guarded):
    def get(self) -> None:
        self.set_header("Cache-Control", "no-store")
        self.finish(page.live_page())


class _Code(_Guarded):
    def get(self) -> None:
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        self.finish(page.viewer_code())


class _Socket(_Guarded, tornado.websocket.WebSocketHandler):
    """The connection to one page. At most one frame is under way; what changes meanwhile goes into the next one.

    scene: what the page is to show. shown: what it shows now. seen: number of the newest change that it was sent.
    tornado's `check_origin` refuses pages of other servers.
    """

    def initialize(self, server: Server) -> None:
        self.server = server
        self.scene = self.shown = server.scene
        self.seen = 0
        self._display = 0
        self._busy_since: float | None = None
        self._requests: list[str] = []
        self._pictures: dict[int, Future[str]] = {}

    def open(self, *_: str, **__: str) -> None:
        self.set_nodelay(True)
        with suppress(ValueError, tornado.web.HTTPError):
            self._display = int(self.get_query_argument("display", ""))
        self.server.clients.append(self)
        kept = self.server.displays.kept(self._display)
        if kept is not None:
            self.scene, self.shown = kept, Scene()  # the page shows nothing yet: the first frame is the whole kept scene
        self.next_frame()

    def keep(self) -> None:
        """Keep the display's picture when a newer display has opened, unless the reader has made this page live again."""
        if self.scene is self.server.scene:
            self.scene = self.server.displays.kept(self._display) or self.scene
            self.next_frame()

    def on_close(self) -> None:
        if self in self.server.clients:
            self.server.clients.remove(self)
        for picture in self._pictures.values():
            picture.set_exception(ViewerError("the browser closed before the picture was taken; open it again."))

    def on_message(self, message: str | bytes) -> None:
        """Deal with what the page says. What no page of ours says is ignored: any program of this machine can connect."""
        try:
            answer = json.loads(message)
        except (ValueError, RecursionError):
            return
        kind = answer.get("type") if isinstance(answer, dict) else None
        if kind == "done":
            self._busy_since = None
            self.server.flush()
        elif kind == "live":
            self._display, self.scene = 0, self.server.scene
            self.next_frame()
        elif kind == "image" and isinstance(answer.get("id"), int) and answer["id"] in self._pictures:
            self._pictures.pop(answer["id"]).set_result(str(answer.get("data")))
        elif kind == "control":
            self._control(answer.get("name"), answer.get("value"), str(answer.get("by"))[:40])

    def _control(self, name: Any, value: Any, page: str) -> None:
        """Show the new value of a control in every page, and report it to the window."""
        try:
            value = self.server.scene.move_control(name, value, page)
        except (ViewerError, UnicodeEncodeError):  # half a character in the page's name
            return
        self.server.flush()
        try:
            if self.server.on_control is not None:
                self.server.on_control(name, value)
        except Exception:  # an error in the user's callback is reported, and must not end the connection
            logging.getLogger("floatbase.viewer").exception("the control %r failed", name)

    def request_picture(self, answer: Future[str]) -> None:
        """Request a picture of the scene as it is now."""
        number = id(answer)
        self._pictures[number] = answer
        self._requests.append(json.dumps({"type": "capture", "id": number}))
        self.next_frame()

    def next_frame(self) -> None:
        """Send what the page has not seen, unless it is still drawing the last frame."""
        now = time.monotonic()
        if self._busy_since is not None:
            if now - self._busy_since > PATIENCE:
                self.close(1008, "the page does not read")
            return
        newest, commands = self._unseen()
        if commands:
            self._busy_since, self.seen = now, newest
            self._write(wire.frame(commands), binary=True)
        for request in self._requests:
            self._write(request, binary=False)
        self._requests.clear()

    def _unseen(self) -> tuple[int, list[bytes]]:
        """Number of the newest change, and the commands that bring the page to it."""
        if self.shown is self.scene:
            return self.scene.since(self.seen)
        before, self.shown = self.shown, self.scene
        is_kept = wire.page_command("set_kept", kept=self.scene is not self.server.scene)[1]
        return self.scene.newest, [*self.scene.change_from(before), is_kept]

    def _write(self, message: bytes | str, binary: bool) -> None:
        """Give a message to the connection. When the page has gone, `on_close` cleans up."""
        with suppress(tornado.websocket.WebSocketClosedError):
            self.write_message(message, binary=binary).add_done_callback(lambda done: done.cancelled() or done.exception())


def _application(server: Server) -> tornado.web.Application:
    return tornado.web.Application(
        [(r"/", _Page), (r"/main\.min\.js", _Code), (r"/socket", _Socket, {"server": server})],
        log_function=lambda handler: None,  # do not print refused requests into the notebook
        compress_response=True,
        websocket_ping_interval=20,
        websocket_max_message_size=LONGEST,
    )
