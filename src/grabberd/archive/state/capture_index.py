"""The index of captures, which can be rebuilt from their files at any time.

A running daemon rebuilds it whenever it is found missing or damaged.
"""

import builtins
import os
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, nullcontext, suppress
from pathlib import Path
from typing import Any, TypeVar

from grabberd import runtime
from grabberd.archive.capture.captures_folder import plainly_named
from grabberd.archive.capture.crash_recovery import set_aside
from grabberd.archive.capture.schema import DAMAGED, PART, SUFFIX, remove_with_journal
from grabberd.archive.guarded_database import JOURNAL, open_tables, read_header
from grabberd.archive.state.index_entries import (
    CAPTURES,
    DAMAGED_ENTRY,
    IndexEntry,
    Reading,
    aside_entry,
    check_entry,
    distinct,
    entry_of,
    read_entries,
)
from grabberd.errors import Cause, IndexRebuilding, NotFound, StorageError
from grabberd.fault_board import FaultBoard
from grabberd.files.disk import is_damaged, storage_errors
from grabberd.files.reading import check_patience

T = TypeVar("T")
_LAST = "~"
"""Sorts after every time."""
_MARKS = ", ".join("?" for _ in IndexEntry._fields)
_INSERT = f"INSERT OR REPLACE INTO captures VALUES ({_MARKS})"  # noqa: S608 - marks
_NOTHING = nullcontext()
_AT_ONCE = 500
"""Maximum number of captures per statement."""

VERSION = 4
_TABLE = """
CREATE TABLE captures (
    id TEXT PRIMARY KEY, file TEXT NOT NULL, device TEXT NOT NULL, created_utc TEXT NOT NULL,
    state TEXT NOT NULL, note TEXT NOT NULL DEFAULT '', labels TEXT NOT NULL DEFAULT '{}',
    reason TEXT NOT NULL DEFAULT '', size_bytes INTEGER NOT NULL DEFAULT -1,
    changed_ns INTEGER NOT NULL DEFAULT -1, verdict TEXT NOT NULL DEFAULT '',
    length INTEGER NOT NULL DEFAULT -1, losses INTEGER NOT NULL DEFAULT -1, runs INTEGER NOT NULL DEFAULT 0,
    calibration TEXT NOT NULL DEFAULT '', widths TEXT NOT NULL DEFAULT '') WITHOUT ROWID;
CREATE INDEX newest ON captures (created_utc DESC);
"""
PATIENCE_S = 2.0
"""Time for which a request waits for a rebuild; a thousand captures take about a second."""
PAUSE_S = 10.0
"""Pause between two attempts, each of which reads every capture file."""


class Unusable(Exception):
    """The index is missing or damaged and has to be rebuilt."""


class CaptureIndex:
    """`index.sqlite` beside the captures; each call has its own connection, so any thread may call.

    Captures that could not be added because the disk was full are added as soon as there is space.

    Args:
        directory: Folder of the captures.
        check: Raises StorageError while the folder is missing.
        heal: Rebuilds a missing or damaged index, or raises StorageError; by default at once.
        read_entries: Reads the entries of files, in order, also of damaged ones.
        changed: Called with the id of a capture whose entry has changed, or None for all.

    Attributes:
        read: Progress of a rebuild: number of captures read, and of captures to read.
    """

    def __init__(
        self,
        directory: Path,
        check: Callable[[], None] = lambda: None,
        heal: Callable[[Unusable], None] | None = None,
        read_entries: Callable[[Sequence[Path]], Iterable[Reading]] = read_entries,
        changed: Callable[[str | None], None] = lambda capture_id: None,
    ) -> None:
        self.directory = directory
        self.path = directory / "index.sqlite"
        self.read = (0, 0)
        self._changed = changed
        self._check = check
        self._heal = heal or (lambda _: self.rebuild(anew=True))
        self._read_entries = read_entries
        self._kept_out: set[Path] = set()
        self._changing = runtime.lock()
        self._rebuilding = False

    def rebuild(self, unsealed: Iterable[Path] = (), *, anew: bool = False) -> None:
        """Rebuilds the index from the capture files; unreadable ones are set aside as damaged.

        Files that are unchanged according to the old index are not opened again. Captures that end meanwhile
        are added afterwards.

        Args:
            unsealed: `.grab.part` files that could not be sealed.
            anew: True if the old index must not be used.

        Raises:
            StorageError: The index cannot be written.
        """
        self._rebuilding = True
        try:
            entries = list(distinct(self._entries(unsealed, {} if anew else self._known())))
            with self._changing:
                self._publish([one for one in entries if os.path.lexists(self.directory / one.file)])
        finally:
            self._rebuilding = False
        self._changed(None)

    def add(self, path: Path) -> None:
        """Adds a sealed capture, as damaged if it cannot be read.

        Raises:
            StorageError: The index cannot be written now; the capture is added later.
        """
        self._kept_out.add(path)
        self._enter_kept_out()

    def remove(self, capture_id: str) -> None:
        """Removes a capture, if it is in the index."""
        self._change(
            lambda connection: connection.execute("DELETE FROM captures WHERE id = ?", (capture_id,))
        )
        self._changed(capture_id)

    def keep_widths(self, known: IndexEntry, widths: str) -> None:
        """Stores the curve of the wall's width, unless the file's entry has been updated since."""
        change = "UPDATE captures SET widths = ? WHERE id = ? AND changed_ns = ?"
        self._change(
            lambda connection: connection.execute(change, (widths, known.id, known.changed_ns)).fetchall()
        )

    def list(self) -> list[IndexEntry]:
        """All captures, newest first."""
        return self._select("ORDER BY created_utc DESC, id DESC")

    def damaged(self) -> "builtins.list[IndexEntry]":
        """Unreadable captures, newest first."""
        return self._select("WHERE state = ? ORDER BY created_utc DESC, id DESC", DAMAGED_ENTRY)

    def page(self, after: tuple[str, str] | None, limit: int) -> "builtins.list[IndexEntry]":
        """At most `limit` captures, newest first, that follow the (created_utc, id) of `after`, if given."""
        beyond = after or (_LAST, "")
        which = "WHERE (created_utc, id) < (?, ?) ORDER BY created_utc DESC, id DESC LIMIT ?"
        return self._select(which, *beyond, limit)

    def get(self, capture_id: str) -> IndexEntry:
        """One capture.

        Raises:
            NotFound: No capture has that id.
        """
        found = self._select("WHERE id = ?", capture_id)
        if not found:
            raise NotFound(f"no capture {capture_id!r}", "GET /api/v1/captures lists all captures")
        return found[0]

    def some(self, ids: Sequence[str]) -> "builtins.list[IndexEntry]":
        """The captures with these ids that exist, in any order."""
        parts = (ids[first : first + _AT_ONCE] for first in range(0, len(ids), _AT_ONCE))
        found = (self._select(f"WHERE id IN ({', '.join('?' * len(part))})", *part) for part in parts)
        return [entry for entries in found for entry in entries]

    def with_prefix(self, text: str) -> "builtins.list[IndexEntry]":
        """Captures whose id begins with `text`, sorted by id."""
        # Not LIKE, in which _ and % are wildcards.
        return self._select("WHERE substr(id, 1, ?) = ? ORDER BY id", len(text), text)

    def _entries(self, unsealed: Iterable[Path], known: Mapping[str, IndexEntry]) -> Iterator[IndexEntry]:
        sealed = self._named(self.directory.glob(f"*{SUFFIX}"))
        kept = {path: known[path.name] for path in sealed if path.name in known}
        kept = {path: entry for path, entry in kept.items() if entry.still_holds(path)}
        yield from kept.values()
        changed = [path for path in sealed if path not in kept]
        for number, reading in enumerate(self._read_entries([*changed, *unsealed])):
            self.read = (len(kept) + number, len(sealed))
            if not (reading.is_damage and _set_aside(reading)):
                yield reading.entry
        # Last, because unreadable files have been set aside above.
        aside = self._named((self.directory / DAMAGED).glob("*"))
        yield from (aside_entry(path) for path in aside if path.name.endswith(CAPTURES))

    def _known(self) -> dict[str, IndexEntry]:
        """Entries of the present index, by file; empty if it cannot be used."""
        try:
            entries = self._attempt(lambda connection: _entries_of(connection, "SELECT * FROM captures"))
        except (Unusable, StorageError):
            return {}
        return {entry.file: entry for entry in entries}

    @staticmethod
    def _named(paths: Iterable[Path]) -> "builtins.list[Path]":
        return sorted(plain for path in paths if (plain := plainly_named(path)) is not None)

    def _publish(self, entries: Iterable[IndexEntry]) -> None:
        """Replaces the index by a new one, completely or not at all."""
        new = self.path.with_name(f".{self.path.name}{PART}")
        with storage_errors(self.path):
            remove_with_journal(new)
            with closing(runtime.connect(new)) as connection:
                connection.executescript(_TABLE + f"PRAGMA user_version = {VERSION};")
                with connection:
                    connection.executemany(_INSERT, entries)
            # A journal of the old index would be applied to the new one.
            self.path.with_name(self.path.name + JOURNAL).unlink(missing_ok=True)
            runtime.replace(new, self.path)

    def _select(self, which: str, *values: object) -> "builtins.list[IndexEntry]":
        """Captures selected by a clause, after adding those that could not be added before."""
        if self._kept_out:
            with suppress(StorageError):
                self._enter_kept_out()
        query = f"SELECT * FROM captures {which}"  # noqa: S608 - constants
        return self._use(lambda connection: _entries_of(connection, query, *values))

    def _enter_kept_out(self) -> None:
        # A running rebuild may have missed these files, and would overwrite what is written to the index now.
        if self._rebuilding:
            return
        paths = sorted(self._kept_out)
        entries = [entry_of(path) for path in paths if os.path.lexists(path)]
        self._change(lambda connection: connection.executemany(_INSERT, entries))
        self._kept_out.difference_update(paths)
        for entry in entries:
            self._changed(entry.id)

    def _change(self, act: Callable[[sqlite3.Connection], object]) -> None:
        """Changes the index, but not while it is being replaced."""
        self._use(act, self._changing)

    def _use(
        self, act: Callable[[sqlite3.Connection], T], held: AbstractContextManager[object] = _NOTHING
    ) -> T:
        """Runs `act` in a transaction, and again if the index had to be rebuilt first."""
        self._check()
        try:
            with held:
                return self._attempt(act)
        except Unusable as reason:
            self._heal(reason)
        try:
            with held:
                return self._attempt(act)
        except Unusable as reason:
            raise self._error(reason) from reason

    def _attempt(self, act: Callable[[sqlite3.Connection], T]) -> T:
        try:
            if read_header(self.path).user_version != VERSION:
                raise Unusable("it is of another version")
            with closing(open_tables(self.path, _TABLE)) as connection, connection:
                connection.execute("BEGIN")
                return act(connection)
        except FileNotFoundError as error:
            raise Unusable("it is gone") from error
        except ValueError as error:
            raise Unusable(f"{error}") from error
        except (sqlite3.Error, OSError) as error:
            if getattr(error, "sqlite_errorcode", 0) == sqlite3.SQLITE_INTERRUPT:
                check_patience(self.path.name)
            if isinstance(error, sqlite3.DatabaseError) and (
                is_damaged(error, self.path) or not self.path.exists()
            ):
                raise Unusable(f"{error}" if self.path.exists() else "it is gone") from error
            raise self._error(error) from error

    def _error(self, error: Exception) -> StorageError:
        return StorageError(
            f"{self.path.name} cannot be used: {error}",
            "make room or fix the disk; captures continue, and the index is rebuilt automatically",
        )


def _entries_of(connection: sqlite3.Connection, query: str, *values: object) -> list[IndexEntry]:
    return [_entry(row) for row in connection.execute(query, values)]


def _entry(row: tuple[Any, ...]) -> IndexEntry:
    entry = IndexEntry(*row)
    try:
        check_entry(entry)
    except (ValueError, TypeError, AttributeError) as error:
        raise Unusable(f"{error}") from error
    return entry


def _set_aside(reading: Reading) -> bool:
    """Sets a damaged file aside; returns False if that fails."""
    try:
        set_aside(reading.path, reading.entry.reason)
    except StorageError:
        return False
    return True


class IndexKeeper:
    """Rebuilds the index in a separate thread; requests wait for it for a short time.

    Args:
        index: The index.
        unsealed: Returns the `.grab.part` files that could not be sealed.
        faults: Board for reporting rebuilds and failures.
        now_s: Source of monotonic time.

    Attributes:
        rebuilt: Number of rebuilds since the start.
    """

    def __init__(
        self,
        index: CaptureIndex,
        unsealed: Callable[[], Iterable[Path]],
        faults: FaultBoard,
        now_s: Callable[[], float] = runtime.monotonic,
    ) -> None:
        self.rebuilt = 0
        self._index = index
        self._unsealed = unsealed
        self._faults = faults
        self._now_s = now_s
        self._lock = runtime.lock()
        self._done: runtime.Event | None = None
        self._failure: StorageError | None = None
        self._not_before_s = 0.0

    def heal(self, reason: Unusable, patience_s: float = PATIENCE_S) -> None:
        """Returns when the index has been rebuilt.

        Raises:
            IndexRebuilding: The rebuild takes longer than `patience_s`.
            StorageError: The rebuild has failed, now or within the last `PAUSE_S`.
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

    def _started(self, reason: Unusable) -> runtime.Event:
        with self._lock:
            if self._done is not None and not self._done.is_set():
                return self._done
            if self._failure is not None and self._now_s() < self._not_before_s:
                raise self._failure
            self._done = runtime.event()
            self._faults.report(
                Cause.INDEX_REBUILDING,
                f"{self._index.path.name} is unusable ({reason}) and is being rebuilt from the captures",
                "nothing is lost, and captures go on; the list is there again in a moment",
                "warning",
            )
            runtime.Thread(target=self._rebuild, args=(self._done,), name="index", daemon=True).start()
            return self._done

    def _rebuild(self, done: runtime.Event) -> None:
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
