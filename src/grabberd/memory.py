"""Memory and threads of this process and its children: what it keeps, and whom the kernel takes first.

By default glibc returns large blocks to the kernel as soon as they are freed, and gets them anew page by
page: for the arrays of a field that costs as much as the work done on them.
"""

import ctypes
import gc
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

KEPT_BYTES = 32 << 20
"""Freed memory that the process keeps in each of its arenas."""
ARENAS = 2
"""Number of arenas: threads that take turns in the interpreter need few, and each keeps memory of its own."""
LARGEST_BYTES = 4 << 20
"""Size of a block above which it is still returned at once."""
AHEAD_BYTES = 1 << 20
"""Memory that is requested at a time when more is needed."""
KILLED_FIRST = 1000
"""The kernel takes the process before any other when it looks for one to kill: a job or a reading can be
repeated, a capture cannot. With 500, half of the limit is added to what the job uses, and a daemon may use
more."""
_TRIM_THRESHOLD, _TOP_PAD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -2, -3, -8
"""Options of mallopt(3), as malloc.h numbers them."""


def keep_freed_memory() -> bool:
    """Keeps freed memory in this process from now on; returns False if its C library has no such settings."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        return False
    asked = {
        _TRIM_THRESHOLD: KEPT_BYTES,
        _ARENA_MAX: ARENAS,
        _MMAP_THRESHOLD: LARGEST_BYTES,
        _TOP_PAD: AHEAD_BYTES,
    }
    return all(mallopt(option, value) == 1 for option, value in asked.items())


def freeze_loaded() -> None:
    """Leaves what is loaded so far, which stays for good, out of every later collection of garbage.

    A full collection would look at all of it, and hold the interpreter for some 90 ms: longer than a grabber
    with four buffers can wait for the thread that takes its fields.
    """
    gc.collect()
    gc.freeze()


def kill_first(pid: int | None) -> None:
    """Lets the kernel take a child, and not the daemon, where the service's memory is used up.

    The parent does it: what a child imports before it could may be too much already.
    """
    try:
        Path(f"/proc/{pid}/oom_score_adj").write_text(str(KILLED_FIRST))
    except OSError:  # no such file but on Linux; without it the largest process is taken
        return


def one_thread(work: Callable[P, T]) -> Callable[P, T]:
    """A function that computes with one thread of BLAS.

    The matrices are small: several threads wait for each other longer than they compute, on a busy computer
    forty times as long. Commands and the daemon say so in their environment, before numpy is loaded; a
    notebook has loaded it already.
    """

    @wraps(work)
    def limited(*args: P.args, **options: P.kwargs) -> T:
        from threadpoolctl import threadpool_limits  # noqa: PLC0415 - looks for the libraries that are loaded

        with threadpool_limits(1, user_api="blas"):
            return work(*args, **options)

    return limited
