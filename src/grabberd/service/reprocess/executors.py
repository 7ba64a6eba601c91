"""Where captures are measured again: processes of this computer, or a Dask cluster that there is already."""

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
from grabberd.service.jobs.runner import NICENESS

if TYPE_CHECKING:
    from distributed import Client

CONNECT_S = 10
FOLDERS_SAME = "mount the captures and --out at the same path on every computer"


class Workers(NamedTuple):
    """What carries orders out: `start` gives an executor, anew after a break; `number` work side by side."""

    start: Callable[[], Executor]
    number: int


@contextmanager
def local_workers(count: int | None = None) -> Iterator[Workers]:
    """Niced processes of this computer, as many as it has processors."""
    count = count or len(os.sched_getaffinity(0))
    spawn = multiprocessing.get_context("spawn")
    yield Workers(lambda: ProcessPoolExecutor(count, mp_context=spawn, initializer=_prepare), count)


@contextmanager
def cluster_workers(address: str, out: Path) -> Iterator[Workers]:
    """The workers of a Dask cluster, all of which have this version of grabberd and see the folder `out`.

    Raises:
        ExtraMissing: Dask is not installed here.
        NotReady: there is no cluster at that address, or it has no workers.
        InputError: a worker has no or another grabberd, or does not see the folder.
    """
    if importlib.util.find_spec("distributed") is None:
        raise ExtraMissing("a Dask cluster", "fleet")
    client = _connected(address)
    try:
        threads = client.nthreads()
        if not threads:
            raise NotReady(f"the cluster at {address} has no workers", "start some: dask worker ADDRESS")
        _check(client, address, out)
        yield Workers(lambda: client.get_executor(pure=False), sum(threads.values()))
    finally:
        client.close()


def _connected(address: str) -> "Client":
    from distributed import Client  # noqa: PLC0415

    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what goes wrong is said by us, once
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
            raise InputError(f"worker {worker} does not see the folder {out}", FOLDERS_SAME)


def _seen_by_worker(out: str) -> tuple[str, bool, bool]:
    parquet = importlib.util.find_spec("pyarrow") is not None
    return __version__, parquet, os.access(out, os.W_OK | os.X_OK)


def _prepare() -> None:
    """In each new process: polite to others, deaf to Ctrl-C, gone when its parent is."""
    os.nice(NICENESS)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
