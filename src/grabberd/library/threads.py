"""Linear algebra on one thread, whatever the program that uses the library has set."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


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
