"""The picture in a notebook: a widget whose frames use the kernel's own connection, like sliders.

The widget works wherever sliders work, without its own port: JupyterLab, Notebook, VS Code, Colab,
JupyterHub, Voilà. The base class from `anywidget` contains the code that each of these needs. This
package adds widget.js, which shows the page in a frame. The page's code is sent once to each page
of the notebook that requests it.
"""

from __future__ import annotations

import contextvars
import gzip
import hashlib
import threading
import weakref
from functools import cache
from typing import Any

import anywidget
import traitlets

from floatbase.viewer.transport.connection import Channel, Connection
from floatbase.viewer.transport.notebook_events import receive_during_cells
from floatbase.viewer.transport.server import Server
from floatbase.viewer.web import pages

# s between frames: each is a message of the kernel, and Jupyter accepts at most 1000 a second
FRAME_INTERVAL = 1.0 / 30.0
_MAX_IN_FLIGHT = 2  # frames: so a distant page gets one per half of the round-trip time
_MAX_PAGES = 50  # of one display; a page that closed silently is dropped after this many others


class NotebookWidget(anywidget.AnyWidget):
    """One display of a window's scene."""

    _esm = pages.asset("widget.js")
    version = traitlets.Unicode().tag(sync=True)
    name = traitlets.Unicode().tag(sync=True)
    height = traitlets.Int().tag(sync=True)
    thumbnail = traitlets.Bytes().tag(sync=True)
    is_live = traitlets.Bool(True).tag(sync=True)

    def __init__(self, server: Server, name: str, height: int, thumbnail: bytes = b""):
        super().__init__(version=_page_code()[0], name=name, height=height, thumbnail=thumbnail)
        self._output_pages = _OutputPages(self, server)
        self.on_msg(self._output_pages.receive)
        receive_during_cells(self)

    def retire(self) -> None:
        """Show the thumbnail from now on, because a newer display has opened."""
        self.is_live = False
        self._output_pages.drop_all()


class _OutputPages:
    """The pages of one widget."""

    def __init__(self, widget: NotebookWidget, server: Server):
        self._widget, self._server = weakref.ref(widget), weakref.ref(server)
        self._pages: dict[str, _WidgetChannel] = {}
        server.on_stop[:] = [callback for callback in server.on_stop if callback() is not None]
        server.on_stop.append(weakref.WeakMethod(self._stop))

    def receive(self, _: Any, content: Any, buffers: Any) -> None:
        """Handle a message {page, say} of a page; ignore anything else."""
        server = self._server()
        if server is None or not server.is_running:
            return self._send_closed()
        page, say = (
            (content.get("page"), content.get("say")) if isinstance(content, dict) else ("", 0)
        )
        if isinstance(page, str) and isinstance(say, str):
            answers_wait = threading.current_thread() is threading.main_thread()
            context = contextvars.copy_context()
            server.call(self._handle, server, page[:40], say, answers_wait, context)

    def _handle(
        self, server: Server, name: str, say: str, answers_wait: bool, context: contextvars.Context
    ) -> None:
        """Handle a message in the server's thread."""
        known = self._pages.get(name)
        if known is not None:
            known.answers_wait, known.context = answers_wait, context
        channel = known or _WidgetChannel(self, server, name, answers_wait, context)
        if say == "code":
            channel.send({"code": True}, *_page_code()[1])
        elif say in ("hello", "bye"):
            self.drop(name)
            if say == "hello":
                self._connect(server, _WidgetChannel(self, server, name, answers_wait, context))
        elif known is None:
            channel.close_page("the page was disconnected")
        else:
            known.page.receive(say)

    def _connect(self, server: Server, channel: _WidgetChannel) -> None:
        """Connect a page; drop the oldest ones if there are too many."""
        for name in list(self._pages)[: 1 - _MAX_PAGES]:
            self.drop(name)
        self._pages[channel.name] = channel
        channel.page = Connection(server, channel)
        channel.page.next_frame()

    def drop(self, name: str) -> None:
        """Forget a page."""
        if name in self._pages:
            self._pages.pop(name).page.close()

    def drop_all(self) -> None:
        """Send no more frames; any thread may call this."""
        if (server := self._server()) is not None:
            server.call(self._drop_all)

    def send(self, content: dict[str, Any], *buffers: bytes) -> None:
        """Send a message to the pages."""
        widget = self._widget()
        if widget is not None:
            widget.send(content, list(buffers))

    def _stop(self) -> None:
        """End the connections because the window closes; the pages keep their pictures."""
        self._drop_all()
        self._send_closed()

    def _drop_all(self) -> None:
        """Forget all pages."""
        for name in list(self._pages):
            self.drop(name)

    def _send_closed(self) -> None:
        """Tell the pages that the viewer is closed."""
        self.send({"closed": True})


class _WidgetChannel(Channel):
    """The channel to one page: messages that name the page, so that other pages ignore them."""

    max_in_flight, min_interval = _MAX_IN_FLIGHT, FRAME_INTERVAL
    page: Connection

    def __init__(
        self,
        display: _OutputPages,
        server: Server,
        name: str,
        answers_wait: bool,
        context: contextvars.Context,
    ):
        self.name, self.answers_wait, self.context = name, answers_wait, context
        self._display, self._cells = display, server.cells

    @property
    def answers_since(self) -> float | None:
        """Time from which the page's answers arrive [s]; None while a cell delays them."""
        if not self.answers_wait:
            return 0.0
        return None if self._cells.is_running else self._cells.ended_at

    def send(self, content: dict[str, Any], *buffers: bytes) -> None:
        """Send a message to this page."""
        self.context.run(self._display.send, {**content, "page": self.name}, *buffers)

    def send_frame(self, number: int, data: bytes) -> None:
        """Send a frame to this page."""
        self.send({"frame": number}, data)

    def close_page(self, reason: str) -> None:
        """Disconnect this page."""
        self._display.drop(self.name)
        self.send({"lost": reason})


@cache
def _page_code() -> tuple[str, tuple[bytes, bytes]]:
    """Return the hash of the page's version, and its HTML and the viewer's code, both gzipped."""
    parts = pages.notebook_page().encode(), pages.viewer_code()
    packed = gzip.compress(parts[0], 9, mtime=0), gzip.compress(parts[1], 9, mtime=0)
    return hashlib.sha256(b"".join(parts)).hexdigest()[:16], packed
