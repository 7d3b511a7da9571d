"""Commands of many states: compiled in several threads, then one by one what is left."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from floatbase._validation import Array, as_integer
from floatbase.control.command import CommandBatch
from floatbase.errors import InputError, SolverError

if TYPE_CHECKING:
    from floatbase.control.controller import WholeBodyController

_MAX_THREADS = 1024  # a larger number is a typing error


def thread_count(threads: int | None) -> int:
    """Return a checked number of threads, by default one for each core of this process."""
    if threads is None:
        has_affinity = hasattr(os, "sched_getaffinity")  # not on macOS and Windows
        threads = (len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count()) or 1
    return as_integer("threads", threads, 1, _MAX_THREADS)


def solve_batch(
    controller: WholeBodyController,
    may_soften: bool,
    Q: Array,
    V: Array,
    times: Array,
    targets: Array | None,
    n_threads: int,
) -> CommandBatch:
    """Return the commands of many states: compiled, then one by one what is left."""
    n, nv, d, tick = len(Q), controller.robot.nv, controller.robot.d, controller.compiled
    x = np.full((n, nv + d + controller.contacts.k), np.nan)  # q̈, τ, λ
    status, softened, undecided = np.full(n, "infeasible"), np.full(n, False), np.full(n, True)
    if tick is not None:
        results, codes = tick.run_batch(Q, V, times, targets, n_threads)
        undecided = codes < 0
        x[~undecided], status[~undecided] = results[~undecided], "compiled"
        if not may_soften:
            undecided &= codes != tick.infeasible
    for i in np.flatnonzero(undecided):
        try:
            given = None if targets is None else targets[i]
            command = controller.attempt(Q[i], V[i], float(times[i]), given)
        except SolverError:
            status[i] = "failed"
            continue
        except InputError as error:
            raise InputError(f"State {i} of the batch: {error}") from error
        except Exception as error:  # of user code
            error.add_note(f"This happened at state {i} of the batch.")
            raise
        if command is not None:
            x[i] = np.concatenate([command.qdd, command.tau, command.forces])
            status[i], softened[i] = command.backend, bool(command.softened)
    for array in (x, status, softened):
        array.setflags(write=False)
    qdd, tau, forces = np.split(x, [nv, nv + d], axis=1)
    return CommandBatch(tau, qdd, forces, status, softened)
