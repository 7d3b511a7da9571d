"""The window: a thread of this process that serves the page.

The thread serves its own notebook and, on request, this machine. meshcat's own server is a separate
process, which listens on all interfaces, outlives the kernel, and waits for a browser.
"""

from __future__ import annotations

import socket
import weakref
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import tornado.netutil

from floatbase._locks import InterruptibleLock
from floatbase._validation import short_repr
from floatbase.errors import MissingDependencyError, ViewerError
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.store import Scene
from floatbase.viewer.transport.server import Server

if TYPE_CHECKING:
    from meshcat import Visualizer

    from floatbase.viewer.transport.notebook_widget import NotebookWidget

ADDRESS = "127.0.0.1"


class Window:
    """A meshcat window in this process."""

    def __init__(self, port: int = 0):
        self.scene = Scene()
        sockets = _bound_sockets(port) if _checked_port(port) else []
        self._server = Server(self.scene)
        self._opening = InterruptibleLock()
        self._newest_display: Callable[[], NotebookWidget | None] = lambda: None
        if sockets:
            self._server.listen(sockets)
        self._finalizer = weakref.finalize(self, self._server.stop)

    @property
    def port(self) -> int:
        """Port that the window listens on; reading it opens one."""
        with self._opening:
            if self._server.port is None:
                self._check_open("it has no page")
                self._server.listen(_bound_sockets(0))
            assert self._server.port is not None
            return self._server.port

    @property
    def is_listening(self) -> bool:
        """Whether the window has a port; reading `port` or `web_url` opens one."""
        return self._server.port is not None

    @property
    def web_url(self) -> str:
        """Address of the page."""
        return f"http://{ADDRESS}:{self.port}/"

    def widget(self, name: str, height: int, thumbnail: bytes = b"") -> NotebookWidget:
        """Make a display for a notebook, which needs no port."""
        try:  # loads ipywidgets, which no script needs
            from floatbase.viewer.transport.notebook_widget import NotebookWidget
        except ImportError as error:
            raise MissingDependencyError(
                f"A viewer in a notebook needs the package {error.name}, which is not installed. "
                'Install it with pip install "floatbase[viewer]". The page at `url` does not need '
                "it."
            ) from None
        if (before := self._newest_display()) is not None:
            before.retire()
        made = NotebookWidget(self._server, name, height, thumbnail)
        self._newest_display = weakref.ref(made)
        return made

    def draw_into(self, visualizer: Visualizer) -> None:
        """Draw into a stock meshcat server too."""
        # loads pyzmq, which no other window needs
        from floatbase.viewer.transport.mirror import MeshcatMirror

        MeshcatMirror(self._server, visualizer)

    @property
    def n_pages(self) -> int:
        """Number of connected pages."""
        return len(self._server.clients)

    @property
    def is_open(self) -> bool:
        """Whether the window still serves its page."""
        return self._finalizer.alive

    def put(self, updates: Iterable[protocol.Update]) -> None:
        """Draw several updates in one frame."""
        self._check_open("nothing can be drawn")
        self._server.notify(self.scene.put(updates))

    def on_control(self, callback: Callable[[str, Any], None] | None) -> None:
        """Set the function that is called when the reader uses a control."""
        self._server.on_control = callback

    def close(self) -> None:
        """Stop serving: end the thread and free the port. Closing a closed window does nothing."""
        self._finalizer()

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        address = f"{self.web_url}, " if self.is_listening else ""
        return f"Window({address}{'open' if self.is_open else 'closed'})"

    def _check_open(self, lost: str) -> None:
        """Raise `ViewerError` if the window is closed."""
        if not self._finalizer.alive:
            raise ViewerError(f"The viewer's window is closed, so {lost}. Open a new one.")
        if self._server.failure:
            raise ViewerError(
                f"{self._server.failure}, so {lost}. Make a new meshcat.Visualizer, and a new "
                f"Viewer for it."
            )


def _checked_port(port: int) -> int:
    """Return a port number, 0 for any; raise `ViewerError` if it is invalid."""
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port < 65536:
        raise ViewerError(
            f"port is {short_repr(port)}; it must be a whole number from 0 (any free port) to "
            f"65535."
        )
    return port


def _bound_sockets(port: int) -> list[socket.socket]:
    """Return sockets that listen on the loopback address; raise `ViewerError` if it fails."""
    try:
        return tornado.netutil.bind_sockets(port, ADDRESS, family=socket.AF_INET)
    except OSError as error:
        raise ViewerError(
            f"Cannot listen on port {port} of {ADDRESS} ({error.strerror}). Stop the program that "
            "uses it, choose another port, or leave the port out to get a free one."
        ) from None
