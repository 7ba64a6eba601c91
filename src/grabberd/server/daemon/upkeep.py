"""Periodic checks in a running daemon: captures folder, unsealed files, state database, loggers."""

import logging
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress

from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.state_keeper import StateKeeper
from grabberd.errors import StorageError
from grabberd.instrument.capture_end import UnsealedCaptures
from grabberd.instrument.channels.loggers import Loggers

log = logging.getLogger(__name__)
EVERY_S = 1.0
STATE_EVERY = 10
"""The state database is checked every so many rounds; only changes since then can be lost by damage."""


class Upkeep:
    """A thread that checks everything once a second; each part reports its own faults.

    Args:
        archive: The captures.
        unsealed: Captures that could not be sealed.
        state_keeper: The state database.
        loggers: The data loggers.
        look_further: Further checks, called in every round.
    """

    def __init__(
        self,
        archive: Archive,
        unsealed: UnsealedCaptures,
        state_keeper: StateKeeper,
        loggers: Loggers,
        look_further: Sequence[Callable[[], None]] = (),
    ) -> None:
        self._archive = archive
        self._unsealed = unsealed
        self._state_keeper = state_keeper
        self._loggers = loggers
        self._look_further = look_further
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: str | None = None

    def start(self) -> None:
        """Starts the thread."""
        self._thread = threading.Thread(target=self._run, name="upkeep", daemon=True)
        self._thread.start()

    def stop(self, timeout_s: float = 10.0) -> None:
        """Ends the thread."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(timeout_s)

    def look(self, rounds: int) -> None:
        """Runs one round of checks; every `STATE_EVERY`-th includes the state database."""
        with suppress(StorageError):
            self._archive.check()
        self._unsealed.retry()
        self._loggers.look()
        if rounds % STATE_EVERY == 0:
            self._state_keeper.look()
        for look in self._look_further:
            look()

    def _run(self) -> None:
        rounds = 0
        while not self._stopping.wait(EVERY_S):
            rounds += 1
            try:
                self.look(rounds)
                self._failure = None
            except Exception as error:  # whatever happens in one round, the next one is needed
                self._complain(error)

    def _complain(self, error: Exception) -> None:
        """Logs a failure once, not every second for as long as it lasts."""
        if repr(error) != self._failure:
            log.error("the check of the daemon's files has failed: %s", error, exc_info=error)
        self._failure = repr(error)
