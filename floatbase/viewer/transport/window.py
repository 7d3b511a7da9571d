"""The meshcat window: a thread of this process serves meshcat's viewer, to its own notebook and,
when asked, to this machine.

meshcat's own server is another process, which listens on all interfaces, outlives the kernel, and
waits for a browser. `Window` has the interface of meshcat's `ViewerWindow`, so
`meshcat.Visualizer(window=Window())` draws into it.
"""

from __future__ import annotations

import base64
import io
import socket
import threading
import time
import weakref
import webbrowser
from collections.abc import Callable, Iterable
from concurrent.futures import TimeoutError as FutureTimeout
from typing import TYPE_CHECKING, Any, Protocol

import tornado.netutil

from floatbase.errors import ViewerError
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.store import Scene
from floatbase.viewer.transport.server import Server
from floatbase.viewer.web import pages

if TYPE_CHECKING:
    from PIL.Image import Image

    from floatbase.viewer.transport.notebook_widget import NotebookWidget

ADDRESS = "127.0.0.1"


class Command(Protocol):
    """A meshcat command, for example `meshcat.commands.SetObject`."""

    def lower(self) -> dict[str, Any]:
        """The command as plain data, ready to be packed."""


class Window:
    """A meshcat window in this process.

    port: the port to listen on, at once; 0, the default, takes a free one when `port`, `web_url` or
        `open` asks for it. So a window that only notebooks show listens nowhere, and no other user
        of the machine reaches it. Raises `ViewerError` when the port is taken.

    Any thread may draw, and an interrupt while it draws does no harm. The window stores the scene:
    a page that opens late receives all of it, and a page that reads slowly receives the newest
    value of everything. Neither costs more memory. The window closes with `close()`, when nothing
    refers to it any more, and when Python exits.
    """

    def __init__(self, port: int = 0):
        self.scene = Scene()
        sockets = _bound_sockets(port) if _checked_port(port) else []
        self._server = Server(self.scene)
        self._opening = threading.Lock()
        if sockets:
            self._server.listen(sockets)
        self._finalizer = weakref.finalize(self, self._server.stop)

    @property
    def port(self) -> int:
        """The port that the window listens on, from now on. Raises `ViewerError` when it is closed
        and never had one.
        """
        with self._opening:
            if self._server.port is None:
                self._check_open("it has no page")
                self._server.listen(_bound_sockets(0))
            assert self._server.port is not None
            return self._server.port

    @property
    def is_listening(self) -> bool:
        """Whether the window has a port; to ask for it or for its address opens one."""
        return self._server.port is not None

    @property
    def web_url(self) -> str:
        """Address of the page."""
        return f"http://{ADDRESS}:{self.port}/"

    def widget(self, name: str, height: int, thumbnail: bytes = b"") -> NotebookWidget:
        """A display in a notebook, which needs no port. It is live until the next one opens; then
        it keeps its picture.

        name: what it shows. height: pixels. thumbnail: a PNG of the same, for the time before the
            page has drawn.
        """
        from floatbase.viewer.transport.notebook_widget import (
            NotebookWidget,
        )  # loads ipywidgets, which no script needs

        number = self._server.outputs.open()
        self._server.freeze_outputs()
        return NotebookWidget(self._server, number, name, height, thumbnail)

    @property
    def n_pages(self) -> int:
        """How many pages are connected."""
        return len(self._server.clients)

    @property
    def is_open(self) -> bool:
        """Whether the window still serves its page."""
        return self._finalizer.alive

    def send(self, command: Command) -> None:
        """Draw a meshcat command."""
        self.put([protocol.encode(command.lower())])

    def put(self, updates: Iterable[protocol.Update]) -> None:
        """Draw several updates (key and command, see `protocol`) in one frame. Raises `ViewerError`
        when the window is closed.
        """
        self._check_open("nothing can be drawn")
        self._server.notify(self.scene.put(updates))

    def on_control(self, callback: Callable[[str, Any], None] | None) -> None:
        """Call `callback(name, value)` in the window's thread when a page's control is used."""
        self._server.on_control = callback

    def wait(self, timeout: float = 30.0) -> None:
        """Wait until a page is connected. Raises `ViewerError` after `timeout` s."""
        deadline = time.monotonic() + timeout
        while not self._server.clients:
            if time.monotonic() > deadline:
                raise ViewerError(
                    f"no browser opened {self._page} within {timeout:g} s; open it there."
                )
            time.sleep(0.01)

    def open(self) -> Window:
        """Open the page in the default browser."""
        webbrowser.open(self.web_url, new=2)
        return self

    def get_scene(self) -> str:
        """The scene as one HTML page that needs neither a server nor a network."""
        return pages.file_page(self.scene.file_commands())

    def get_image(self, timeout: float = 10.0) -> Image:
        """A picture of the live page, as a PIL image; of several pages, of the one that connected
        last.

        Raises `ViewerError` when no page is connected, when every page keeps an earlier picture,
        and when the page does not answer with a picture within `timeout` s.
        """
        from PIL import Image

        if not self._server.clients:
            raise ViewerError(
                f"no browser shows this window, so there is no picture to take; open {self._page} "
                f"first "
                "(window.wait() waits for it)."
            )
        try:
            data = self._server.capture().result(timeout)
        except FutureTimeout:
            raise ViewerError(
                f"the browser did not answer within {timeout:g} s; is its tab still open?"
            ) from None
        try:
            image = Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2])))
            image.load()
        except (ValueError, OSError):
            raise ViewerError(
                "the browser sent no picture; look whether the page shows one, and reload it."
            ) from None
        return image

    def close(self) -> None:
        """Stop serving: the thread ends and the port is free. To close a closed window does
        nothing.
        """
        self._finalizer()

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        address = f"{self.web_url}, " if self.is_listening else ""
        return f"Window({address}{'open' if self.is_open else 'closed'})"

    @property
    def _page(self) -> str:
        """The page in a message. An error opens no port."""
        return (
            self.web_url if self.is_listening else "the page at its `web_url` (of a viewer: `url`)"
        )

    def _check_open(self, lost: str) -> None:
        if not self._finalizer.alive:
            raise ViewerError(f"the viewer window is closed, so {lost}; open a new one.")


def _checked_port(port: int) -> int:
    """The number of a port, 0 for any. Raises `ViewerError` when it is none."""
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port < 65536:
        raise ViewerError(
            f"port is {port!r}; it must be a whole number from 0 (a free one) to 65535."
        )
    return port


def _bound_sockets(port: int) -> list[socket.socket]:
    """Sockets listening on the loopback address. Raises `ViewerError` for a port in use."""
    try:
        return tornado.netutil.bind_sockets(port, ADDRESS, family=socket.AF_INET)
    except OSError as error:
        raise ViewerError(
            f"port {port} of {ADDRESS} cannot be used ({error.strerror}). Close what listens "
            f"there, choose another port, "
            "or leave the port out to get a free one."
        ) from None
