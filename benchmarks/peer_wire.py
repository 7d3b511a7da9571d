"""How `peers.py` talks with the processes that it compares, each in an environment of its own;
needs numpy alone.

An order is a line of JSON on the standard input of a process, the answer a line on its standard
output:

    {"problem": {…}}                 build the problem of `peer_problems.Problem.description`
    {"states": {label: [[q, v], …]}} keep these states
    {"torques": label}               the torques at each of them, null where the solver found none
    {"clock": label}                 the time of each tick, µs
    {"cold": label}                  the same, with 16 MB written before each tick
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

# q, v -> torques [N·m], or None where the solver found none
Contender = Callable[[np.ndarray, np.ndarray], "np.ndarray | None"]
States = Sequence[tuple[np.ndarray, np.ndarray]]


def serve(build: Callable[[dict[str, Any]], Contender]) -> None:
    """Answer orders until there are no more."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what C++ libraries print is no answer
    contender: Contender | None = None
    states: dict[str, States] = {}
    answering: dict[str, Any] = {
        "torques": _torques,
        "clock": partial(_clock, np.empty(0)),
        "cold": partial(_clock, np.empty(2**21)),  # 16 MB
    }
    for line in sys.stdin:
        ((order, what),) = json.loads(line).items()
        answer: Any = "done"
        if order == "problem":
            contender = build(what)
        elif order == "states":
            states = {
                label: [(np.array(q), np.array(v)) for q, v in rows] for label, rows in what.items()
            }
        else:
            assert contender is not None, "the problem comes first"
            answer = answering[order](contender, states[what])
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


def _torques(contender: Contender, states: States) -> list[list[float] | None]:
    found = [contender(q, v) for q, v in states]
    return [None if tau is None else np.asarray(tau).tolist() for tau in found]


def _clock(other_memory: np.ndarray, contender: Contender, states: States) -> list[float]:
    """The time of each tick [µs]. Between ticks, other memory is written, as by other work."""
    times, now = [], time.perf_counter_ns
    for i, (q, v) in enumerate(states):
        other_memory.fill(i)
        start = now()
        contender(q, v)
        times.append(1e-3 * (now() - start))
    return times


class Process:
    """A contender in a process of its own: `script` served by the `python` of its environment."""

    def __init__(
        self, python: Path, script: Path, arguments: Sequence[str] = (), paths: Sequence[Path] = ()
    ):
        settings = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
        settings["PYTHONPATH"] = os.pathsep.join(map(str, paths))
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        command = [str(python), str(script), *arguments]
        self.name = script.stem
        self.process = subprocess.Popen(command, text=True, env=os.environ | settings, **pipes)

    def ask(self, order: str, what: Any) -> Any:
        """The answer to one order. Raises `RuntimeError` with what the process said when it ended
        instead.
        """
        assert self.process.stdin is not None and self.process.stdout is not None
        try:
            self.process.stdin.write(json.dumps({order: what}) + "\n")
            self.process.stdin.flush()
            line = self.process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            said = self.process.communicate()[1] or "nothing"
            raise RuntimeError(
                f"{self.name} ended with code {self.process.returncode}. It said: {said[-2000:]}"
            )
        return json.loads(line)

    def close(self) -> None:
        """End the process."""
        if self.process.poll() is None:
            self.process.communicate()
