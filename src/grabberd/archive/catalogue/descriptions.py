"""Descriptions of sealed captures, each read once, and none that holds up who asks for others."""

import time
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from grabberd.documents.captures import CaptureDocument
from grabberd.errors import ReadingGivenUp, StorageError
from grabberd.files.disk import storage_errors
from grabberd.files.patience import CURRENT, Patience, check_patience, within

KEPT = 4096
"""Number of captures whose descriptions are cached."""
LONGEST_S = 25.0
"""Time to describe one capture: less than a request for a list has, so that no file takes all of it."""
TOO_SLOW_FOR_S = 600.0
"""Time for which a file that took longer than that is not tried again."""


class Descriptions:
    """Describes files, each once until it changes: the ledger of a long capture takes a while to read.

    Args:
        describe: Describes a file.
    """

    def __init__(self, describe: Callable[[Path], CaptureDocument]) -> None:
        self._describe = lru_cache(KEPT)(lambda path, changed_ns: describe(path))
        self._too_slow: dict[tuple[Path, int], float] = {}

    def of(self, path: Path) -> CaptureDocument:
        """The description of a file.

        Raises:
            CaptureFileError: It is damaged.
            StorageError: It takes longer than `LONGEST_S`.
            ReadingGivenUp: Nobody waits for it any longer.
        """
        changed_ns = _changed_ns(path)
        key = (path, changed_ns)
        if self._too_slow.get(key, 0.0) > time.monotonic():
            raise _too_slow(path)
        try:
            with within(Patience(time.monotonic() + LONGEST_S, outer=CURRENT.get())):
                return self._describe(path, changed_ns)
        except ReadingGivenUp as error:
            check_patience(path.name)
            if len(self._too_slow) >= KEPT:
                self._too_slow.clear()
            self._too_slow[key] = time.monotonic() + TOO_SLOW_FOR_S
            raise _too_slow(path) from error


def _too_slow(path: Path) -> StorageError:
    return StorageError(
        f"describing {path.name} takes longer than {LONGEST_S:g} s",
        "it is tried again after ten minutes; to see the others sooner, move it elsewhere",
    )


def _changed_ns(path: Path) -> int:
    with storage_errors(path), suppress(FileNotFoundError):
        return path.lstat().st_mtime_ns
    return 0
