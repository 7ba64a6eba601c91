"""The workers that re-measure captures: processes of this computer, or an existing Dask cluster."""

import gc
import importlib.util
import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from grabberd import __version__
from grabberd.errors import ExtraMissing, InputError, NotReady
from grabberd.memory import keep_freed_memory
from grabberd.work.job_process import NICENESS

if TYPE_CHECKING:
    from distributed import Client

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
