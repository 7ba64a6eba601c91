"""Backs up `state.sqlite` automatically, and recovers it from a backup whenever it is damaged.

The newest three are kept beside it in the folder `backups`: `state-TIME.tokens-COUNT.sqlite`. Each was intact
when it was written. The count, which survives damage of the backup, shows whether access required a token.
"""

import hashlib
import logging
import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from grabberd import runtime
from grabberd.archive.capture.captures_folder import ANY, id_of
from grabberd.archive.state.state_database import (
    ASIDE,
    GUARDED,
    MIGRATIONS,
    STAMP,
    StateStore,
    copy_of,
    set_aside,
)
from grabberd.errors import Cause, StorageError
from grabberd.fault_board import FaultBoard
from grabberd.files.disk import (
    OWNER_ONLY,
    DirectoryLock,
    is_damaged,
    storage_errors,
    sync_directory,
    write_synced,
)
from grabberd.runtime import UtcClock, iso_utc

STATE, FOLDER = "state.sqlite", "backups"
KEPT = 3
CAPTURES_FOLDER = "captures_folder"
"""Key of the settings: id of the captures folder."""
ORIGIN = "origin"
"""Key of the settings: origin of a recovered state that was not accepted yet."""
_NAME = re.compile(r"state-(\d{8}T\d{12}Z)\.tokens-(\d+)\.sqlite")
_MATTERS = ("settings", "tokens", "annotations")


class Backup(NamedTuple):
    """A backup, with its time and number of tokens from its name."""

    path: Path
    made: datetime
    tokens: int


class Origin(NamedTuple):
    """Origin of a recovered state.

    Attributes:
        at_utc: Time of the recovery.
        from_utc: Time of the backup that was used; None if there was no good one, so the state is new.
        aside: Name of the damaged file; None if it was missing.
        reason: What was wrong with it.
    """

    at_utc: str
    from_utc: str | None
    aside: str | None
    reason: str


class StateBackups:
    """The backups of one state directory; used by one thread of the program that has locked it."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.path = directory / STATE
        self.folder = directory / FOLDER
        self._digest: bytes | None = None

    def backups(self) -> list[Backup]:
        """All backups, newest first, including damaged ones."""
        with storage_errors(self.folder):
            names = sorted((path.name for path in self.folder.glob("*")), reverse=True)
        found = ((name, _NAME.fullmatch(name)) for name in names)
        return [
            Backup(self.folder / name, datetime.strptime(match[1], STAMP).replace(tzinfo=UTC), int(match[2]))
            for name, match in found
            if match
        ]

    def back_up(self, now: datetime, *, always: bool = False) -> bool:
        """Backs up the state if settings, tokens or annotations have changed, or `always`.

        Returns True if a backup was made. Backups with a token that has been removed since are deleted, so
        that no recovery makes it valid again.

        Raises:
            sqlite3.DatabaseError: The state is damaged; no backup was changed.
            StorageError: The state cannot be read or written now.
        """
        copy = self._copy()
        with _opened(copy) as connection:
            digest, tokens = _digest_of(connection), _tokens_of(connection)
        if digest == self._last_digest() and not always:
            return False
        path = self.folder / f"state-{now.astimezone(UTC):{STAMP}}.tokens-{len(tokens)}.sqlite"
        part = path.with_name(f".{path.name}.part")
        with storage_errors(path):
            self.folder.mkdir(mode=0o700, exist_ok=True)
            part.unlink(missing_ok=True)
            write_synced(part, copy, OWNER_ONLY)
            runtime.rename(part, path)
            sync_directory(self.folder)
        self._digest = digest
        self._prune(tokens)
        return True

    def damage(self) -> str | None:
        """Reason why the state cannot be used; None if it is intact or has never existed.

        Raises:
            StorageError: The state cannot be read now.
        """
        if not self.path.exists() or not self.path.stat().st_size:
            # The first start may have been interrupted before anything was written.
            return "it is gone" if self._was_there() else None
        try:
            self._copy()
        except sqlite3.DatabaseError as error:
            return str(error)
        return None

    def check(self) -> None:
        """Checks that the state is intact, so that a lost state is not silently replaced by a new one.

        Raises:
            StorageError: The state is damaged or missing.
        """
        if (reason := self.damage()) is not None:
            raise StorageError(
                f"{self.path} is damaged: {reason}",
                "start the daemon: it recovers the state from its newest good backup",
            )

    def recover(self, reason: str, now: datetime) -> Origin:
        """Replaces a damaged state with the newest good backup, or with a new state if there is none.

        The damaged file is kept under a dated name. All browser sessions end, since some may have been ended
        after the backup.

        Raises:
            StorageError: The disk cannot be read or written.
        """
        known = self.backups()
        good = next(((one, copy) for one in known if (copy := _intact(one.path)) is not None), None)
        content = b"" if good is None else good[1]
        from_utc = None if good is None else iso_utc(good[0].made)
        origin = Origin(iso_utc(now), from_utc, set_aside(self.path, now), reason)
        part = self.path.with_name(f".{STATE}.part")
        with storage_errors(self.path):
            part.unlink(missing_ok=True)
            write_synced(part, content, OWNER_ONLY)
        state = StateStore(part)
        state.open()
        state.execute("DELETE FROM sessions")
        # By the name of the newest backup, damaged or not; without any, there may have been tokens.
        guarded = {GUARDED: True} if not known or known[0].tokens else {}
        state.put({**guarded, ORIGIN: origin._asdict()})
        with storage_errors(self.path):
            runtime.rename(part, self.path)
            sync_directory(self.directory)
        return origin

    def _was_there(self) -> bool:
        return bool(self.backups()) or any(self.directory.glob(f"{STATE}.{ASIDE}*"))

    def _copy(self) -> bytes:
        """A consistent, checked copy of the state, even while it is being written.

        Raises:
            sqlite3.DatabaseError: The state is damaged.
            StorageError: The state cannot be read now.
        """
        try:
            content = copy_of(self.path, "rw")
        except sqlite3.Error as error:
            if is_damaged(error, self.path):
                raise
            raise StorageError(f"{STATE} cannot be read: {error}", "fix the disk, or its rights") from error
        _check(content)
        return content

    def _last_digest(self) -> bytes | None:
        """Digest of the newest backup; None if it is damaged or does not exist."""
        newest = self.backups()[:1]
        if self._digest is None and newest and (copy := _intact(newest[0].path)) is not None:
            with _opened(copy) as connection:
                self._digest = _digest_of(connection)
        return self._digest if newest and newest[0].path.exists() else None

    def _prune(self, tokens: set[bytes]) -> None:
        for number, backup in enumerate(self.backups()):
            if number >= KEPT or _holds_others(backup.path, tokens):
                with storage_errors(backup.path):
                    backup.path.unlink(missing_ok=True)


def origin_of(state: StateStore) -> Origin | None:
    """The origin of the state in use; None if it was never recovered, or was accepted.

    Raises:
        StorageError: The state cannot be read.
    """
    found = state.get(ORIGIN)
    return Origin(**found) if found else None


def accept_state(path: Path, captures: Path) -> list[str]:
    """Accepts a recovered state and a different captures folder; returns what was accepted, in words.

    Raises:
        StorageError: The state cannot be read or written.
    """
    state, accepted = StateStore(path), []
    if (origin := origin_of(state)) is not None:
        state.remove(ORIGIN)
        accepted.append(f"settings of {origin.from_utc}" if origin.from_utc else "new settings")
    if state.get(CAPTURES_FOLDER) not in (None, ANY, id_of(captures)):
        state.put({CAPTURES_FOLDER: ANY})
        accepted.append(f"the folder of captures {captures}")
    return accepted


def _intact(path: Path) -> bytes | None:
    """Content of a backup; None if it is damaged or cannot be read."""
    with suppress(OSError, sqlite3.DatabaseError):
        content = path.read_bytes()
        _check(content)
        return content
    return None


def _holds_others(path: Path, tokens: set[bytes]) -> bool:
    """True if a backup holds a token that is no longer valid."""
    copy = _intact(path)
    if copy is None:
        return False
    with _opened(copy) as connection:
        return not _tokens_of(connection) <= tokens


def _check(content: bytes) -> None:
    with _opened(content) as connection:
        found = connection.execute("PRAGMA integrity_check").fetchone()[0]
        if found != "ok":
            raise sqlite3.DatabaseError(found)
        # A state of a later version is intact; it is refused when it is opened.
        version = connection.execute("PRAGMA user_version").fetchone()[0]
        if version == 0:
            raise sqlite3.DatabaseError("it is empty")
        if version <= len(MIGRATIONS):
            _digest_of(connection)


def _opened(content: bytes) -> "closing[sqlite3.Connection]":
    connection = runtime.connect(":memory:")
    if content:
        connection.deserialize(content)
    return closing(connection)


def _digest_of(connection: sqlite3.Connection) -> bytes:
    digest = hashlib.sha256()
    for line in _rows(connection):
        digest.update(repr(line).encode())
    return digest.digest()


def _rows(connection: sqlite3.Connection) -> Iterator[tuple[object, ...]]:
    there = {name for (name,) in connection.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")}
    for table in _MATTERS:
        if table in there:  # an earlier version has fewer
            yield from connection.execute(f"SELECT * FROM {table} ORDER BY 1")  # noqa: S608 - constants


def _tokens_of(connection: sqlite3.Connection) -> set[bytes]:
    there = connection.execute("SELECT 1 FROM sqlite_schema WHERE name = 'tokens'").fetchone()
    return {row[0] for row in connection.execute("SELECT hash FROM tokens")} if there else set()


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
        self._database = StateStore(self._path)
        self._backups = StateBackups(directory)
        self._lock = DirectoryLock(directory)
        self._faults = faults
        self._clock = clock
        self._one = runtime.rlock()
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
