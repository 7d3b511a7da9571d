"""`sweep`: a function at every point of a grid, in processes on this machine or on a Dask cluster."""

from __future__ import annotations

import itertools
import os
import pickle
import threading
import time
import traceback
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import cloudpickle
import loky
from tqdm.auto import tqdm

from floatbase._validation import signature_error
from floatbase.errors import InputError, SimulationError
from floatbase.simulation.table import RESERVED_NAMES, Row, RowStore, Table, as_json_value

# s after which a worker without work ends; the next sweep within them saves its start
_WORKER_IDLE_TIMEOUT = 60.0
# s between a worker's looks whether the program that started it is still there
_PARENT_CHECK_PERIOD = 1.0
_POINTS_PER_WORKER = 2  # points handed out for each worker: one that it is at, and the next
# threads that a Dask cluster may get while the sweep goes on, if it has fewer at first
_MIN_CLUSTER_THREADS = 32
_CONNECT_TIMEOUT = 10.0  # s that a Dask scheduler may take to answer
_SINGLE_THREAD_ENV = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)


def sweep(
    function: Callable[..., Any],
    grid: Mapping[str, Iterable[Any]] | Iterable[Mapping[str, Any]],
    *,
    setup: Callable[[], Any] | None = None,
    file: str | Path | None = None,
    workers: int | None = None,
    cluster: Any = None,
    progress: bool = True,
) -> Table:
    """Call a function at every point of a grid, in several processes, and collect what it returns
    in a table.

        def setup():                                         # heavy things, made once in each process
            robot = fb.load("go2")
            controller = fb.WholeBodyController(robot, fb.Contacts.points(robot, mu=0.7),
            fb.standing_tasks(robot.standing())) return fb.Simulation(robot), controller

        def push(made, force, angle):
            sim, controller = made
            sim.reset()
            run = fb.rollout(sim, controller, 0.6, [fb.Push([force * np.cos(angle), force *
            np.sin(angle), 0.0])]) return {"outcome": run.outcome, "moved": run.com[-1] -
            run.com[0]}

        grid = {"force": [50.0, 100.0, 150.0], "angle": np.linspace(0.0, np.pi, 7)}
        table = fb.sweep(push, grid, setup=setup, file="pushes.jsonl")

    function: takes the parameters by their names, after what `setup` returned where there is one.
        It returns a dict, a column for each name, or one value, the column "result": numbers,
        texts, booleans, lists and numpy arrays. An exception makes the row's "error", and the sweep
        goes on.
    grid: name -> values, for all combinations, the last name the fastest; or a list of dicts, one
        for each point.
    setup: called once in each process (on Dask in each thread), for what is heavy or cannot be
        sent.
    file: path of a file that keeps each row as it comes. The same sweep into the same file goes on
        where it was ended, however it was; two points for each worker are lost at most. The
        function is known by its name: after changing what it does, give another file. A file of
        another function or grid is refused. `Table.read` reads a file.
    workers: how many processes, by default as many as the machine has cores for this program. Each
        uses one thread for linear algebra, so that the rows are the same, bit for bit, whatever
        their number.
    cluster: a `dask.distributed.Client`, or the address of a scheduler, to work there: pip install
        "floatbase[cluster]".
    progress: whether to show a bar.

    Functions, lambdas and classes of a notebook or script can be used: they are sent by value. What
    is imported must be importable by the workers.
    Raises `InputError` for a grid that does not fit the function, for an answer that cannot be
    stored, for a file of something else or that takes no more, as on a full disc; `SimulationError`
    when a process or the cluster breaks down; and what `setup` raises. What is in the file stays
    there, after an interrupt too.
    """
    points = _grid_points(grid)
    json_points = [
        {name: as_json_value(f"parameter {name}", value) for name, value in point.items()}
        for point in points
    ]
    name = _function_name(function, file)
    _check_function(function, setup, points)
    if cluster is not None and workers is not None:
        raise InputError(
            "workers counts processes on this machine; a cluster has its own. Leave one of the two "
            "out."
        )
    workers = _worker_count(workers)
    job = _make_job(function, setup)
    with closing(RowStore(file, name, json_points)) as store:
        pending = [i for i in range(len(points)) if i not in store.rows]
        failed = sum(row["error"] is not None for row in store.rows.values())
        bar = tqdm(
            total=len(points),
            initial=len(store.rows),
            desc=name,
            unit="point",
            disable=not progress,
        )
        with bar, _open_pool(workers, cluster, bool(pending)) as pool:
            for i, answer in _completed_points(pool, job, points, pending):
                store.add(i, json_points[i] | answer)
                failed += answer["error"] is not None
                if failed:
                    bar.set_postfix(failed=failed, refresh=False)
                bar.update()
        return Table(tuple(store.rows[i] for i in range(len(points))))


class _Job(NamedTuple):
    """What a worker needs for all points: `payload` is function and setup, pickled, and `token`
    says of which sweep.
    """

    token: str
    payload: bytes


def _grid_points(grid: Any) -> list[Row]:
    """The parameters of every point."""
    if isinstance(grid, Mapping):
        axes = {}
        for name, values in grid.items():
            if isinstance(values, str) or not isinstance(values, Iterable):
                raise InputError(
                    f"the grid's {name!r} must be a list of values, not {values!r}; for one value, "
                    f"[{values!r}]."
                )
            axes[name] = list(values)
            if not axes[name]:
                raise InputError(f"the grid's {name!r} has no values, so the grid has no points.")
        points = (
            [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
            if axes
            else []
        )
    elif isinstance(grid, Iterable) and not isinstance(grid, str):
        points = list(grid)
        for point in points:
            if not isinstance(point, Mapping):
                raise InputError(
                    f"a grid that is a list holds a dict for each point, name -> value; it has "
                    f"{point!r}."
                )
        points = [dict(point) for point in points]
    else:
        raise InputError(
            f"the grid must be a dict, name -> list of values, or a list of dicts, not {grid!r}."
        )
    if not points:
        raise InputError("the grid has no points.")
    for name in dict.fromkeys(name for point in points for name in point):
        if not isinstance(name, str) or name in RESERVED_NAMES:
            raise InputError(
                f"a parameter cannot be called {name!r}; {' and '.join(RESERVED_NAMES)} are the "
                f"table's own names."
            )
    return points


def _function_name(function: Any, file: Any) -> str:
    """What the function is called in the file and beside the bar."""
    if not callable(function):
        raise InputError(f"sweep needs a function first, not {function!r}.")
    name = getattr(function, "__qualname__", None)
    if file is not None and (name is None or name.endswith("<lambda>")):
        raise InputError(
            f"a file knows its function by its name, and {function!r} has none: write it as a def, "
            f"and its constants as "
            "parameters of the grid."
        )
    return type(function).__name__ if name is None else name.rpartition("<locals>.")[2]


def _check_function(function: Callable[..., Any], setup: Any, points: list[Row]) -> None:
    """Raise `InputError` for parameters that the function does not take, and for a setup that is no
    function.
    """
    if setup is not None and not callable(setup):
        raise InputError(f"setup must be a function without parameters, not {setup!r}.")
    made = () if setup is None else (None,)
    for names in dict.fromkeys(tuple(point) for point in points):
        if fault := signature_error(function, *made, **dict.fromkeys(names)):
            raise InputError(
                f"the grid gives {'what setup returns, then ' if made else ''}{', '.join(names)}; "
                f"{fault}."
            )


def _worker_count(workers: Any) -> int:
    if workers is None:
        return int(loky.cpu_count())
    if isinstance(workers, bool) or not hasattr(workers, "__index__") or workers < 1:
        raise InputError(
            f"workers is {workers!r}; it must be a whole number of processes ≥ 1, or None for one "
            f"on each core."
        )
    return int(workers)


def _make_job(function: Any, setup: Any) -> _Job:
    try:
        return _Job(uuid.uuid4().hex, cloudpickle.dumps((function, setup)))
    except Exception as error:
        raise InputError(
            f"the function cannot be sent to other processes ({type(error).__name__}: {error}). "
            f"Make what it uses in a "
            "function, and hand that in as setup."
        ) from error


class _Pool(NamedTuple):
    """Who computes: an executor, and how many points it is given at a time; no others are lost when
    the program is killed.
    """

    executor: Executor
    max_pending: int


@contextmanager
def _open_pool(workers: int, cluster: Any, needed: bool) -> Iterator[_Pool | None]:
    """Processes on this machine or the cluster's; what is not done when an exception comes is
    dropped.
    """
    if not needed:
        yield None
    elif cluster is None:
        executor = loky.get_reusable_executor(
            workers,
            timeout=_WORKER_IDLE_TIMEOUT,
            initializer=_exit_with_parent,
            initargs=(os.getpid(),),
            env=_SINGLE_THREAD_ENV,
        )
        try:
            yield _Pool(executor, _POINTS_PER_WORKER * workers)
        except BaseException:
            executor.shutdown(kill_workers=True)
            raise
    else:
        with _dask_client(cluster) as client:
            executor = client.get_executor(pure=False)
            try:
                yield _Pool(
                    executor,
                    _POINTS_PER_WORKER * max(sum(client.nthreads().values()), _MIN_CLUSTER_THREADS),
                )
            finally:
                executor.shutdown(wait=False)


@contextmanager
def _dask_client(cluster: Any) -> Iterator[Any]:
    """The Dask client that was handed in, or one for an address."""
    try:
        from distributed import Client
        from distributed.comm import parse_host_port
    except ImportError:
        raise InputError('a cluster needs Dask: pip install "floatbase[cluster]".') from None
    if isinstance(cluster, Client):
        if cluster.status != "running":
            raise InputError(f"the Dask client is {cluster.status}; make a new one.")
        yield cluster
        return
    if not isinstance(cluster, str):
        raise InputError(
            f"cluster must be a dask.distributed.Client or a scheduler's address, not {cluster!r}."
        )
    try:
        parse_host_port(cluster)
        client = Client(cluster, timeout=_CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at {cluster} ({error}). An address looks like "
            f"tcp://127.0.0.1:8786; "
            "`dask scheduler` prints its own."
        ) from None
    with client:
        yield client


def _completed_points(
    pool: _Pool | None, job: _Job, points: list[Row], pending: list[int]
) -> Iterator[tuple[int, Row]]:
    """Number and answer of each open point, as they come."""
    if pool is None:
        return
    remaining = iter(pending)
    indices: dict[Future[Row | Exception], int] = {}
    try:
        while True:
            for i in itertools.islice(remaining, pool.max_pending - len(indices)):
                indices[pool.executor.submit(_run_point, job, points[i])] = i
            if not indices:
                return
            for future in wait(indices, return_when=FIRST_COMPLETED).done:
                answer = _future_result(future)
                if isinstance(answer, Exception):
                    raise answer
                yield indices.pop(future), answer
    except BrokenExecutor as error:
        raise SimulationError(
            "a worker process ended in the middle of a point: it was out of memory, where fewer "
            "workers help, or compiled "
            "code crashed."
        ) from error


def _future_result(future: Future[Row | Exception]) -> Row | Exception:
    """What `_run_point` returned. It raises nothing itself: what is raised is the engine's."""
    try:
        return future.result()
    except BrokenExecutor:
        raise
    except Exception as error:
        raise SimulationError(
            f"the cluster broke down at a point ({type(error).__name__}: {error})."
        ) from error


_parent_pid: int | None = None  # in a process of this machine: the program that started it
_this_thread = (
    threading.local()
)  # of a worker's thread: function and token of the sweep that it works for


def _run_point(job: _Job, point: Row) -> Row | Exception:
    """In a worker: the row's results, or the exception that ends the sweep; raised here, Dask would
    log it for each point.
    """
    _exit_if_orphaned()
    try:
        return _evaluate(job, point)
    except Exception as error:
        if not isinstance(error, InputError):
            error.add_note(f"in a worker:\n{traceback.format_exc()}")
        return error


def _evaluate(job: _Job, point: Row) -> Row:
    """What the function returned at a point, in plain values, and "error"."""
    if getattr(_this_thread, "token", None) != job.token:
        try:
            function, setup = pickle.loads(job.payload)
        except (ImportError, AttributeError) as error:
            raise InputError(
                f"a worker cannot load the function: {error}. The workers must be able to import "
                f"the module that it is "
                "from. Functions of a notebook or a script are sent whole, but for those that "
                "lru_cache wraps: use setup."
            ) from error
        _this_thread.function = function if setup is None else partial(function, setup())
        _this_thread.token = job.token
    try:
        answer = _this_thread.function(**point)
    except (
        Exception,
        SystemExit,
    ) as error:  # sys.exit would end the program that sweeps, without a word
        return {"error": f"{type(error).__name__}: {error}"}
    results = answer if isinstance(answer, Mapping) else {"result": answer}
    for name in results:
        if not isinstance(name, str) or name in RESERVED_NAMES or name in point:
            raise InputError(
                f"the function's result {name!r} must be called otherwise: a text that names no "
                f"parameter."
            )
    return {
        name: as_json_value(f"the function's result {name!r}", value)
        for name, value in results.items()
    } | {"error": None}


def _exit_with_parent(parent: int) -> None:
    """In a worker: end when the program that started it is gone. One that was killed tells nobody."""
    global _parent_pid
    _parent_pid = parent

    def watch_parent() -> None:
        while True:
            time.sleep(_PARENT_CHECK_PERIOD)
            _exit_if_orphaned()

    threading.Thread(target=watch_parent, daemon=True).start()


def _exit_if_orphaned() -> None:
    if _parent_pid is not None and os.getppid() != _parent_pid:
        os._exit(1)
