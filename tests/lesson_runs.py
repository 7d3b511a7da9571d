"""Run lessons in processes forked from one that has imported everything and made one controller.

For each lesson, the program reads a line of JSON, and writes a line with the exit status and the
processor time. Each lesson has two processes, nbval's and its kernel's. Both are forked before they
start a thread.
"""

import gc
import json
import multiprocessing
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

MARK = "FLOATBASE_STARTED_BY_TEST"
PRINTED = "printed.txt"
LONGEST = 200  # s that a lesson may take
FORK = multiprocessing.get_context("fork")


@dataclass(frozen=True)
class Run:
    """How a lesson ended: exit status of nbval, processor time [s], and what nbval printed."""

    status: int
    seconds: float
    printed: str


class LessonRunner:
    """Starts the program below, which runs lessons."""

    def __init__(self, mark: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, MARK: mark},
        )
        self.pid = self._process.pid

    def run(self, path: Path, home: Path) -> Run:
        """Run a lesson for a learner whose progress is in `home`."""
        assert self._process.stdin and self._process.stdout
        print(json.dumps({"path": str(path), "home": str(home)}), file=self._process.stdin)
        self._process.stdin.flush()
        answer = json.loads(self._process.stdout.readline())
        return Run(**answer, printed=(path.parent / PRINTED).read_text())

    def stop(self) -> None:
        """End the program."""
        self._process.communicate()


class ForkedKernel:
    """A kernel forked from this process: as much of a kernel manager as nbval needs."""

    def __init__(self) -> None:
        from jupyter_client.connect import write_connection_file

        self.file, _ = write_connection_file()
        self._process = FORK.Process(target=_serve, args=(self.file,))
        self._process.start()

    def started(self, startup_timeout: float, **_: Any) -> tuple[Self, Any]:
        """Return this manager and a client, in place of nbval's `start_new_kernel`."""
        from jupyter_client import BlockingKernelClient

        client = BlockingKernelClient(connection_file=self.file)
        client.load_connection_file()
        client.start_channels()
        client.wait_for_ready(timeout=startup_timeout)
        return self, client

    def is_alive(self) -> bool:
        """Whether the kernel runs."""
        return self._process.is_alive()

    def interrupt_kernel(self) -> None:
        """Interrupt the cell that runs."""
        assert self._process.pid is not None
        os.kill(self._process.pid, signal.SIGINT)

    def shutdown_kernel(self, *, now: bool) -> None:
        """End the kernel at once, as nbval always requests."""
        assert now
        self._process.kill()
        self._process.join()


def _serve(file: str) -> None:
    """Run a kernel until it is shut down."""
    from ipykernel.kernelapp import IPKernelApp

    IPKernelApp.launch_instance(["-f", file, "--IPKernelApp.log_level=40"])


def _run(path: str, home: str) -> None:
    """Run a lesson by nbval, and exit with its status."""
    os.setpgrp()
    signal.alarm(LONGEST)
    os.environ["FLOATBASE_HOME"] = home
    os.chdir(Path(path).parent)
    for descriptor in (1, 2):
        os.dup2(os.open(PRINTED, os.O_WRONLY | os.O_CREAT | os.O_APPEND), descriptor)
    kernel = ForkedKernel()

    import nbval.kernel
    import pytest

    nbval.kernel.start_new_kernel = kernel.started
    # only nbval's own plugin, and no settings of this project's tests
    options = ["-p", "nbval.plugin", "--nbval", "-q", "-p", "no:cacheprovider", "-c", os.devnull]
    try:
        status = pytest.main([*options, path])
    finally:
        kernel.shutdown_kernel(now=True)
    sys.exit(status)


def _prepare() -> None:
    """Import what lessons and nbval need, and load what a controller compiles."""
    import cvxpy  # noqa: F401
    import ipykernel.kernelapp  # noqa: F401
    import matplotlib.pyplot  # noqa: F401
    import nbval.plugin  # noqa: F401

    import floatbase as fb
    from floatbase.lessons import all_exercises

    all_exercises()
    robot = fb.load("go2")
    fb.WholeBodyController(robot, fb.Contacts.points(robot), fb.standing_tasks(robot.standing()))
    gc.collect()
    gc.freeze()  # a forked process does not look through these objects again


def _children_seconds() -> float:
    times = os.times()
    return times.children_user + times.children_system


def main() -> None:
    """Run a lesson for each line of the input."""
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    _prepare()
    for line in sys.stdin:
        before = _children_seconds()
        process = FORK.Process(target=_run, kwargs=json.loads(line))
        process.start()
        process.join()
        if process.exitcode == -signal.SIGALRM:
            os.killpg(process.pid, signal.SIGKILL)
        answer = {"status": process.exitcode, "seconds": _children_seconds() - before}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
