"""What all tests share: a folder for all that they write, one BLAS thread, random numbers that can be drawn anew, the slow
files first."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import hypothesis
import numpy as np
import psutil
import pytest

# started first, so that no worker is left alone with one of them at the end
SLOWEST = ("test_lab", "test_notebooks", "test_browser", "test_displays", "test_main")

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of 30 rows: more threads only wait for one another


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--seed",
        type=int,
        default=0,
        metavar="N",
        help="draw all random numbers of the tests from other streams, one for each N; 0, the default, leaves them as they are",
    )


@pytest.hookimpl(tryfirst=True)  # hypothesis reads its seed when it is configured
def pytest_configure(config: pytest.Config) -> None:
    if is_no_worker(config):
        # to keep the files of a test, give pytest another folder for them: --basetemp=FOLDER
        folder = tempfile.mkdtemp(prefix="floatbase-tests-")
        config.add_cleanup(lambda: shutil.rmtree(folder))
        os.environ["TMPDIR"] = tempfile.tempdir = folder
    os.environ["FLOATBASE_HOME"] = tempfile.mkdtemp(prefix="home-")  # a learner's progress is not the tests' to write
    shift_seeds(config, config.getoption("--seed"))


def is_no_worker(config: pytest.Config) -> bool:
    """Whether this process is pytest itself, not a worker of pytest-xdist."""
    return not hasattr(config, "workerinput")


@pytest.fixture(scope="session", autouse=True)
def no_idle_workers() -> Iterator[None]:
    """End the processes of sweeps, which wait for the next sweep for a while."""
    yield
    if "loky" in sys.modules:
        sys.modules["loky"].get_reusable_executor(reuse=True).shutdown(kill_workers=True)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """End the processes that tests have left, browsers and kernels say, and fail when there are any."""
    if not is_no_worker(session.config):
        return
    left = [process for process in psutil.process_iter() if is_left(process)]
    for process in left:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
        with suppress(psutil.Error):
            print(f"\nthe tests left process {process.pid} running: {' '.join(process.cmdline())[:200]}")
            process.kill()
    psutil.wait_procs(left, timeout=10)


def is_left(process: psutil.Process) -> bool:
    """Whether a process, whoever is its parent now, has been started by these tests: it has their folder.

    Python's own resource tracker of process pools ends with the process that has it.
    """
    try:
        ours = process.environ().get("TMPDIR") == tempfile.tempdir
        return ours and not any("resource_tracker" in word for word in process.cmdline())
    except psutil.Error:  # of another user, or gone
        return False


def shift_seeds(config: pytest.Config, n: int) -> None:
    """Draw the numbers of every integer seed, and the examples of hypothesis, from the n-th stream."""
    hypothesis.settings.register_profile("repeatable", derandomize=n == 0, deadline=None, database=None)
    hypothesis.settings.load_profile("repeatable")
    if n:
        config.option.hypothesis_seed = n
        np.random.default_rng = shifted(np.random.default_rng, n)


def shifted(default_rng: Callable[[Any], np.random.Generator], n: int) -> Callable[[Any], np.random.Generator]:
    def other_rng(seed: Any = None) -> np.random.Generator:
        return default_rng([seed, n] if isinstance(seed, int | np.integer) else seed)

    return other_rng


def pytest_report_header(config: pytest.Config) -> str:
    return f"random numbers: --seed {config.getoption('--seed')}"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: item.path.stem not in SLOWEST)
