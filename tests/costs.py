"""What the tests cost: processor seconds by file and tier, in units of a fixed piece of work.

Machines differ, and the same machine differs from hour to hour, so the budgets are multiples of a
piece of work that is timed in the same run.
"""

import os
import time
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

# multiples of the piece of work; a run of all tests fails above one and a half times its budget
BUDGETS = {"make test": 2700.0, "only in make test-all": 2700.0}
TOLERANCE = 1.5
FILES = 25  # in the table
KEY = "processor seconds"


def used() -> float:
    """Return the processor time of this process and of the children that have ended [s]."""
    return sum(os.times()[:4])


def piece_of_work() -> float:
    """Return the processor time of some Python code with small matrices [s], about 0.1 s."""
    start = time.process_time()
    matrix = np.eye(30) + 1.0 / (1.0 + np.add.outer(np.arange(30.0), np.arange(30.0)))
    x = np.ones(30)
    for i in range(10_000):
        x = np.linalg.solve(matrix, x + i) / (1.0 + sum(float(value) for value in x) ** 2)
    return time.process_time() - start


class Costs:
    """A pytest plugin that adds up what each test costs and prints the sums."""

    def __init__(self, is_worker: bool) -> None:
        self._is_worker = is_worker
        self._started: dict[str, float] = {}
        self._pieces: list[float] = []
        self._by_file: dict[str, float] = defaultdict(float)
        self._by_tier = dict.fromkeys(BUDGETS, 0.0)

    def pytest_sessionstart(self) -> None:
        self._pieces.append(piece_of_work())

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        self._started[item.nodeid] = used()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[Any]
    ) -> Iterator[None]:
        report: Any = yield
        if call.when == "teardown" and item.nodeid in self._started:
            seconds = used() - self._started.pop(item.nodeid)
            tier = list(BUDGETS)[item.get_closest_marker("front_end") is not None]
            report.user_properties = [*report.user_properties, (KEY, (tier, seconds))]
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        for key, value in report.user_properties if report.when == "teardown" else []:
            if key == KEY:
                self._by_file[report.nodeid.split("::")[0]] += value[1]
                self._by_tier[value[0]] += value[1]

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Time the piece of work again, and fail if all tests were run and cost too much."""
        self._pieces.append(piece_of_work())
        if self._is_worker:
            session.config.workeroutput["pieces"] = self._pieces
        elif runs_all(session.config) and self._expensive():
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        self._pieces += getattr(node, "workeroutput", {}).get("pieces", [])

    def _unit(self) -> float:
        return float(np.median(self._pieces))

    def _expensive(self) -> list[str]:
        return [
            f"{tier}: {seconds / self._unit():.0f} units, more than {TOLERANCE} times its budget"
            for tier, seconds in self._by_tier.items()
            if seconds > TOLERANCE * BUDGETS[tier] * self._unit()
        ]

    def pytest_terminal_summary(self, terminalreporter: Any, config: pytest.Config) -> None:
        write = terminalreporter.write_line
        terminalreporter.section("processor seconds")
        for file in sorted(self._by_file, key=self._by_file.__getitem__, reverse=True)[:FILES]:
            write(f"{self._by_file[file]:7.1f}  {file}")
        for tier, seconds in self._by_tier.items():
            write(
                f"{seconds:7.1f}  {tier}: {seconds / self._unit():.0f} units of "
                f"{1000.0 * self._unit():.0f} ms; the budget is {BUDGETS[tier]:.0f}"
            )
        for line in self._expensive() if runs_all(config) else []:
            write(f"too expensive: {line}")


def runs_all(config: pytest.Config) -> bool:
    """Whether no tests were chosen by name, path or number."""
    chosen = config.args_source is not pytest.Config.ArgsSource.TESTPATHS
    return not (chosen or config.option.keyword or config.option.maxfail)
