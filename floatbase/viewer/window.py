"""The meshcat window: meshcat's viewer served from a thread of this process, on this machine only.

meshcat's own server is a process of its own that listens on all interfaces, outlives the kernel, and waits for a browser.
`Window` has the interface of meshcat's `ViewerWindow`, so `meshcat.Visualizer(window=Window())` draws into it.
"""

from __future__ import annotations

import asyncio
import base64
import io
import json
import logging
import socket
import threading
import time
import weakref
import webbrowser
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Protocol

import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket

from floatbase.errors import ViewerError
from floatbase.viewer import page, wire
from floatbase.viewer.displays import Displays
from floatbase.viewer.place import before_each_cell

if TYPE_CHECKING:
    from PIL.Image import Image

ADDRESS = "127.0.0.1"
FRAME_TIME = 1.0 / 60.0  # s between frames at most
PATIENCE = 30.0  # s a page may take over one frame before it is dropped; it comes back by itself


class Command(Protocol):
    """A meshcat command, as `meshcat.commands.SetObject`."""

    def lower(self) -> dict[str, Any]:
        """The command as plain data."""


class Window:
    """A meshcat window in this process.

    port: the port to listen on; a free one by default. Raises `ViewerError` when the port is taken.

    `send` may be called from any thread and be interrupted at any point. The scene is kept here: a page that opens late gets
    all of it, a page that reads slowly gets the newest value of everything, and memory does not grow with either.
    The window closes with `close()`, when it is no longer referenced, and at exit.
    """

    def __init__(self, port: int = 0):
        self.scene = wire.Scene()
        self._server = _Server(self.scene, _listen(port))
        self._closer = weakref.finalize(self, _both, self._server.stop, before_each_cell(self._server.displays.mark))

    @property
    def port(self) -> int:
        """The port that the window listens on."""
        return self._server.port

    @property
    def web_url(self) -> str:
        """Address of the page."""
        return f"http://{ADDRESS}:{self.port}/"

    def open_display(self) -> str:
        """Address of a page for a notebook's output: live until the next one opens, then it keeps the picture it had."""
        number = self._server.displays.open()
        self._server.keep()
        return f"{self.web_url}?display={number}"

    @property
    def browsers(self) -> int:
        """How many pages are connected."""
        return len(self._server.clients)

    @property
    def is_open(self) -> bool:
        """Whether the window still serves its page."""
        return self._closer.alive

    def send(self, command: Command) -> None:
        """Draw a meshcat command."""
        self.put([wire.encode(command.lower())])

    def put(self, updates: Iterable[wire.Update]) -> None:
        """Draw several updates in one frame. Raises `ViewerError` when the window is closed."""
        if not self._closer.alive:
            raise ViewerError("the viewer window is closed, so nothing can be drawn; open a new one.")
        self._server.wake(self.scene.put(updates))

    def on_control(self, callback: Callable[[str, Any], None] | None) -> None:
        """Call `callback(name, value)`, in the window's thread, when a control of the page is used."""
        self._server.on_control = callback

    def wait(self, timeout: float = 30.0) -> None:
        """Wait until a page is connected, at most `timeout` s; then raise `ViewerError`."""
        deadline = time.monotonic() + timeout
        while not self._server.clients:
            if time.monotonic() > deadline:
                raise ViewerError(f"no browser opened {self.web_url} within {timeout:g} s; open it there.")
            time.sleep(0.01)

    def open(self) -> Window:
        """Open the page in the default browser."""
        webbrowser.open(self.web_url, new=2)
        return self

    def get_scene(self) -> str:
        """The scene as one HTML page that needs no server."""
        return page.file_page(self.scene.lasting())

    def get_image(self, timeout: float = 10.0) -> Image:
        """A picture of the live page that connected last, as a PIL image.

        Raises `ViewerError` at once when no page is connected or all keep earlier pictures, and after `timeout` s when the
        page does not answer.
        """
        from PIL import Image

        if not self._server.clients:
            raise ViewerError(
                f"no browser shows this window, so there is no picture to take; open {self.web_url} first "
                "(window.wait() waits for it)."
            )
        try:
            data = self._server.capture().result(timeout)
        except FutureTimeout:
            raise ViewerError(f"the browser did not answer within {timeout:g} s; is its tab still open?") from None
        return Image.open(io.BytesIO(base64.b64decode(data.split(",", 1)[1])))

    def close(self) -> None:
        """Stop serving: the thread ends and the port is free. Closing twice does nothing."""
        self._closer()

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Window({self.web_url}, {'open' if self.is_open else 'closed'})"


def _both(first: Callable[[], None], second: Callable[[], None]) -> None:
    first()
    second()


def _listen(port: int) -> list[socket.socket]:
    """Sockets on the loopback address."""
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port < 65536:
        raise ViewerError(f"port is {port!r}; it must be a whole number from 0 (a free one) to 65535.")
    try:
        return tornado.netutil.bind_sockets(port, ADDRESS, family=socket.AF_INET)
    except OSError as error:
        raise ViewerError(
            f"port {port} of {ADDRESS} cannot be used ({error.strerror}). Close what listens there, choose another port, "
            "or leave the port out to get a free one."
        ) from None


class _Server:
    """The thread that serves one scene. It knows nothing of its `Window`, so that a dropped window can end it."""

    def __init__(self, scene: wire.Scene, sockets: list[socket.socket]):
        self.scene = scene
        self.port: int = sockets[0].getsockname()[1]
        self.displays = Displays(scene)
        self.clients: list[_Socket] = []
        self.on_control: Callable[[str, Any], None] | None = None
        self._sockets = sockets
        self._loop = asyncio.new_event_loop()
        self._asked = self._sent = 0  # newest change that a wake-up was asked for; newest that a wake-up dealt with
        self._last_flush = 0.0
        self._timer: asyncio.TimerHandle | None = None
        ready = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(ready,), name=f"floatbase-window-{self.port}", daemon=True)
        self._thread.start()
        ready.wait()

    def wake(self, number: int) -> None:
        """See to it that change `number` is sent; cheap while a wake-up is under way. Any thread."""
        if not self.clients:
            self.scene.seen_by_all = number
        elif self._asked <= self._sent:
            self._call(self.flush)
            self._asked = number  # after the call: an interrupt between the two costs a wake-up too many, not one too few

    def keep(self) -> None:
        """Let the pages of earlier displays keep their pictures."""
        self._call(self._keep)

    def capture(self) -> Future[str]:
        """Ask the last page for a picture, as a data URL."""
        answer: Future[str] = Future()
        self._call(self._capture, answer)
        return answer

    def stop(self) -> None:
        """End the thread and free the port."""
        self._call(self._loop.stop)
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=5.0)

    def _call(self, function: Callable[..., Any], *args: Any) -> None:
        with suppress(RuntimeError):  # the loop may have closed between the caller's check and now
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
        """Send a frame now, or when the last one is `FRAME_TIME` old. Loop thread."""
        if self._timer is None:
            wait = self._last_flush + FRAME_TIME - self._loop.time()
            self._timer = self._loop.call_later(max(wait, 0.0), self._flush)

    def _flush(self) -> None:
        """Start a frame for every page that is idle; the others come back to `flush` when they are done."""
        self._timer, self._last_flush = None, self._loop.time()
        self._sent = max(self.scene.newest, self._asked)
        for client in list(self.clients):
            client.next_frame()
        seen = (client.seen for client in self.clients if client.scene is self.scene)
        self.scene.seen_by_all = min(seen, default=self.scene.newest)

    def _keep(self) -> None:
        for client in list(self.clients):
            client.keep()

    def _capture(self, answer: Future[str]) -> None:
        live = [client for client in self.clients if client.wanted is self.scene]
        if live:
            live[-1].ask_picture(answer)
        elif self.clients:
            answer.set_exception(ViewerError("every open page keeps an earlier picture; press 'make live' in one of them."))
        else:
            answer.set_exception(ViewerError("the browser closed before the picture was taken; open it again."))


class _Guarded(tornado.web.RequestHandler):
    """Answers only requests addressed to this machine by name: a foreign page cannot reach us under a name of its own."""

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
    """One page. At most one frame is under way to it; what changes meanwhile goes into the next.

    tornado's `check_origin` refuses pages from elsewhere.
    """

    def initialize(self, server: _Server) -> None:
        self.server = server
        self.scene = self.wanted = server.scene
        self.seen = 0
        self._display = 0
        self._busy_since: float | None = None
        self._requests: list[str] = []
        self._pictures: dict[int, Future[str]] = {}

    def open(self, *_: str, **__: str) -> None:
        self.set_nodelay(True)
        number = self.get_query_argument("display", "")
        self._display = int(number) if number.isdecimal() else 0
        self.server.clients.append(self)
        kept = self.server.displays.kept(self._display)
        if kept is not None:
            self.scene = wire.Scene()  # so that the first frame is the whole of the kept one
            self.wanted = kept
        self.next_frame()

    def keep(self) -> None:
        """Keep the picture that this page's display had, if a newer one has opened and the reader has not asked otherwise."""
        if self.wanted is self.server.scene:
            self.wanted = self.server.displays.kept(self._display) or self.wanted
            self.next_frame()

    def on_close(self) -> None:
        if self in self.server.clients:
            self.server.clients.remove(self)
        for picture in self._pictures.values():
            picture.set_exception(ViewerError("the browser closed before the picture was taken; open it again."))

    def on_message(self, message: str | bytes) -> None:
        answer = json.loads(message)
        if answer.get("type") == "done":
            self._busy_since = None
            self.server.flush()
        elif answer.get("type") == "live":
            self._display, self.wanted = 0, self.server.scene
            self.next_frame()
        elif answer.get("type") == "image" and answer.get("id") in self._pictures:
            self._pictures.pop(answer["id"]).set_result(answer["data"])
        elif answer.get("type") == "control" and self.server.on_control is not None:
            try:
                self.server.on_control(answer["name"], answer["value"])
            except Exception:  # an error in the user's callback must not end the connection; it is told like any other
                logging.getLogger("floatbase.viewer").exception("the control %r failed", answer["name"])

    def ask_picture(self, answer: Future[str]) -> None:
        """Ask for a picture of the scene as it is now."""
        number = id(answer)
        self._pictures[number] = answer
        self._requests.append(json.dumps({"type": "capture", "id": number}))
        self.next_frame()

    def next_frame(self) -> None:
        """Send what the page has not seen, unless it is still busy with the last frame."""
        now = time.monotonic()
        if self._busy_since is not None:
            if now - self._busy_since > PATIENCE:
                self.close(1008, "the page does not read")
            return
        newest, commands = self._news()
        if commands:
            self._busy_since, self.seen = now, newest
            self._write(wire.frame(commands), binary=True)
        for request in self._requests:
            self._write(request, binary=False)
        self._requests.clear()

    def _news(self) -> tuple[int, list[bytes]]:
        """Number of the newest change, and what the page has to be told to show it."""
        if self.scene is self.wanted:
            return self.scene.since(self.seen)
        before, self.scene = self.scene, self.wanted
        told = wire.page_command("set_kept", kept=self.scene is not self.server.scene)[1]
        return self.scene.newest, [*self.scene.instead_of(before), told]

    def _write(self, message: bytes | str, binary: bool) -> None:
        """Hand a message to the connection; when the page has gone, `on_close` tidies up."""
        with suppress(tornado.websocket.WebSocketClosedError):
            self.write_message(message, binary=binary).add_done_callback(lambda done: done.cancelled() or done.exception())


def _application(server: _Server) -> tornado.web.Application:
    return tornado.web.Application(
        [(r"/", _Page), (r"/main\.min\.js", _Code), (r"/socket", _Socket, {"server": server})],
        log_function=lambda handler: None,  # refused requests are answered, not printed into the notebook
        compress_response=True,
        websocket_ping_interval=20,
    )
