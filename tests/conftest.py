"""What all tests share: a folder for all that they write, one BLAS thread, random numbers that can
be drawn anew, the slow files first.
"""

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
from costs import Costs

# What takes longest is started first, so that no worker is left alone with it at the end:
# each lesson by itself, and these files as a whole.
LESSONS = "test_a_lesson_prints_what_is_stored_and_its_learner_can_answer_everything"
SLOWEST = ("test_site", "test_lab", "test_hub", "test_voila", "test_playground_page", "test_main")
ENDING = 5.0  # s that a process may take to end after the tests have ended it

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault(
    "OPENBLAS_NUM_THREADS", "1"
)  # matrices of 30 rows: more threads only wait for one another


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--seed",
        type=int,
        default=0,
        metavar="N",
        help="draw all random numbers of the tests from other streams, one for each N; 0, the "
        "default, leaves them as they are",
    )


@pytest.hookimpl(tryfirst=True)  # hypothesis reads its seed when it is configured
def pytest_configure(config: pytest.Config) -> None:
    if is_no_worker(config):
        # to keep the files of a test, give pytest another folder for them: --basetemp=FOLDER
        folder = tempfile.mkdtemp(prefix="floatbase-tests-")
        config.add_cleanup(lambda: shutil.rmtree(folder))
        os.environ["TMPDIR"] = tempfile.tempdir = folder
    os.environ["FLOATBASE_HOME"] = tempfile.mkdtemp(
        prefix="home-"
    )  # a learner's progress is not the tests' to write
    config.pluginmanager.register(Costs(is_worker=not is_no_worker(config)))
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
    """End the processes that tests have left running, such as browsers and kernels, and fail if
    there are any.
    """
    if not is_no_worker(session.config):
        return
    _, left = psutil.wait_procs(
        [process for process in psutil.process_iter() if is_left(process)], timeout=ENDING
    )
    left = [process for process in left if is_left(process)]
    for process in left:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
        with suppress(psutil.Error):
            print(
                f"\nthe tests left process {process.pid} running: "
                f"{' '.join(process.cmdline())[:200]}"
            )
            process.kill()
    psutil.wait_procs(left, timeout=10)


def is_left(process: psutil.Process) -> bool:
    """Whether a process, whoever is its parent now, has been started by these tests and runs on: it
    has their folder.

    One that has ended is a zombie, or has no command line, until its parent knows. Python's own
    resource tracker of process pools ends with the process that has it.
    """
    try:
        words = process.cmdline()
        ours = words and process.environ().get("TMPDIR") == tempfile.tempdir
        return bool(ours) and not any("resource_tracker" in word for word in words)
    except psutil.Error:  # of another user, or gone
        return False


def shift_seeds(config: pytest.Config, n: int) -> None:
    """Draw numbers for every integer seed, and examples of hypothesis, from the n-th stream."""
    hypothesis.settings.register_profile(
        "repeatable", derandomize=n == 0, deadline=None, database=None
    )
    hypothesis.settings.load_profile("repeatable")
    if n:
        config.option.hypothesis_seed = n
        np.random.default_rng = shifted(np.random.default_rng, n)


def shifted(
    default_rng: Callable[[Any], np.random.Generator], n: int
) -> Callable[[Any], np.random.Generator]:
    def other_rng(seed: Any = None) -> np.random.Generator:
        return default_rng([seed, n] if isinstance(seed, int | np.integer) else seed)

    return other_rng


@pytest.fixture(scope="session")
def go2() -> Any:
    import judges  # loads all robots

    return judges.load("go2")


@pytest.fixture(scope="session")
def talos() -> Any:
    import judges

    return judges.load("talos")


@pytest.fixture(scope="session")
def standing(go2: Any) -> Any:
    return go2.standing()


@pytest.fixture
def robot(request: pytest.FixtureRequest) -> Any:
    """The robot of that name: `parametrize("robot", [...], indirect=True)`."""
    import judges

    return judges.load(request.param)


@pytest.fixture(params=["compiled", "reference"])
def backend(request: pytest.FixtureRequest) -> str:
    return request.param


def pytest_report_header(config: pytest.Config) -> str:
    return f"random numbers: --seed {config.getoption('--seed')}"


@pytest.hookimpl(trylast=True)  # of what is selected
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deal what takes longest out to the workers. Each begins with an equal part of the list, and
    steals from the end.
    """
    long: dict[str, list[pytest.Item]] = {}
    rest: list[pytest.Item] = []
    for item in items:
        name = item.name if item.name.startswith(LESSONS) else item.path.stem
        (long.setdefault(name, []) if name == item.name or name in SLOWEST else rest).append(item)
    workers = getattr(config, "workerinput", {}).get("workercount", 1)
    size = len(items) // workers
    items.clear()
    for i in range(workers):
        dealt = [item for hand in list(long.values())[i::workers] for item in hand]
        short = max(size - len(dealt), 0) if i < workers - 1 else len(rest)
        items += dealt + rest[:short]
        del rest[:short]
