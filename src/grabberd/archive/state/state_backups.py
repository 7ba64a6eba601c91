"""Automatic backups of `state.sqlite`, and recovery of a damaged state from them.

The newest three are kept beside it in the folder `backups`: `state-TIME.tokens-COUNT.sqlite`. Each was intact
when it was written. The count, which survives damage of the backup, shows whether access required a token.
"""

import hashlib
import json
import os
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from grabberd.archive.capture.captures_folder import ANY, id_of
from grabberd.archive.state.state_database import (
    ASIDE,
    MIGRATIONS,
    STAMP,
    StateDatabase,
    StateStore,
    copy_of,
    set_aside,
)
from grabberd.archive.state.token_store import GUARDED
from grabberd.clock import iso_utc
from grabberd.errors import StorageError
from grabberd.files.disk import OWNER_ONLY, is_damaged, storage_errors, sync_directory, write_synced

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
            os.rename(part, path)
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
            os.rename(part, self.path)
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
            if is_damaged(error):
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


def origin_of(state: StateDatabase) -> Origin | None:
    """The origin of the state in use; None if it was never recovered, or was accepted.

    Raises:
        StorageError: The state cannot be read.
    """
    with state.errors():
        rows = state.execute("SELECT value FROM settings WHERE key = ?", ORIGIN)
        return Origin(**json.loads(rows[0][0])) if rows else None


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
    connection = sqlite3.connect(":memory:")
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
