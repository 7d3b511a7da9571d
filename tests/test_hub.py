"""A class's JupyterHub in a real browser: two students at once, each with an own live picture, and
nothing of the other's.

The hub is configured by the file that the course has for teachers, .binder/jupyterhub_config.py;
only its accounts are those of a test. A student's browser reaches the hub's address and nothing
else. All servers run as one user of this machine, so what keeps students from each other here is
the hub; on a class's machine their accounts do, too.
"""

import os
import shutil
import signal
import subprocess
import sys
import urllib.request
from contextlib import ExitStack
from http.client import HTTPException
from pathlib import Path
from typing import Any, NamedTuple

import psutil
import pytest
from browsers import browser_of_a_file, needs_chromium
from labs import (
    HEIGHT,
    LONG,
    WINDOW,
    answers,
    free_ports,
    lesson_opened,
    only,
    picture_in,
    push_panel_of,
    push_until_it_falls,
    ran_without_error,
    run_all,
)
from waiting import until

from floatbase.lessons.publish import NOTEBOOKS

CONFIGURATION = NOTEBOOKS.parent / ".binder" / "jupyterhub_config.py"
PROXY = os.environ.get("CONFIGURABLE_HTTP_PROXY") or shutil.which("configurable-http-proxy")
STUDENTS = ("ada", "bob")
# m: a robot that nobody pushes sways by less, one that falls goes down by 0.1 m and more
STANDS = 1e-3
START = "00_start_here"

pytestmark = [
    pytest.mark.front_end,
    needs_chromium,
    pytest.mark.skipif(
        PROXY is None,
        reason="no configurable-http-proxy on the path or in CONFIGURABLE_HTTP_PROXY: no "
        "JupyterHub was started",
    ),
    pytest.mark.timeout(600),
]

TEST = """
load_subconfig({configuration!r})
c.JupyterHub.bind_url = "http://127.0.0.1:{0}"
c.JupyterHub.hub_port = {1}
c.JupyterHub.db_url = "sqlite:///{folder}/hub.sqlite"
c.JupyterHub.cookie_secret_file = "{folder}/cookie"
c.JupyterHub.authenticator_class = "dummy"
c.JupyterHub.spawner_class = "simple"
c.JupyterHub.log_level = "WARN"
c.ConfigurableHTTPProxy.api_url = "http://127.0.0.1:{2}"
c.ConfigurableHTTPProxy.command = [{proxy!r}]
c.ConfigurableHTTPProxy.pid_file = "{folder}/proxy.pid"
c.SimpleLocalProcessSpawner.home_dir_template = "{folder}/{{username}}"
c.Spawner.env_keep = ["PATH", "PYTHONPATH", "TMPDIR"]
c.Spawner.args = [*c.Spawner.args, "--allow-root", "--LabApp.expose_app_in_browser=True"]
"""

# whether a websocket opens
OPENS = """(path) => new Promise((done) => {
  const socket = new WebSocket(`ws://${location.host}${path}`);
  socket.onopen = () => { socket.close(); done(true); };
  socket.onerror = () => done(false);
})"""


class Hub(NamedTuple):
    """A JupyterHub. address: the one that browsers know. folder: of its files, with the students'
    homes in it.
    """

    address: str
    folder: Path
    process: psutil.Process

    def kernels(self, student):
        """The kernels of a student."""
        home = str(self.folder / student)
        children = self.process.children(recursive=True)
        kernels = [child for child in children if "ipykernel_launcher" in " ".join(child.cmdline())]
        return [kernel for kernel in kernels if kernel.environ().get("HOME") == home]

    def ports(self, student):
        """The ports that the processes of a student listen on, without those of kernels."""
        home = str(self.folder / student)
        servers = [one for one in self.process.children() if one.environ().get("HOME") == home]
        return [port for server in servers for port in listening(server)]


def listening(process):
    """The ports that a process listens on."""
    found = process.net_connections("inet")
    return [one.laddr.port for one in found if one.status == psutil.CONN_LISTEN]


@pytest.fixture(scope="module")
def hub(tmp_path_factory):
    """A hub that has started."""
    folder = tmp_path_factory.mktemp("hub")
    address, *others = free_ports(3)
    configuration = folder / "jupyterhub_config.py"
    configuration.write_text(
        TEST.format(address, *others, configuration=str(CONFIGURATION), folder=folder, proxy=PROXY)
    )
    log = folder / "hub.log"
    with log.open("w") as sink:
        command = [sys.executable, "-m", "jupyterhub", "--config", str(configuration)]
        started = subprocess.Popen(
            command, cwd=folder, stdout=sink, stderr=subprocess.STDOUT, start_new_session=True
        )
    try:
        until(lambda: answers(address) or started.poll() is not None)
        assert started.poll() is None, log.read_text()
        yield Hub(f"http://127.0.0.1:{address}", folder, psutil.Process(started.pid))
    finally:
        started.send_signal(signal.SIGTERM)  # the hub ends its servers and its proxy
        started.wait(timeout=60)
        print(log.read_text()[-4000:])


class Student(NamedTuple):
    """A student whose server has started with lesson 00. context: of the browser. strangers: what
    else the page asked for.
    """

    name: str
    context: Any
    page: Any
    strangers: list[str]


browser = browser_of_a_file


@pytest.fixture(scope="module")
def class_(hub, browser):
    """Two students log in and start at once, each in their own browser, and run lesson 00."""
    with ExitStack() as ends:
        students = []
        for name in STUDENTS:
            context = browser.new_context(**WINDOW)
            ends.callback(context.close)
            page = context.new_page()
            page.set_default_timeout(1000 * LONG)
            students.append(Student(name, context, page, only(page, hub.address)))
            _log_in(page, hub.address, name)
        for student in students:
            lesson_opened(student.page)
            run_all(student.page)
        for student in students:
            ran_without_error(student.page)
        yield students


def _log_in(page, address, name):
    page.goto(f"{address}/hub/login?next=%2Fhub%2Fspawn")
    page.fill("#username_input", name)
    page.fill("#password_input", "a-test")
    page.click("#login_submit", no_wait_after=True)


def test_each_student_has_an_own_picture_that_falls_when_that_student_pushes(class_):
    frames = [picture_in(push_panel_of(student.page)) for student in class_]
    first, second = (frame.evaluate(HEIGHT) for frame in frames)
    for student in class_:
        if student is class_[1]:
            assert frames[1].evaluate(HEIGHT) == pytest.approx(second, abs=STANDS)
        push_until_it_falls(student.page, push_panel_of(student.page), f"00_{student.name}")
    assert frames[0].evaluate(HEIGHT) < 0.6 * first and frames[1].evaluate(HEIGHT) < 0.6 * second
    assert [student.strangers for student in class_] == [[], []]


def test_no_port_of_a_students_kernel_tells_anything(hub, class_):
    for student in class_:
        (kernel,) = hub.kernels(student.name)
        ports = listening(kernel)
        # ipykernel's own, which only receives: what processes print that cells have started
        assert len(ports) <= 1
        for port in ports:
            with pytest.raises((OSError, HTTPException)):
                urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=2.0)


def test_a_student_gets_nothing_of_another_ones(hub, class_):
    ada, bob = class_
    kernels = f"{hub.address}/user/{bob.name}/api/kernels"
    own = bob.context.request.get(kernels)
    assert own.status == 200
    (kernel,) = own.json()
    lesson = f"{hub.address}/user/{bob.name}/files/floatbase/{START}.ipynb"
    assert bob.context.request.get(lesson).status == 200

    page = ada.context.new_page()
    assert page.goto(f"{hub.address}/user/{bob.name}/lab").status == 403
    assert page.locator(".jp-Notebook").count() == 0
    user = f"{hub.address}/hub/api/users/{bob.name}"
    for address in (kernels, f"{kernels}/{kernel['id']}", lesson, user):
        assert ada.context.request.get(address).status in (403, 404), address
    page.close()

    channels = "/user/{}/api/kernels/{}/channels"
    mine = ada.context.request.get(f"{hub.address}/user/{ada.name}/api/kernels").json()[0]["id"]
    assert ada.page.evaluate(OPENS, channels.format(ada.name, mine))
    assert bob.page.evaluate(OPENS, channels.format(bob.name, kernel["id"]))
    assert not ada.page.evaluate(OPENS, channels.format(bob.name, kernel["id"]))

    # no other account of the machine reads it
    assert (hub.folder / bob.name / "floatbase").stat().st_mode & 0o077 == 0

    assert hub.ports(bob.name)
    for port in hub.ports(bob.name):  # past the hub, at the server itself
        address = f"http://127.0.0.1:{port}/user/{bob.name}/api/kernels"
        assert ada.context.request.get(address, max_redirects=0).status in (302, 403), address
