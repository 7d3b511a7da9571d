"""`sweep`: a function at every point of a grid, in several processes or on a Dask cluster."""

from __future__ import annotations

import ast
import hashlib
import inspect
import itertools
import os
import pickle
import textwrap
import threading
import time
import traceback
import uuid
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from floatbase._validation import as_bool, as_integer, short_repr, signature_error
from floatbase.errors import InputError, SimulationError, require
from floatbase.simulation.row_store import RESERVED_NAMES, Row, RowStore, as_frame, as_json_value

if TYPE_CHECKING:
    from pandas import DataFrame

_MAX_WORKERS = 1024  # a larger number is a typing error
_WORKER_IDLE_TIMEOUT = 60.0  # s after which an idle worker ends; a sweep before that reuses it
_POINTS_PER_WORKER = 2  # submitted at a time, the current one and the next; a kill loses no others
_MIN_CLUSTER_THREADS = 32  # a Dask cluster that begins with fewer may grow during the sweep
_PARENT_CHECK_PERIOD = 1.0  # s between checks that the program that runs the sweep is alive
_CONNECT_TIMEOUT = 10.0  # s that a Dask scheduler may take to answer
_SINGLE_THREAD_ENV = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
_Job = tuple[str, bytes]  # a token of the sweep, and the pickled function and setup


def sweep(
    function: Callable[..., Any],
    grid: Mapping[str, Iterable[Any]] | Iterable[Mapping[str, Any]],
    *,
    setup: Callable[[], Any] | None = None,
    file: str | Path | None = None,
    workers: int | None = None,
    cluster: Any = None,
    progress: bool = True,
) -> DataFrame:
    """Call a function at every point of a grid, in several processes, and return a table.

    Functions, lambdas and classes of a notebook or script are sent to the processes by value.
    Modules that they import must be importable there.

    Parameters
    ----------
    function : callable
        Called with a point's parameters as keyword arguments, after the result of `setup` if there
        is one. It returns a dict with one entry for each column, or one value for the column
        "result". Values may be numbers, strings, booleans, lists, and NumPy arrays, which become
        lists. If the function raises an exception, the row's "error" holds it, and the sweep
        continues.
    grid : dict or iterable of dict
        Values of each parameter, name -> values, for all combinations; the last name changes
        fastest. Alternatively, one dict of parameters for each point.
    setup : callable, optional
        Called once in each process (on Dask once in each thread), for objects that are slow to make
        or cannot be pickled. An exception that it raises ends the sweep, and is raised here. An
        exception that this process cannot load becomes a `SimulationError` with its type and text.
    file : str or Path, optional
        Path of a JSON Lines file to which each row is written as it finishes. Running the same
        sweep with the same file resumes it, even after it was killed; at most two points for each
        worker are computed again. Points whose row has an error are also computed again. The values
        of the grid may change: points that are in the file are not computed again. `read_sweep`
        reads a file.
    workers : int, optional
        Number of processes, by default one for each core. Each process uses one thread for linear
        algebra, so that the rows are bit-identical for any number of workers.
    cluster : distributed.Client or str, optional
        A Dask client or the address of a scheduler, to run the sweep there. Dask needs `pip install
        "floatbase[cluster]"`.
    progress : bool, optional
        Whether to show a progress bar.

    Returns
    -------
    pandas.DataFrame
        One row for each point, in the order of the grid, with parameters, results, and "error",
        which is None or the type and message of an exception.

    Raises
    ------
    InputError
        If the grid does not fit the function, if a result cannot be stored, or if the file belongs
        to another sweep or cannot be written to.
    MissingDependencyError
        If Dask is needed, but not installed.
    SimulationError
        If a process or the cluster breaks down, or if an exception of `setup` cannot be loaded
        here. Rows in the file are kept, also after an interrupt.

    Warns
    -----
    SimulationWarning
        If the function, `setup`, or a function or constant of the same module that they use was
        edited after rows of the file were computed.

    Examples
    --------
    >>> import floatbase as fb
    >>> def setup():  # called once in each process
    ...     robot = fb.load("go2")
    ...     contacts = fb.Contacts.points(robot, mu=0.7)
    ...     tasks = fb.standing_tasks(robot.standing())
    ...     return fb.Simulation(robot), fb.WholeBodyController(robot, contacts, tasks)
    >>> def push(made, force):
    ...     sim, controller = made
    ...     sim.reset()
    ...     run = fb.rollout(sim, controller, 0.1, [fb.Push([0.0, force, 0.0])])
    ...     return {"outcome": run.outcome}
    >>> table = fb.sweep(push, {"force": [30.0, 60.0]}, setup=setup, workers=1, progress=False)
    >>> table["outcome"].tolist()
    ['completed', 'completed']
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
            "workers is the number of processes on this computer, so it cannot be combined with "
            "cluster. Pass one of the two."
        )
    require("pandas", "sweep")  # missing libraries are reported before hours of work
    executor = _executor(_worker_count(workers), cluster)
    job = _pickled(function, setup)
    with closing(RowStore(file, name, _source_digest(function, setup), json_points)) as store:
        done = {i for i, row in store.rows.items() if row["error"] is None}
        pending = [(i, point) for i, point in enumerate(points) if i not in done]
        with closing(_answers(executor, job, pending)) as answers:
            failed, tqdm = 0, require("tqdm.auto", "sweep").tqdm
            counts = {"total": len(points), "initial": len(done), "unit": "point"}
            with tqdm(answers, name, disable=not as_bool("progress", progress), **counts) as bar:
                for i, answer in bar:
                    if isinstance(answer, _Failure):
                        raise answer.exception()
                    store.add(i, json_points[i] | answer)
                    failed += answer["error"] is not None
                    if failed:
                        bar.set_postfix(failed=failed, refresh=False)
        return as_frame(store.rows)


def _grid_points(grid: Any) -> list[Row]:
    """Return the parameters of every point."""
    if isinstance(grid, Mapping):
        axes = {}
        for name, values in grid.items():
            if not _is_list(values):
                raise InputError(
                    f"The grid's {name!r} must be a list of values, not {short_repr(values)}. For "
                    f"a single value, use [{short_repr(values)}]."
                )
            axes[name] = list(values)
            if not axes[name]:
                raise InputError(
                    f"The grid's {name!r} has no values, so the grid has no points. Pass at least "
                    f"one value."
                )
        rows = itertools.product(*axes.values()) if axes else ()
        points = [dict(zip(axes, row, strict=True)) for row in rows]
    elif _is_list(grid):
        points = list(grid)
        for point in points:
            if not isinstance(point, Mapping):
                raise InputError(
                    f"A grid that is a list must hold a dict, name -> value, for each point, not "
                    f"{short_repr(point)}."
                )
    else:
        raise InputError(
            f"The grid must be a dict, name -> list of values, or a list of dicts, not "
            f"{short_repr(grid)}."
        )
    if not points:
        raise InputError("The grid has no points. Pass at least one point.")
    for name in dict.fromkeys(name for point in points for name in point):
        if not isinstance(name, str) or name in RESERVED_NAMES:
            raise InputError(
                f"A parameter cannot be called {short_repr(name)}. Use another string; the names "
                f"{' and '.join(RESERVED_NAMES)} are reserved."
            )
    return [dict(point) for point in points]


def _is_list(value: Any) -> bool:
    """Return whether a value is iterable, unlike an array of shape (), and is not a string."""
    is_iterable = isinstance(value, Iterable) and getattr(value, "shape", None) != ()
    return is_iterable and not isinstance(value, str)


def _function_name(function: Any, file: Any) -> str:
    """Return the function's name for the file and the progress bar."""
    if not callable(function):
        raise InputError(
            f"The first argument of sweep must be a function, not {short_repr(function)}."
        )
    name = getattr(function, "__qualname__", None)
    if file is not None and (name is None or name.endswith("<lambda>")):
        raise InputError(
            f"A file identifies its function by its name, and {function!r} has none. Write the "
            "function with def, and make its constants parameters of the grid."
        )
    return type(function).__name__ if name is None else name.rpartition("<locals>.")[2]


def _source_digest(*functions: Any) -> str:
    """Return a digest of the source of functions and of what they use, "" if it is unknown."""
    parts: dict[Any, str] = {}
    for function in functions:
        _add_source(function, parts)
    return hashlib.sha256("\n".join(parts.values()).encode()).hexdigest()[:16] if parts else ""


def _add_source(function: Any, parts: dict[Any, str]) -> None:
    """Add the source of a function, without comments, and of what it uses from its module."""
    function = inspect.unwrap(getattr(function, "__func__", function))
    name = getattr(function, "__name__", "<lambda>")
    if name == "<lambda>" or function in parts:  # the source of a lambda is its whole line
        return
    try:
        parts[function] = ast.unparse(ast.parse(textwrap.dedent(inspect.getsource(function))))
        used = inspect.getclosurevars(function)
    except (OSError, TypeError, ValueError, SyntaxError):  # in C, typed into a prompt, or a class
        return
    for name, value in sorted({**used.globals, **used.nonlocals}.items()):
        if getattr(value, "__module__", None) == function.__module__:
            _add_source(value, parts)
        with suppress(InputError):  # values other than numbers, strings and lists of them
            parts[function, name] = f"{name} = {as_json_value(name, value)}"


def _check_function(function: Callable[..., Any], setup: Any, points: list[Row]) -> None:
    """Raise `InputError` if the function does not fit the grid or `setup` is not a function."""
    if setup is not None and not callable(setup):
        raise InputError(f"setup must be a function without parameters, not {short_repr(setup)}.")
    made = () if setup is None else (None,)
    for names in dict.fromkeys(tuple(point) for point in points):
        if fault := signature_error(function, *made, **dict.fromkeys(names)):
            raise InputError(
                f"The function must accept {'the result of setup, then ' if made else ''}"
                f"the parameters of the grid, {', '.join(names)}, but {fault}."
            )


def _worker_count(workers: Any) -> int:
    """Return the number of processes, checked."""
    if workers is None:
        return int(require("loky", "sweep").cpu_count())
    return as_integer("workers", workers, 1, _MAX_WORKERS, "None is one process on each core")


def _pickled(function: Any, setup: Any) -> _Job:
    """Return the function and setup as a job for workers."""
    try:
        return uuid.uuid4().hex, require("cloudpickle", "sweep").dumps((function, setup))
    except InputError:
        raise
    except Exception as error:
        raise InputError(
            f"The function cannot be sent to other processes ({type(error).__name__}: {error}). "
            "Make the objects that it uses in a function, and pass that function as setup."
        ) from error


@contextmanager
def _executor(workers: int, cluster: Any) -> Iterator[tuple[Executor, int]]:
    """Yield an executor, here or on the cluster, and how many points to submit at a time."""
    if cluster is None:
        executor = require("loky", "sweep").get_reusable_executor(
            workers,
            timeout=_WORKER_IDLE_TIMEOUT,
            initializer=_watch_parent,
            initargs=(os.getpid(),),
            env=_SINGLE_THREAD_ENV,
        )
        try:
            yield executor, _POINTS_PER_WORKER * workers
        except BaseException:  # unfinished points are dropped
            executor.shutdown(kill_workers=True)
            raise
        return
    with _dask_client(cluster) as client:
        executor = client.get_executor(pure=False)
        threads = max(sum(client.nthreads().values()), _MIN_CLUSTER_THREADS)
        try:
            yield executor, _POINTS_PER_WORKER * threads
        finally:
            executor.shutdown(wait=False)


def _watch_parent(parent: int) -> None:
    """Exit this worker soon after the program that started it was killed."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_PARENT_CHECK_PERIOD)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _dask_client(cluster: Any) -> Any:
    """Return a context with the given Dask client, or with a new one for an address."""
    distributed = require("distributed", "cluster")
    if isinstance(cluster, distributed.Client):
        if cluster.status != "running":
            raise InputError(f"The Dask client is {cluster.status}. Make a new one.")
        return nullcontext(cluster)
    if not isinstance(cluster, str):
        raise InputError(
            f"cluster must be a dask.distributed.Client or a scheduler's address, not "
            f"{short_repr(cluster)}."
        )
    try:
        distributed.comm.parse_host_port(cluster)
        return distributed.Client(cluster, timeout=_CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"No Dask scheduler answers at {cluster} ({error}). Pass the address that "
            "`dask scheduler` prints, such as tcp://127.0.0.1:8786."
        ) from None


def _answers(
    executor: AbstractContextManager[tuple[Executor, int]],
    job: _Job,
    pending: list[tuple[int, Row]],
) -> Generator[tuple[int, Row | _Failure], None, None]:
    """Yield the number of each pending point as it finishes, with its row or a failure."""
    if not pending:
        return
    remaining, submitted = iter(pending), dict[Future[Row | _Failure], int]()
    with executor as (pool, max_submitted):
        while True:
            for i, point in itertools.islice(remaining, max_submitted - len(submitted)):
                submitted[pool.submit(_run_point, job, point)] = i
            if not submitted:
                return
            for future in wait(submitted, return_when=FIRST_COMPLETED).done:
                try:
                    answer = future.result()
                except BrokenExecutor as error:
                    raise SimulationError(
                        "A worker process died. If it ran out of memory, use fewer workers; "
                        "otherwise, compiled code has crashed."
                    ) from error
                except Exception as error:  # from the cluster: `_run_point` raises nothing
                    raise SimulationError(
                        f"The cluster broke down ({type(error).__name__}: {error}). Start it "
                        "again, and run the same sweep to resume from its file."
                    ) from error
                yield submitted.pop(future), answer


@dataclass(frozen=True)
class _Failure:
    """Exception of a worker in a form that every process can load."""

    pickled: bytes
    text: str
    note: str

    @staticmethod
    def of(error: BaseException) -> _Failure:
        """Pickle an exception, if what is loaded again has its type and its text."""
        text, note = _one_line(error), f"in a worker:\n{''.join(traceback.format_exception(error))}"
        with suppress(BaseException):  # user code may raise anything
            failure = _Failure(require("cloudpickle", "sweep").dumps(error), text, note)
            found = failure.exception()
            if type(found) is type(error) and _one_line(found) == text:
                return failure
        return _Failure(b"", text, note)

    def exception(self) -> BaseException:
        """Return the exception, or a `SimulationError` with its text if it cannot be loaded."""
        try:
            error: BaseException = pickle.loads(self.pickled)
        except Exception:
            error = SimulationError(self.text)
        if not isinstance(error, InputError):
            error.add_note(self.note)
        return error


def _one_line(error: BaseException) -> str:
    """Return the type and the text of an exception, whose `__str__` may fail."""
    try:
        return f"{type(error).__name__}: {error}"
    except BaseException as failure:  # user code may raise anything
        return f"{type(error).__name__}: (its text is not available: {type(failure).__name__})"


_this_thread = threading.local()  # of a worker: function and token of its present sweep


def _run_point(job: _Job, point: Row) -> Row | _Failure:
    """Return the results of a point as JSON values, or the exception that ends the sweep."""
    # this runs in a worker, and returns the exception because Dask would log it for each point
    try:
        function = _loaded(*job)
        try:
            answer = function(**point)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # sys.exit would end the worker
            return {"error": _one_line(error)}
        results = answer if isinstance(answer, Mapping) else {"result": answer}
        for name in results:
            if not isinstance(name, str) or name in RESERVED_NAMES or name in point:
                raise InputError(
                    f"The function's result {name!r} needs another name: a string that is neither "
                    f"reserved nor a parameter."
                )
        return {
            name: as_json_value(f"the function's result {name!r}", value)
            for name, value in results.items()
        } | {"error": None}
    except BaseException as error:
        return _Failure.of(error)


def _loaded(token: str, payload: bytes) -> Any:
    """Return a job's function with the result of `setup`, made once in each thread."""
    if getattr(_this_thread, "token", None) != token:
        try:
            function, setup = pickle.loads(payload)
        except (ImportError, AttributeError) as error:
            raise InputError(
                f"A worker cannot load the function: {error}. The workers must be able to import "
                "the function's module. Functions of a notebook or a script are sent by value, "
                "except those that lru_cache wraps; use setup instead."
            ) from error
        _this_thread.function = function if setup is None else partial(function, setup())
        _this_thread.token = token
    return _this_thread.function
