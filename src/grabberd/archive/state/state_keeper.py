"""Backs up `state.sqlite` automatically, and recovers it whenever it is damaged."""

import logging
import sqlite3
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from grabberd.archive.state.state_backups import STATE, Origin, StateBackups, origin_of
from grabberd.archive.state.state_database import StateDatabase
from grabberd.clock import UtcClock
from grabberd.errors import Cause, StorageError
from grabberd.fault_board import FaultBoard
from grabberd.files.disk import DirectoryLock

log = logging.getLogger(__name__)

ALWAYS_NS = 3600 * 10**9
"""Interval at which the whole state is read, checked and backed up, changed or not."""
_ORIGINS = (Cause.SETTINGS_RESTORED, Cause.SETTINGS_LOST)


class StateKeeper:
    """The state database of a daemon, from `open` to `close`.

    Args:
        directory: State directory; it is locked while it is open.
        faults: Board for reporting damage.
        clock: Source of time.
        restored: Called after a recovery in a running daemon, to store active settings again.

    Attributes:
        backed_up: Number of backups made since the start.
    """

    def __init__(
        self,
        directory: Path,
        faults: FaultBoard,
        clock: UtcClock,
        restored: Callable[[], None] = lambda: None,
    ) -> None:
        self._restored = restored
        self.backed_up = 0
        self._path = directory / STATE
        self._database = StateDatabase(self._path)
        self._backups = StateBackups(directory)
        self._lock = DirectoryLock(directory)
        self._faults = faults
        self._clock = clock
        self._one = threading.RLock()
        self._seen: tuple[int, ...] = ()
        self._always_ns = clock.now_ns() + ALWAYS_NS
        self._origin: Origin | None = None

    def open(self) -> None:
        """Locks the state directory and opens its database, recovering it if needed; may be called twice.

        Raises:
            StorageError: Another program uses it, the disk fails, or a later version wrote it.
        """
        self._lock.acquire()
        with self._one:
            if (reason := self._backups.damage()) is not None:
                self._backups.recover(reason, self._clock.utc_now())
            if not self._path.exists():
                used = any((self._path.parent / "captures").glob("*"))
                level = logging.WARNING if used else logging.INFO
                log.log(level, "%s is new: there are no settings and no tokens", self._path)
            self._database.open()
            self.look()

    def close(self) -> None:
        """Backs up the latest changes, and unlocks the state directory."""
        self.look()
        self._lock.release()

    def heal(self, reason: str) -> None:
        """Recovers the state if it is really damaged; called by any store that finds it so.

        Raises:
            StorageError: The state cannot be recovered, or the state directory is missing.
        """
        with self._one:
            self._check_in_place()
            if (damage := self._backups.damage()) is None:
                return
            self._backups.recover(damage or reason, self._clock.utc_now())
            self._seen = ()
            self._report()
        with suppress(StorageError):
            self._restored()

    def look(self) -> None:
        """Backs up the state if it has changed, and recovers it if it is damaged; called periodically."""
        try:
            with self._one:
                self._look()
            self._faults.resolve(Cause.SETTINGS_UNREADABLE)
        except StorageError as error:
            self._faults.report(Cause.SETTINGS_UNREADABLE, error.message, error.hint)

    @property
    def pins_known(self) -> bool:
        """True unless the state was recovered and not accepted yet, so that pins may be missing."""
        return self._origin is None

    def _look(self) -> None:
        self._check_in_place()
        always = self._clock.now_ns() >= self._always_ns
        seen = self._stat()
        if seen == self._seen and not always:
            return
        try:
            self.backed_up += self._backups.back_up(self._clock.utc_now(), always=always)
        except sqlite3.DatabaseError as error:
            self.heal(str(error))
        if always:
            self._always_ns = self._clock.now_ns() + ALWAYS_NS
        self._report()
        self._seen = seen

    def _report(self) -> None:
        self._origin = origin = origin_of(self._database)
        if origin is None:
            self._faults.resolve(*_ORIGINS)
            return
        kept = f"; the damaged file is kept as {origin.aside}" if origin.aside else ""
        damaged = f"{STATE} could not be used ({origin.reason})"
        accept = "then: grabberd storage accept; until then storage.retention deletes nothing"
        if origin.from_utc is not None:
            self._faults.report(
                Cause.SETTINGS_RESTORED,
                f"{damaged}: settings, tokens, pins and notes are those of {origin.from_utc}{kept}",
                f"check them, also whether a removed token is back (grabberd token list), {accept}",
                "warning",
            )
            return
        self._faults.report(
            Cause.SETTINGS_LOST,
            f"{damaged}, and there is no good backup: settings, tokens, pins, notes and the choice of "
            f"calibrations are lost since {origin.at_utc}; captures are recorded{kept}",
            f"restore a backup (grabberd restore FILE), or set them again, including the tokens, {accept}",
        )

    def _stat(self) -> tuple[int, ...]:
        try:
            found = self._path.stat()
        except OSError:
            return ()
        return (found.st_ino, found.st_mtime_ns, found.st_size)

    def _check_in_place(self) -> None:
        """Checks that the state directory is the locked one, so that nothing is recovered into another.

        Raises:
            StorageError: The state directory is missing or a different one.
        """
        if not self._lock.in_place:
            raise StorageError(
                f"the state directory {self._path.parent} is gone: it was renamed, deleted or unmounted",
                "put it back or mount its disk, and everything resumes on its own",
            )
