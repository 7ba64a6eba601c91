"""Rebuilds the index of captures while the daemon runs, whenever it is found missing or damaged."""

import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from grabberd.archive.state.capture_index import CaptureIndex, Unusable
from grabberd.errors import Cause, IndexRebuilding, StorageError
from grabberd.fault_board import FaultBoard

PATIENCE_S = 2.0
"""How long a request waits for the index; a thousand captures are read in about a second."""
PAUSE_S = 10.0
"""Time between two attempts: each reads every capture file."""


class IndexKeeper:
    """Rebuilds in a thread of its own, one at a time; requests that come meanwhile wait a moment.

    Args:
        index: The index.
        unsealed: Returns the `.grab.part` files that nobody writes and that could not be sealed.
        faults: Where it is told.
        now_s: Source of monotonic time.

    Attributes:
        rebuilt: How often it has been rebuilt since the start.
    """

    def __init__(
        self,
        index: CaptureIndex,
        unsealed: Callable[[], Iterable[Path]],
        faults: FaultBoard,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.rebuilt = 0
        self._index = index
        self._unsealed = unsealed
        self._faults = faults
        self._now_s = now_s
        self._lock = threading.Lock()
        self._done: threading.Event | None = None
        self._failure: StorageError | None = None
        self._not_before_s = 0.0

    def heal(self, reason: Unusable, patience_s: float = PATIENCE_S) -> None:
        """Returns when the index has been rebuilt.

        Raises:
            IndexRebuilding: That takes longer.
            StorageError: It has failed, a moment ago or now.
        """
        done = self._started(reason)
        if not done.wait(patience_s):
            read, of = self._index.read
            raise IndexRebuilding(
                f"the list of captures is being rebuilt from their files: {read} of {of} have been read",
                "ask again in a moment; captures go on meanwhile",
                Cause.INDEX_REBUILDING,
            )
        if self._failure is not None:
            raise self._failure

    def _started(self, reason: Unusable) -> threading.Event:
        with self._lock:
            if self._done is not None and not self._done.is_set():
                return self._done
            if self._failure is not None and self._now_s() < self._not_before_s:
                raise self._failure
            self._done = threading.Event()
            self._faults.report(
                Cause.INDEX_REBUILDING,
                f"{self._index.path.name} is unusable ({reason}) and is being rebuilt from the captures",
                "nothing is lost, and captures go on; the list is there again in a moment",
                "warning",
            )
            threading.Thread(target=self._rebuild, args=(self._done,), name="index", daemon=True).start()
            return self._done

    def _rebuild(self, done: threading.Event) -> None:
        try:
            self._index.rebuild(self._unsealed(), anew=True)
        except (StorageError, OSError) as error:
            self._fail(error)
        else:
            self._failure = None
            self.rebuilt += 1
            self._faults.resolve(Cause.INDEX_FAILED)
        finally:
            self._faults.resolve(Cause.INDEX_REBUILDING)
            done.set()

    def _fail(self, error: StorageError | OSError) -> None:
        hint = "make room or fix the disk; it is retried automatically, and captures continue"
        message = f"the list of captures cannot be rebuilt: {error}"
        self._failure = StorageError(message, hint, Cause.INDEX_FAILED)
        self._not_before_s = self._now_s() + PAUSE_S
        self._faults.report(Cause.INDEX_FAILED, message, hint)
