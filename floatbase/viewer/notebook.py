"""The picture in a notebook: a widget whose frames travel over the kernel's own connection, as a slider's values do.

So it works wherever sliders work, with no port of its own: JupyterLab, Notebook, VS Code, Colab, a hub, Voilà. The widget is
`anywidget`'s, which brings what each of these needs in one package and leaves the rest to us: widget.js, which holds the page
in a frame. The page's code is sent once to each page of the notebook that asks for it.
"""

from __future__ import annotations

import contextvars
import gzip
import hashlib
import threading
import weakref
from functools import cache
from pathlib import Path
from typing import Any

import anywidget
import traitlets

from floatbase.viewer import page
from floatbase.viewer.cells import hear_at_once
from floatbase.viewer.connection import Connection, Line
from floatbase.viewer.server import Server

PACE = 1.0 / 30.0  # s from frame to frame: every one is a message of the kernel, of which Jupyter takes 1000 a second at most
_UNDER_WAY = 2  # frames: so a page far away gets one for each half of the way there and back
_MOST_PAGES = 50  # of one display; one that is closed without a word is forgotten after them


class NotebookPicture(anywidget.AnyWidget):
    """One display of a window's scene.

    name: what the picture shows, for screen readers. height: pixels. still: a PNG of the scene as it is now, for the time
    until the page has drawn, and for places where no page can; empty for none.
    """

    _esm = Path(__file__).with_name("widget.js").read_text(encoding="utf-8")
    version = traitlets.Unicode().tag(sync=True)
    name = traitlets.Unicode().tag(sync=True)
    height = traitlets.Int().tag(sync=True)
    still = traitlets.Bytes().tag(sync=True)

    def __init__(self, server: Server, display: int, name: str, height: int, still: bytes = b""):
        super().__init__(version=_packed()[0], name=name, height=height, still=still)
        self._to = _Display(self, server, display)
        self.on_msg(self._to.hear)
        hear_at_once(self)


class _Display:
    """The pages of one widget. `hear` may be called in any thread; all else is done in the server's."""

    def __init__(self, widget: NotebookPicture, server: Server, number: int):
        self._widget, self._number = weakref.ref(widget), number
        self._server = weakref.ref(server)
        self._pages: dict[str, _Way] = {}
        server.on_stop[:] = [told for told in server.on_stop if told() is not None]
        server.on_stop.append(weakref.WeakMethod(self._stop))

    def hear(self, _: Any, content: Any, buffers: Any) -> None:
        """A message of a page, {page, say}; what no page of ours sends is ignored."""
        server = self._server()
        if server is None or not server.is_running:
            return self._tell_closed()
        if isinstance(content, dict) and isinstance(content.get("say"), str) and isinstance(content.get("page"), str):
            waits = threading.current_thread() is threading.main_thread()
            server.call(self._deal, server, content["page"][:40], content["say"], waits, contextvars.copy_context())

    def _deal(self, server: Server, name: str, say: str, waits: bool, context: contextvars.Context) -> None:
        known = self._pages.get(name)
        if known is not None:
            known.waits, known.context = waits, context
        way = known or _Way(self, server, name, waits, context)
        if say == "code":
            way.send({"code": True}, *_packed()[1])
        elif say in ("hello", "bye"):
            self.forget(name)
            if say == "hello":
                self._greet(server, _Way(self, server, name, waits, context))
        elif known is None:
            way.end("it was let go")
        else:
            known.page.hear(say)

    def _greet(self, server: Server, way: _Way) -> None:
        for name in list(self._pages)[: 1 - _MOST_PAGES]:
            self.forget(name)
        self._pages[way.name] = way
        way.page = Connection(server, way, self._number)
        way.page.next_frame()

    def forget(self, name: str) -> None:
        """The page has gone."""
        if name in self._pages:
            self._pages.pop(name).page.end()

    def send(self, content: dict[str, Any], *buffers: bytes) -> None:
        """Send a message to the pages."""
        widget = self._widget()
        if widget is not None:
            widget.send(content, list(buffers))

    def _stop(self) -> None:
        """The window closes: the pages keep their pictures."""
        for name in list(self._pages):
            self.forget(name)
        self._tell_closed()

    def _tell_closed(self) -> None:
        self.send({"closed": True})


class _Way(Line):
    """The way to one page: messages of the widget that name the page, so that no other page takes them.

    waits: whether what the page says is heard only between cells. Where the notebook sends it to a subshell of the kernel, it
    is heard at once. context: of a message of the page; what is sent in it is an answer, so the page's next words go the
    same way.
    """

    most, pace = _UNDER_WAY, PACE
    page: Connection

    def __init__(self, display: _Display, server: Server, name: str, waits: bool, context: contextvars.Context):
        self.name, self.waits = name, waits
        self.context = context
        self._display, self._cells = display, server.cells

    @property
    def heard_since(self) -> float | None:
        if not self.waits:
            return 0.0
        return None if self._cells.runs else self._cells.ended

    def send(self, content: dict[str, Any], *buffers: bytes) -> None:
        """Send a message to this page."""
        self.context.run(self._display.send, {**content, "page": self.name}, *buffers)

    def frame(self, number: int, data: bytes) -> None:
        self.send({"frame": number}, data)

    def text(self, message: str) -> None:
        self.send({"text": message})

    def end(self, reason: str) -> None:
        self._display.forget(self.name)
        self.send({"lost": reason})


@cache
def _packed() -> tuple[str, tuple[bytes, bytes]]:
    """A name of this version of the page, and its HTML and the viewer's code, each packed by gzip."""
    parts = page.notebook_page().encode(), page.viewer_code()
    packed = gzip.compress(parts[0], 9, mtime=0), gzip.compress(parts[1], 9, mtime=0)
    return hashlib.sha256(b"".join(parts)).hexdigest()[:16], packed
