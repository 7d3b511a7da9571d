"""Files while the processes that write them are killed, a learner's and a sweep's: a part of
`python benchmarks/soak.py`.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from unittest.mock import patch

from floatbase.lessons import progress
from floatbase.lessons.publish import MY_FOLDER, prepare_workspace
from floatbase.simulation import read_sweep

POINTS = 200  # of the sweep that is killed: two workers need about a second for them
IN_FLIGHT = 4  # points at most that a kill lets two workers compute again
SWEEP = f"""
import os, time
import floatbase as fb

def marked(i):
    with open("calls", "a") as calls:
        calls.write(f"{{i}}\\n")
    time.sleep(0.01)
    return i / 7

fb.sweep(marked, {{"i": list(range({POINTS}))}}, file="rows.jsonl", workers=2, progress=False)
"""
LESSONS = 4
CELLS = 100  # of a lesson: so many that a kill may fall into the writing of a file


def kills() -> Iterator[Callable[[], object]]:
    """`prepare` and `record`, killed at a random moment; then they run to their end, and nothing is
    lost.
    """
    dice, numbers, marks = random.Random(0), count(1), set[str]()
    with (
        tempfile.TemporaryDirectory(prefix="floatbase-soak-") as name,
        patch.dict(os.environ, FLOATBASE_HOME=name),
    ):
        course, mine = Path(name), Path(name, MY_FOLDER)
        for lesson in range(LESSONS):
            write(course / f"{lesson}.ipynb", ["course 0"] * CELLS)
        start = time.perf_counter()
        prepare_workspace(course)
        takes = time.perf_counter() - start

        def step() -> None:
            number = next(numbers)
            for lesson in dice.sample(range(LESSONS), LESSONS // 2):
                write(course / f"{lesson}.ipynb", [f"course {number}"] * CELLS)
            if number % 10 == 1:
                marks.add(f"the learner's {number}")
                path = dice.choice(sorted(mine.glob("*.ipynb")))
                write(path, [*cells(path), f"the learner's {number}"])
            killed(lambda tell: prepare_workspace(course), dice.uniform(0.0, takes))
            judge_copies(course, mine, marks)
            prepare_workspace(course)
            judge_copies(course, mine, marks, is_done=True)
            judge_tries(f"{number % 7}", dice)

        yield step


def sweeps() -> Iterator[Callable[[], object]]:
    """A sweep, killed at a random moment and started again until its table is whole; then another
    one begins.
    """
    dice, lost = random.Random(0), 0
    with tempfile.TemporaryDirectory(prefix="floatbase-soak-") as name:
        rows, calls, script = Path(name, "rows.jsonl"), Path(name, "calls"), Path(name, "script.py")
        script.write_text(SWEEP, encoding="utf-8")

        def step() -> None:
            nonlocal lost
            before = whole_lines(rows)
            with subprocess.Popen(
                [sys.executable, script.name], cwd=name, stderr=subprocess.DEVNULL
            ) as running:
                with suppress(subprocess.TimeoutExpired):
                    running.wait(dice.uniform(0.0, 4.0))
                running.kill()
            assert running.returncode in (0, -signal.SIGKILL), (
                f"the sweep ended with {running.returncode}"
            )
            lines = whole_lines(rows)
            assert lines[: len(before)] == before, "a kill changed rows that were there"
            lost += running.returncode != 0
            if running.returncode == 0:
                table = read_sweep(rows)
                assert table["result"].tolist() == [i / 7 for i in range(POINTS)], (
                    "the table is another one"
                )
                twice = len(calls.read_text().split()) - POINTS
                assert twice <= IN_FLIGHT * lost, (
                    f"{twice} points were computed again after {lost} kills"
                )
                rows.unlink()
                calls.unlink()
                lost = 0

        yield step


def whole_lines(path: Path) -> list[bytes]:
    """The lines of a file that come to their end, each of them JSON."""
    lines = path.read_bytes().split(b"\n")[:-1] if path.exists() else []
    for line in lines:
        json.loads(line)
    return lines


def write(path: Path, texts: list[str]) -> None:
    """A notebook with these cells."""
    made = [
        {"cell_type": "markdown", "id": f"{i}", "metadata": {}, "source": text}
        for i, text in enumerate(texts)
    ]
    path.write_text(
        json.dumps({"cells": made, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}),
        encoding="utf-8",
    )


def cells(path: Path) -> list[str]:
    """What `write` wrote."""
    return [
        "".join(cell["source"]) for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]
    ]


def judge_copies(course: Path, mine: Path, marks: set[str], is_done: bool = False) -> None:
    """All files are whole and hold what the learner wrote; after an update that has come to its
    end, the course's texts too.

    marks: cells that the learner wrote. is_done: whether the last update has come to its end.
    """
    when = "after an update" if is_done else "after a kill"
    try:
        copies = {path.name: cells(path) for path in mine.glob("*.ipynb")}
    except ValueError as error:
        raise AssertionError(f"{when} a file is not whole: {error}") from None
    faults = {"lost": marks.difference(*copies.values())}
    if is_done:
        lessons = {path.stem: cells(path) for path in course.glob("*.ipynb")}
        faults["not there"] = {
            lesson
            for lesson, text in lessons.items()
            if text
            not in [held[:CELLS] for name, held in copies.items() if name.split(".")[0] == lesson]
        }
        faults["left over"] = {path.name for path in mine.glob("[!.]*")} - {*copies}
    for what, names in faults.items():
        assert not names, f"{when} {what}: {', '.join(sorted(names))}"


def judge_tries(name: str, dice: random.Random) -> None:
    """The tries of an exercise that a process had counted when it was killed are there, the others'
    too, and it goes on.
    """
    others = progress.load()
    before = others.pop(name, {"tries": 0})["tries"]

    def record(tell: Callable[[], object]) -> None:
        for number in range(1000):
            progress.record_try(name, right=number % 2 == 0)
            tell()

    told = killed(record, dice.uniform(0.0, 0.01))
    found = progress.load()
    now = found.pop(name, {"tries": 0})["tries"]
    assert now - before in (told, told + 1), (
        f"{told} tries were counted before a kill, {now - before} are there after it"
    )
    assert found == others, "a kill changed the tries of other exercises"
    progress.record_try(name, right=True)
    assert progress.load()[name]["tries"] == now + 1, "after a kill a try is not counted"


def killed(action: Callable[[Callable[[], object]], object], after: float) -> int:
    """Run an action in a process that is killed after so many seconds. Returns how often it called
    what it was given.
    """
    ear, mouth = os.pipe()
    child = os.fork()
    if not child:
        try:
            os.write(mouth, b"!")
            action(lambda: os.write(mouth, b"."))
            os._exit(0)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)
    os.close(mouth)
    with open(ear, "rb") as heard:
        heard.read(1)
        time.sleep(after)
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
        told = len(heard.read())
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 1, (
        "the process to be killed ended with an error"
    )
    return told
