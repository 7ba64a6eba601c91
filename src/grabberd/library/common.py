"""Ways that the library's functions share: documents or their files as arguments, one thread of BLAS."""

import os
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from grabberd.files.documents import read_yaml

PathLike = str | os.PathLike[str]


def document_of(given: PathLike | Mapping[str, Any]) -> dict[str, Any]:
    """The document in a YAML or JSON file, or the one that is given.

    Raises:
        InputError: The file cannot be read, or has no keys.
    """
    # JSON is YAML as well.
    return dict(given) if isinstance(given, Mapping) else read_yaml(Path(given))


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
