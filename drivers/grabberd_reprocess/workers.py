"""The workers that re-measure captures, processes of this computer or a Dask cluster, and the pool of tasks.

The pool runs a bounded number of tasks at a time, each exactly once. A process that is killed breaks the
whole executor and takes the tasks of the others with it. Those are tried again one by one, so that the task
that ends every process is found, and no other is blamed for it.
"""

import gc
import importlib.util
import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from grabberd import __version__
from grabberd.errors import ExtraMissing, InputError, NotReady
from grabberd.memory import keep_freed_memory
from grabberd.work.job_runner import NICENESS

if TYPE_CHECKING:
    from distributed import Client


T = TypeVar("T")
R = TypeVar("R")
Tick = Callable[[Iterable[Any]], None]

TICK_S = 1.0


class TaskPool(Generic[T, R]):
    """Runs a function on the processes of an executor.

    Args:
        function: A function at module level; it and the tasks must be picklable.
        start: Creates an executor; called again after one broke.
        max_pending: Maximum number of tasks submitted and not yet done.
        tick: Called about once a second with the pending tasks.
    """

    def __init__(
        self,
        function: Callable[[T], R],
        start: Callable[[], Executor],
        max_pending: int,
        tick: Tick = lambda _: None,
    ) -> None:
        self._function = function
        self._start = start
        self._max_pending = max_pending
        self._tick = tick
        self._executor: Executor | None = None
        self._pending: dict[Future[R], T] = {}

    def close(self) -> None:
        """Cancels the tasks that wait, and waits for those that run."""
        for future in self._pending:
            future.cancel()
        self._pending.clear()
        if self._executor is not None:
            self._executor.shutdown(wait=True)
            self._executor = None

    def results(self, tasks: Iterable[T]) -> Iterator[tuple[T, R | BaseException]]:
        """Yields each task once as it ends, with its result or the error that ended it."""
        queue = iter(tasks)
        more = True
        while more:
            broken: list[T] = []
            more = yield from self._until_it_breaks(queue, broken)
            for task in broken:
                yield task, self._alone(task)

    def _until_it_breaks(
        self, queue: Iterator[T], broken: list[T]
    ) -> Generator[tuple[T, R | BaseException], None, bool]:
        """Returns False when all tasks are done; puts those that a break interrupted into `broken`."""
        pending = self._pending
        while not broken:
            for task in islice(queue, self._max_pending - len(pending)):
                self._submit(task, broken)
            if not pending:
                return bool(broken)
            for future in wait(pending, TICK_S, FIRST_COMPLETED).done:
                yield from self._ended(future, pending.pop(future), broken)
            self._tick(pending.values())
        for future, task in pending.items():
            yield from self._ended(future, task, broken)
        self.close()
        return True

    def _submit(self, task: T, broken: list[T]) -> None:
        self._executor = self._executor or self._start()
        try:
            self._pending[self._executor.submit(self._function, task)] = task
        except BrokenExecutor:
            broken.append(task)

    @staticmethod
    def _ended(future: Future[R], task: T, broken: list[T]) -> Iterator[tuple[T, R | BaseException]]:
        result = _result(future)
        if isinstance(result, BrokenExecutor):
            broken.append(task)
        else:
            yield task, result

    def _alone(self, task: T) -> R | BaseException:
        self._executor = self._executor or self._start()
        result = _result(self._executor.submit(self._function, task))
        if isinstance(result, BrokenExecutor):
            self.close()
        return result


def _result(future: Future[R]) -> R | BaseException:
    try:
        return future.result()
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a cancelled future's too
        return error


CONNECT_S = 10
ALGEBRA_THREADS = "OPENBLAS_NUM_THREADS"
COLLECTED_OBJECTS = 100_000
"""New objects after which Python looks for cycles of them: measuring makes none, but many objects."""
SAME_FOLDERS = "mount the captures and --out at the same path on every computer"


class Workers(NamedTuple):
    """Workers: `start` creates an executor, again after a break; `number` of them work in parallel."""

    start: Callable[[], Executor]
    number: int


@contextmanager
def local_workers(count: int | None = None) -> Iterator[Workers]:
    """Starts niced processes on this computer, by default as many as it has processors."""
    count = count or len(os.sched_getaffinity(0))
    # Spawned, not forked: a fork copies the locks of the command's other threads, held or not.
    spawn = multiprocessing.get_context("spawn")
    with _single_threaded_algebra():
        yield Workers(
            lambda: ProcessPoolExecutor(count, mp_context=spawn, initializer=_prepare_process), count
        )


@contextmanager
def _single_threaded_algebra() -> Iterator[None]:
    """Gives processes started meanwhile one thread of linear algebra each.

    With more, they wait for one another in busy loops, on the processors that the other workers need.
    """
    before = os.environ.get(ALGEBRA_THREADS)
    os.environ[ALGEBRA_THREADS] = "1"
    try:
        yield
    finally:
        os.environ.pop(ALGEBRA_THREADS, None)
        if before is not None:
            os.environ[ALGEBRA_THREADS] = before


@contextmanager
def cluster_workers(address: str, out: Path) -> Iterator[Workers]:
    """Connects to a Dask cluster whose workers all have this version of grabberd and see the folder `out`.

    Raises:
        ExtraMissing: Dask is not installed here.
        NotReady: There is no cluster at that address, or it has no workers.
        InputError: A worker has no grabberd or another version, or does not see the folder.
    """
    if importlib.util.find_spec("distributed") is None:
        raise ExtraMissing("a Dask cluster", "fleet")
    client = _connected(address)
    try:
        threads = client.nthreads()
        if not threads:
            raise NotReady(f"the cluster at {address} has no workers", "start some: dask worker ADDRESS")
        _check(client, address, out)
        # Not pure: Dask would return an earlier result of the same task without running it.
        yield Workers(lambda: client.get_executor(pure=False), sum(threads.values()))
    finally:
        client.close()


def _connected(address: str) -> "Client":
    from distributed import Client  # noqa: PLC0415

    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # we report failures, once
    try:
        return Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise NotReady(
            f"there is no Dask scheduler at {address}: {error}",
            "start one with 'dask scheduler', and name the address it prints, e.g. tcp://10.0.0.5:8786",
        ) from error


def _check(client: "Client", address: str, out: Path) -> None:
    try:
        found = client.run(_seen_by_worker, str(out))
    except Exception as error:
        raise InputError(
            f"a worker of {address} cannot run grabberd: {type(error).__name__}: {error}",
            f"install grabberd[parquet,fleet] {__version__} where the workers run",
        ) from error
    for worker, (version, parquet, sees) in sorted(found.items()):
        if version != __version__ or not parquet:
            what = f"grabberd {version}" + ("" if parquet else " without Parquet")
            hint = f"install grabberd[parquet,fleet] {__version__} where the workers run"
            raise InputError(f"worker {worker} has {what}, this is {__version__}", hint)
        if not sees:
            raise InputError(f"worker {worker} does not see the folder {out}", SAME_FOLDERS)


def _seen_by_worker(out: str) -> tuple[str, bool, bool]:
    """Returns a worker's version, whether it has Parquet, and whether it can write the folder."""
    parquet = importlib.util.find_spec("pyarrow") is not None
    return __version__, parquet, os.access(out, os.W_OK | os.X_OK)


def _prepare_process() -> None:
    """Prepares a new process: niced, keeps its memory, ends with its parent, leaves Ctrl-C to it."""
    os.nice(NICENESS)
    keep_freed_memory()
    gc.set_threshold(COLLECTED_OBJECTS)
    # A terminal sends Ctrl-C to the workers, too, but their parent ends them.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
