"""The server of a window: a thread with connections to all pages, and a web server on request."""

from __future__ import annotations

import asyncio
import math
import socket
import threading
import weakref
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import tornado.httpserver
import tornado.web
import tornado.websocket

from floatbase.viewer.scene.store import Scene
from floatbase.viewer.transport.connection import Channel, Connection
from floatbase.viewer.transport.notebook_events import CellEvents
from floatbase.viewer.web import pages

FRAME_INTERVAL = 1.0 / 60.0  # s, the least time between two frames
MAX_MESSAGE_SIZE = 1 << 20  # bytes of a message from a page: the longest reports a control


class Server:
    """The thread that serves one scene."""

    def __init__(self, scene: Scene):
        self.scene = scene
        self.port: int | None = None
        self.failure = ""  # why the window cannot draw any more
        self.cells = CellEvents()
        self.clients: list[Connection] = []
        self.on_control: Callable[[str, Any], None] | None = None
        # called in the server's thread when the window closes, if their owners still exist
        self.on_stop: list[weakref.WeakMethod[Callable[[], None]]] = []
        self._http: tornado.httpserver.HTTPServer | None = None
        self._loop = asyncio.new_event_loop()
        # newest change for which a wake-up was requested, and newest that a wake-up has handled
        self._requested = self._sent = 0
        self._last_flush = 0.0
        self._timer: asyncio.TimerHandle | None = None
        ready = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(ready,), name=f"floatbase-window-{id(self):x}", daemon=True
        )
        self._thread.start()
        ready.wait()

    def listen(self, sockets: list[socket.socket]) -> None:
        """Serve the page on sockets too."""
        self.port = sockets[0].getsockname()[1]
        self.call(self._listen, sockets)

    def notify(self, number: int) -> None:
        """Request that a change be sent; cheap while a wake-up is pending."""
        if not self.clients:
            self.scene.sent_to_all = number
        elif self._requested <= self._sent:
            self.call(self.flush)
            # after the call, so an interrupt between them adds a wake-up instead of losing one
            self._requested = number

    @property
    def is_running(self) -> bool:
        """Whether the server still serves pages."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """End the thread and free the port."""
        self.cells.unregister()
        self.call(self._loop.stop)
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=5.0)

    def call(self, function: Callable[..., Any], *args: Any) -> None:
        """Call a function in the server's thread, where everything about pages happens."""
        with suppress(RuntimeError):  # the loop may have closed since the caller checked
            self._loop.call_soon_threadsafe(function, *args)

    def _run(self, ready: threading.Event) -> None:
        """Run the event loop until it is stopped."""
        asyncio.set_event_loop(self._loop)
        self._loop.call_soon(ready.set)
        try:
            self._loop.run_forever()
            self._loop.run_until_complete(self._shutdown())
        finally:
            self._loop.close()

    def _listen(self, sockets: list[socket.socket]) -> None:
        """Start the web server."""
        self._http = tornado.httpserver.HTTPServer(_application(self))
        self._http.add_sockets(sockets)

    async def _shutdown(self) -> None:
        """Disconnect the pages, stop the web server and cancel the remaining tasks."""
        if self._http is not None:
            self._http.stop()
        for stop_callback in [stop_callback() for stop_callback in self.on_stop]:
            if stop_callback is not None:
                stop_callback()
        for client in list(self.clients):
            await client.channel.deliver_rest()
            client.channel.close_page("the window was closed")
        if self._http is not None:
            await self._http.close_all_connections()
        rest = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        for task in rest:
            task.cancel()
        await asyncio.gather(*rest, return_exceptions=True)

    def flush(self, wait: float = 0.0) -> None:
        """Send a frame, at least `FRAME_INTERVAL` after the last one."""
        when = max(self._last_flush + FRAME_INTERVAL, self._loop.time() + wait)
        if self._timer is not None:
            if self._timer.when() <= when:
                return
            self._timer.cancel()
        self._timer = self._loop.call_at(when, self._flush)

    def _flush(self) -> None:
        """Send a frame to every page that can take one; the others call `flush` after drawing."""
        self._timer, self._last_flush = None, self._loop.time()
        self._sent = max(self.scene.newest, self._requested)
        wait = min([client.next_frame() for client in list(self.clients)], default=math.inf)
        if wait < math.inf:
            self.flush(wait)
        sent = [client.sent for client in self.clients]
        self.scene.sent_to_all = min(sent, default=self.scene.newest)


class _Guarded(tornado.web.RequestHandler):
    """Handler that serves 127.0.0.1 and localhost, and refuses other host names."""

    def prepare(self) -> None:
        """Refuse requests to another host name."""
        if self.request.host_name not in ("127.0.0.1", "localhost"):
            raise tornado.web.HTTPError(403)


class _Page(_Guarded):
    """Handler that serves the live page."""

    def get(self) -> None:
        """Send the page."""
        self.set_header("Cache-Control", "no-store")
        self.finish(pages.live_page())


class _Code(_Guarded):
    """Handler that serves meshcat's viewer."""

    def get(self) -> None:
        """Send the code."""
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        self.finish(pages.viewer_code())


class _Socket(_Guarded, tornado.websocket.WebSocketHandler, Channel):
    """Websocket to a page. tornado's `check_origin` refuses pages of other servers."""

    def initialize(self, server: Server) -> None:
        """Store the server."""
        self.server = server

    def open(self, *_: str, **__: str) -> None:
        """Connect the page."""
        self.set_nodelay(True)
        self.page = Connection(self.server, self)
        self.page.next_frame()

    def on_close(self) -> None:
        """Disconnect the page."""
        self.page.close()

    def on_message(self, message: str | bytes) -> None:
        """Handle a message of the page."""
        self.page.receive(message)

    def send_frame(self, number: int, data: bytes) -> None:
        """Send a frame."""
        # when the page has gone, `on_close` cleans up
        with suppress(tornado.websocket.WebSocketClosedError):
            self.write_message(data, binary=True).add_done_callback(
                lambda done: done.cancelled() or done.exception()
            )

    def close_page(self, reason: str) -> None:
        """Close the websocket."""
        self.close(1001, reason)


def _application(server: Server) -> tornado.web.Application:
    """Return the web application: the page, its code and the websocket."""
    return tornado.web.Application(
        [(r"/", _Page), (r"/main\.min\.js", _Code), (r"/socket", _Socket, {"server": server})],
        log_function=lambda handler: None,  # do not print refused requests into the notebook
        compress_response=True,
        websocket_ping_interval=20,
        websocket_max_message_size=MAX_MESSAGE_SIZE,
    )
