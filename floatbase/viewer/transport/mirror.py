"""The page of a stock meshcat server, which shows the same picture as a window.

The server draws for other programs too, so everything lies below a path of this window.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import msgpack
import zmq
import zmq.asyncio

from floatbase.viewer.scene import protocol
from floatbase.viewer.transport.connection import Channel, Connection

if TYPE_CHECKING:
    from meshcat import Visualizer

    from floatbase.viewer.transport.server import Server

_DRAWN = "set_object", "set_transform", "set_property", "delete"
_FINISHING_TIME = 2.0  # s in which the server must have answered when the window closes


class MeshcatMirror(Channel):
    """A channel to the server of a `meshcat.Visualizer`."""

    # s; many more pictures starve meshcat's page, and 30 per second need room for jitter
    min_interval = 1.0 / 40.0

    def __init__(self, server: Server, visualizer: Visualizer):
        self._server, self._url = server, visualizer.window.zmq_url
        self._root = f"{visualizer.path.lower()}/floatbase"
        server.call(self._connect)

    @property
    def answers_since(self) -> float:
        """The present: the server does not answer while `Visualizer.wait` waits for a browser."""
        return time.monotonic()

    def send_frame(self, number: int, data: bytes) -> None:
        """Send a frame; the next one may follow when the server has answered."""
        self._sending = asyncio.ensure_future(self._send(self._messages(data)))

    async def deliver_rest(self) -> None:
        """Send the last picture."""
        with suppress(TimeoutError):
            async with asyncio.timeout(_FINISHING_TIME):
                await self._sending
                await asyncio.sleep(self.min_interval)
                self._page.next_frame()
                await self._sending

    def close_page(self, reason: str) -> None:
        """Disconnect from the server, which keeps the picture."""
        self._page.close()
        self._sending.cancel()
        # an event for a monitor that is closed blocks ZeroMQ's thread, and all sockets of it
        self._socket.disable_monitor()
        self._socket.close(linger=0)

    def _connect(self) -> None:
        """Connect to the server with a socket of our own, which no interrupt can break."""
        self._socket = zmq.asyncio.Context.instance().socket(zmq.DEALER)
        self._socket.set_hwm(0)  # unlimited, because the server drops answers that nobody reads
        ends = zmq.EVENT_DISCONNECTED | zmq.EVENT_CONNECT_RETRIED
        monitor = self._socket.get_monitor_socket(ends)
        self._socket.connect(self._url)
        self._watching = asyncio.ensure_future(self._watch(monitor))
        self._page = Connection(self._server, self)
        old = {"type": "delete", "path": protocol.ROOT}
        self._sending = asyncio.ensure_future(self._send([self._message(old)]))
        self._server.flush()

    async def _watch(self, monitor: zmq.asyncio.Socket) -> None:
        """Report the end of the server to the program that draws."""
        with monitor:
            await monitor.recv_multipart()
            self._server.failure = f"The meshcat server at {self._url} does not run any more"
            self.close_page(self._server.failure)

    async def _send(self, messages: Iterable[list[bytes]]) -> None:
        """Send messages, and wait until the server has answered all."""
        sent = [await self._socket.send_multipart([b"", *message]) for message in messages]
        for _ in sent:
            await self._socket.recv_multipart()
        self._page.receive('{"type": "done"}')

    def _messages(self, frame: bytes) -> Iterator[list[bytes]]:
        """Yield the commands of a frame that the server understands."""
        for command in map(msgpack.unpackb, protocol.unframe(frame)):
            kind, path = command["type"], command.get("path", "")
            if kind == "set_animation":
                for animation in command["animations"]:
                    animation["path"] = self._path(animation["path"])
                    animation["clip"]["fps"] = command["options"]["speed"]
                # pages that open later receive the newest path last, after all that it animates
                yield self._message({"type": "delete", "path": "<animation>"})
                yield self._message(command | {"path": "<animation>"})
            elif kind in _DRAWN and path.startswith(protocol.ROOT):
                shape = (path, "set_object", "")
                if kind == "set_property" and (made := self._server.scene.command(shape)):
                    # the server keeps all properties that an object has had; only the object clears
                    # them, and the server sends no page an object that it has already
                    yield self._message(made)
                yield self._message(command)

    def _message(self, command: dict[str, Any]) -> list[bytes]:
        """Encode a command as the server expects it."""
        kind, path = command["type"], self._path(command["path"])
        data = msgpack.packb(command | {"path": path}, use_single_float=True)
        return [kind.encode(), path.encode(), data]

    def _path(self, path: str) -> str:
        """Return the server's path for one of our own pages."""
        return protocol.normal_path(f"{self._root}/{path.removeprefix(protocol.ROOT)}")
