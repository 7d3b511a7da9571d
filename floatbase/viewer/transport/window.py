"""The window: a thread of this process serves meshcat's viewer, to its own notebook and, when
asked, to this machine.

meshcat's own server is another process, which listens on all interfaces, outlives the kernel, and
waits for a browser.
"""

from __future__ import annotations

import socket
import threading
import weakref
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import tornado.netutil

from floatbase.errors import ViewerError
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.store import Scene
from floatbase.viewer.transport.server import Server

if TYPE_CHECKING:
    from floatbase.viewer.transport.notebook_widget import NotebookWidget

ADDRESS = "127.0.0.1"


class Window:
    """A meshcat window in this process.

    port: the port to listen on, at once; 0, the default, takes a free one when `port` or `web_url`
        asks for it. So a window that only notebooks show listens nowhere, and no other user
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
        self._newest_display: Callable[[], NotebookWidget | None] = lambda: None
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
        it shows its thumbnail.

        name: what it shows. height: pixels. thumbnail: a PNG of the same.
        Raises `ViewerError` without anywidget.
        """
        try:  # loads ipywidgets, which no script needs
            from floatbase.viewer.transport.notebook_widget import NotebookWidget
        except ImportError as error:
            raise ViewerError(
                f"A viewer in a notebook needs the package {error.name}, which is not installed. "
                'Install it with: pip install "floatbase[viewer]". The page at `url` needs none.'
            ) from None
        if (before := self._newest_display()) is not None:
            before.retire()
        made = NotebookWidget(self._server, name, height, thumbnail)
        self._newest_display = weakref.ref(made)
        return made

    @property
    def n_pages(self) -> int:
        """How many pages are connected."""
        return len(self._server.clients)

    @property
    def is_open(self) -> bool:
        """Whether the window still serves its page."""
        return self._finalizer.alive

    def put(self, updates: Iterable[protocol.Update]) -> None:
        """Draw several updates (key and command, see `protocol`) in one frame. Raises `ViewerError`
        when the window is closed.
        """
        self._check_open("nothing can be drawn")
        self._server.notify(self.scene.put(updates))

    def on_control(self, callback: Callable[[str, Any], None] | None) -> None:
        """Call `callback(name, value)` in the window's thread when a page's control is used."""
        self._server.on_control = callback

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
