"""The window: life cycle, threads, interrupts, slow pages, foreign connections."""

import asyncio
import json
import os
import signal
import socket
import struct
import threading
import time
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial

import msgpack
import numpy as np
import psutil
import pytest
import tornado.httpclient
import tornado.websocket
from messages import raises, refused
from waiting import PATIENCE, until

from floatbase.errors import ViewerError
from floatbase.viewer.scene import geometry, protocol, threejs
from floatbase.viewer.transport.window import Window

UPDATES = [protocol.set_transform(f"/meshcat/{i}", np.eye(4)) for i in range(100)]
BALL = partial(protocol.set_object, packed=threejs.mesh(*geometry.sphere(0.1)).packed)


def window_threads():
    return [each for each in threading.enumerate() if each.name.startswith("floatbase-window")]


def commands_in(frame):
    """The commands of a frame."""
    commands, at = [], 0
    while at < len(frame):
        (length,) = struct.unpack_from("<I", frame, at)
        commands.append(msgpack.unpackb(frame[at + 4 : at + 4 + length]))
        at += 4 + length
    return commands


def in_a_loop(coroutine):
    """The result of a coroutine, run in a thread of its own."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, coroutine).result()


async def connect(
    window: Window, origin: str | None = None
) -> tornado.websocket.WebSocketClientConnection:
    headers = {} if origin is None else {"Origin": origin}
    url = window.web_url.replace("http", "ws") + "socket"
    request = tornado.httpclient.HTTPRequest(url, headers=headers)
    return await tornado.websocket.websocket_connect(request)


async def next_commands(client: tornado.websocket.WebSocketClientConnection) -> list[dict]:
    """The commands of the next frame."""
    return commands_in(await asyncio.wait_for(client.read_message(), PATIENCE))


async def answer(client: tornado.websocket.WebSocketClientConnection) -> None:
    """Answer that a frame is drawn."""
    await client.write_message(json.dumps({"type": "done"}))


def test_the_scene_does_not_grow_when_things_are_drawn_again(window):
    for i in range(100):
        window.put([BALL("/meshcat/a"), protocol.set_transform("/meshcat/a", np.eye(4) * i)])
        window.put([protocol.set_property("/meshcat/a", "visible", True)])
        window.put([BALL(f"/meshcat/b{i}"), protocol.delete(f"/meshcat/b{i}")])
    assert len(window.scene) <= 4


def test_deleted_paths_are_gone_with_their_children_and_can_come_back(window):
    window.put([BALL("/meshcat/a/b"), BALL("/meshcat/ab"), protocol.delete("/meshcat/a")])
    assert [path for path, *_ in window.scene.commands()] == ["/meshcat/ab"]
    window.put([BALL("/meshcat/a/b")])
    assert [path for path, *_ in window.scene.commands()] == ["/meshcat/ab", "/meshcat/a/b"]
    window.put([protocol.delete("/meshcat")])
    assert window.scene.commands() == {}


def test_the_window_listens_on_loopback_only(window):
    assert window.port in listening()
    connections = psutil.Process().net_connections("inet")
    hosts = {one.laddr.ip for one in connections if one.laddr.port == window.port}
    assert hosts == {"127.0.0.1"}
    # another address of this machine's loopback network is already too far away, and so are its
    # addresses in other networks
    found = [each for every in psutil.net_if_addrs().values() for each in every]
    others = {each.address for each in found if each.family == socket.AF_INET}
    for address in ("127.0.0.2", *(others - {"127.0.0.1"})):
        with pytest.raises(OSError):
            socket.create_connection((address, window.port), timeout=2)
    socket.create_connection(("127.0.0.1", window.port), timeout=2).close()


def listening():
    """The ports that this process listens on."""
    found = psutil.Process().net_connections("inet")
    return {one.laddr.port for one in found if one.status == psutil.CONN_LISTEN}


def test_a_picture_has_a_port_only_after_its_address_is_read(viewer, standing, tmp_path):
    before = listening()
    viewer.show(standing)
    viewer.widget()
    viewer.save(tmp_path / "scene.html")
    viewer._repr_mimebundle_()
    assert repr(viewer) == "Viewer(go2)" and repr(viewer.window) == "Window(open)"
    assert listening() == before and not viewer.window.is_listening
    assert viewer.url == f"http://127.0.0.1:{viewer.window.port}/"
    assert listening() - before == {viewer.window.port}
    assert viewer.window.is_listening and repr(viewer) == f"Viewer(go2, {viewer.url})"
    assert urllib.request.urlopen(viewer.url, timeout=PATIENCE).status == 200
    viewer.close()
    assert listening() == before


def test_threads_that_ask_for_the_port_at_once_get_the_same_one(window):
    before = listening()
    with ThreadPoolExecutor(16) as pool:
        ports = set(pool.map(lambda _: window.port, range(64)))
    assert len(ports) == 1 and listening() - before == ports


def test_fifty_windows_opened_and_dropped_leave_no_thread_no_port_and_no_process():
    before = len(window_threads())
    files = len(os.listdir("/dev/fd"))
    children = {child.pid for child in psutil.Process().children(recursive=True)}
    for _ in range(50):
        window = Window()
        port = window.port
        window.put(UPDATES)
        del window
        with pytest.raises(OSError):
            socket.create_connection(("127.0.0.1", port), timeout=2)
    assert len(window_threads()) == before
    assert len(os.listdir("/dev/fd")) <= files + 2
    assert {child.pid for child in psutil.Process().children(recursive=True)} <= children


def test_a_port_that_is_taken_or_none_is_an_error(window):
    refused(lambda: Window(port=window.port), ViewerError, "port", window.port)
    for port in (-1, 65536, 3.5, "8000", True):
        refused(lambda port=port: Window(port=port), ViewerError, "port", 0, 65535)


def test_a_port_is_free_at_once_after_close():
    with Window() as first:
        port = first.port
    with Window(port=port) as second:
        assert second.port == port


def test_unknown_commands_are_refused():
    command = {"type": "nonsense", "path": ""}
    refused(lambda: protocol.encode(command), ViewerError, "nonsense", "set_object")


def test_another_origin_is_refused(window):
    async def tries() -> None:
        with raises(tornado.httpclient.HTTPClientError, 403):
            await connect(window, origin="http://evil.example")
        (await connect(window, origin=window.web_url.rstrip("/"))).close()

    in_a_loop(tries())


def test_another_host_name_is_refused(window):
    for path in ("", "main.min.js", "socket"):
        request = urllib.request.Request(window.web_url + path, headers={"Host": "evil.example"})
        with raises(urllib.error.HTTPError, 403):
            urllib.request.urlopen(request, timeout=PATIENCE)
    assert urllib.request.urlopen(window.web_url, timeout=PATIENCE).status == 200


def test_a_page_that_opens_late_gets_the_whole_scene_in_one_frame(window):
    names = [f"/meshcat/{i}" for i in range(5)]
    for name in names:
        window.put([protocol.set_transform(name, np.eye(4))])

    async def look() -> list[dict]:
        return await next_commands(await connect(window))

    assert [command["path"] for command in in_a_loop(look())] == names


def test_a_page_that_does_not_read_costs_nothing_and_gets_the_newest_values(window):
    updates = 20_000

    async def sleepy() -> list[dict]:
        client = await connect(window)
        await asyncio.sleep(0.05)
        for i in range(updates):
            window.put([protocol.set_transform(f"/meshcat/{i % 7}", np.eye(4) * i)])
        assert len(window.scene) == 7
        assert len(await next_commands(client)) <= 7
        await answer(client)
        return await next_commands(client)

    last = in_a_loop(sleepy())
    assert sorted(command["matrix"][0] for command in last) == list(range(updates - 7, updates))


def test_deletes_and_objects_keep_their_order_on_the_way_to_a_busy_page(window):
    async def sleepy() -> list[str]:
        client = await connect(window)
        window.put([BALL("/meshcat/a")])
        await next_commands(client)
        for _ in range(5):
            window.put([protocol.delete("/meshcat/a")])
            window.put([BALL("/meshcat/a")])
        await asyncio.sleep(0.1)
        await answer(client)
        return [command["type"] for command in await next_commands(client)]

    assert in_a_loop(sleepy()) == ["delete", "set_object"]


def test_threads_draw_at_the_same_time(window):
    def draw(name):
        for i in range(500):
            window.put([protocol.set_transform(f"/meshcat/{name}", np.eye(4) * i)])

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(draw, range(8)))
    assert {command["matrix"][0] for command in window.scene.commands().values()} == {499.0}
    assert window.scene.newest == 8 * 500


@contextmanager
def interrupting():
    """Yield a function that repeats another until an interrupt, and tells whether there was one.

    The interrupt comes after a given processor time of this process [s], because pytest-timeout
    uses the timer of the wall clock. Python drops an interrupt that occurs in a destructor.
    """

    def repeat(use):  # not in the `try`: where a loop jumps back, Python 3.13 leaves it uncaught
        stop = time.monotonic() + 1.0
        while time.monotonic() < stop:
            use()

    def interrupted(use, delay):
        try:
            signal.setitimer(signal.ITIMER_VIRTUAL, delay)
            repeat(use)
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        except KeyboardInterrupt:
            return True
        return False

    before = signal.signal(signal.SIGVTALRM, signal.default_int_handler)
    try:
        yield interrupted
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


@pytest.mark.parametrize(
    "use", [lambda scene: scene.put(UPDATES), lambda scene: scene.since(0)], ids=["put", "since"]
)
def test_an_interrupt_never_leaves_a_scene_locked(window, use):
    scene, count = window.scene, 0
    scene.put(UPDATES)
    stop = time.monotonic() + PATIENCE
    with interrupting() as interrupted:
        while count < 50 and time.monotonic() < stop:
            count += interrupted(lambda: use(scene), 1e-4)
            # waits for ever where the lock is held
            reader = threading.Thread(target=scene.commands, daemon=True)
            reader.start()
            reader.join(PATIENCE)
            assert not reader.is_alive(), f"locked after {count} interrupts"
    assert count == 50


def test_interrupts_in_a_drawing_loop_leave_the_window_usable(window):
    seen = 0

    async def follow() -> None:
        nonlocal seen
        client = await connect(window)
        while (message := await client.read_message()) is not None:
            seen = max([seen, *(command["matrix"][0] for command in commands_in(message))])
            await answer(client)

    threading.Thread(target=lambda: asyncio.run(follow()), daemon=True).start()
    until(lambda: window.n_pages == 1)
    drawn = count = 0

    def draw():
        nonlocal drawn
        drawn += 1
        window.put([protocol.set_transform("/meshcat/a", np.eye(4) * drawn)])

    stop = time.monotonic() + PATIENCE
    with interrupting() as interrupted:
        while count < 50 and time.monotonic() < stop:
            count += interrupted(draw, 0.002 + 0.0001 * count)
    assert count == 50
    draw()
    until(lambda: seen == drawn)


CONTROLS = {
    "slider": (None, "1", [1], True, np.nan, np.inf, 10**400),
    "box": (None, "true", [True], 1, np.nan),
    **dict.fromkeys((None, 3, "unknown", "\ud800"), (1,)),
}
MESSAGES = [
    *({"type": kind} for kind in (3, [], {}, "nonsense", "image", "control")),
    *({"type": "image", "id": number, "data": "x"} for number in ([], {}, "7", 7, None)),
    *({"type": "control", "name": name, "value": 1} for name in ([], {})),
    *({"type": "control", "name": name, "value": v} for name in CONTROLS for v in CONTROLS[name]),
    {"type": "control", "name": "slider"},
    {"type": "control", "name": "slider", "value": 0.5, "by": "\ud800"},
]
STRANGE = [
    "", "hello", '{"type":', "null", "3", "[]", '"x"', "{}", "[" * 200_000, "9" * 6000, b"\x00\xff",
    b"\xff\xfe{}", *map(json.dumps, MESSAGES),
]  # fmt: skip


def test_unknown_messages_of_a_page_are_ignored(window, caplog):
    heard = []

    def hear(name, value):
        heard.append((name, value))
        if name == "broken":
            raise ZeroDivisionError("of the callback")

    slider = protocol.set_control("slider", value=0.0, min=-1.0, max=1.0, step=0.1)
    window.put([slider, protocol.set_control("box", value=True)])
    window.put([protocol.set_control("broken")])
    window.on_control(hear)
    ours = [("slider", 0.5), ("slider", 9), ("box", False), ("broken", None)]

    async def say() -> None:
        client = await connect(window)
        for message in STRANGE:
            await client.write_message(message, binary=isinstance(message, bytes))
        for name, value in ours:
            message = {"type": "control", "name": name, "value": value}
            await client.write_message(json.dumps(message))
        while len(heard) < len(ours):
            await asyncio.sleep(0.01)
        huge = await connect(window)
        # refused, so the connection ends while it is sent
        with pytest.raises(tornado.websocket.WebSocketClosedError):
            for _ in range(3):
                await huge.write_message("x" * (2 << 20))
                await asyncio.sleep(0.1)

    in_a_loop(say())
    assert heard == [("slider", 0.5), ("slider", 1.0), ("box", False), ("broken", None)]
    told = [record for record in caplog.records if record.levelname in ("WARNING", "ERROR")]
    assert len(told) == 1 and "broken" in told[0].getMessage()
    assert "of the callback" in str(told[0].exc_info)
    assert window.is_open
