"""The life of a window: killed browsers, pages that never read, interrupts, restarts.

Nothing may hang, grow or remain.
"""

import json
import os
import signal
import socket
import subprocess
import threading
import time

import numpy as np
import pytest
from browsers import CHROMIUM, FLAGS
from jupyter_client.manager import run_kernel
from waiting import PATIENCE, until

from floatbase.viewer.scene import protocol

# s: a sixth of what a page may take over a frame, so a call that waits for a page takes longer
HUNG = 5.0


@pytest.mark.front_end
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium found on the path")
def test_a_killed_browser_leaves_nothing_behind(viewer, go2, standing, contacts, forces, tmp_path):
    viewer.show(standing, contacts, forces)
    address = viewer.url
    threads = threading.active_count()
    files = len(os.listdir("/dev/fd"))
    entries = len(viewer.window.scene)
    browser = subprocess.Popen(
        [CHROMIUM, *FLAGS, f"--user-data-dir={tmp_path}", "--remote-debugging-port=0", address],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    try:
        until(lambda: viewer.window.n_pages == 1)
        slowest = 0.0
        for i in range(300):
            start = time.monotonic()
            viewer.show(standing, contacts, (1 + 0.001 * i) * forces)
            slowest = max(slowest, time.monotonic() - start)
            if i == 100:
                os.killpg(browser.pid, signal.SIGKILL)
    finally:
        if browser.poll() is None:
            os.killpg(browser.pid, signal.SIGKILL)
        browser.wait(PATIENCE)
    assert slowest < HUNG
    until(lambda: viewer.window.n_pages == 0)
    until(lambda: len(os.listdir("/dev/fd")) <= files)
    assert threading.active_count() == threads
    assert len(viewer.window.scene) <= entries + 2  # title and legend
    viewer.show(standing)


@pytest.fixture
def sleeper(window):
    """Open a page that connects and never reads."""
    with socket.create_connection(("127.0.0.1", window.port)) as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.sendall(
            f"GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{window.port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
            "Sec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        until(lambda: window.n_pages == 1)
        yield client


def test_a_page_that_never_reads_is_dropped(window, sleeper, monkeypatch):
    monkeypatch.setattr("floatbase.viewer.transport.connection.TIMEOUT", 0.2)
    files = len(os.listdir("/dev/fd"))

    def drawn_and_gone():
        window.put([protocol.set_transform("/meshcat/a", np.eye(4))])
        return window.n_pages == 0

    until(drawn_and_gone)
    until(lambda: len(os.listdir("/dev/fd")) < files)


IN_A_NOTEBOOK = """import floatbase as fb
from floatbase.lessons import live_run, push_panel
from floatbase.playground import playground
robot = fb.load("go2")
sim = fb.Simulation(robot)
view = fb.Viewer(robot)
view.show(sim.state)
controller = fb.WholeBodyController(robot, sim.feet, fb.standing_tasks(sim.state))
display(view, push_panel(live_run(sim, controller, view), view))
field = playground("go2")
display(field)
print(repr(view), repr(field), type(view.widget()).__name__)"""
PORTS = (
    "import psutil; print(sorted(c.laddr.port for c in "
    "psutil.Process().net_connections('inet') if c.status == 'LISTEN'))"
)


@pytest.mark.front_end
def test_a_kernel_that_shows_pictures_listens_where_jupyter_does_and_nowhere_else():
    with run_kernel(kernel_name="python3") as client:

        def printed(code):
            """What the kernel prints, and the name of its error."""
            said = []
            client.execute_interactive(
                code, output_hook=lambda one: said.append(one["content"]), timeout=PATIENCE
            )
            return "".join(one.get("text") or one.get("ename", "") for one in said)

        jupyters = json.loads(printed(PORTS))
        assert jupyters
        assert printed(IN_A_NOTEBOOK).endswith("Viewer(go2) Playground(go2) NotebookWidget\n")
        assert json.loads(printed(PORTS)) == jupyters
        port = int(printed("print(view.window.port)"))  # whoever asks gets one
        assert json.loads(printed(PORTS)) == sorted([*jupyters, port])
