"""The jobs on disk, in their own database, so that they survive any end of the daemon.

    jobs/queue.sqlite           the jobs, and which captures could not be analysed and why
    jobs/queue.sqlite.damaged-… one that was damaged, kept as it was found

It is not part of `state.sqlite` or of any backup: a restored queue would repeat jobs that are long done. A
damaged file is set aside and replaced by an empty queue.
"""

import sqlite3
from collections.abc import Callable, Iterable
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import ClassVar

from grabberd.archive.guarded_database import open_tables, read_header
from grabberd.archive.state.state_database import Migrations, StateDatabase, set_aside, tables_of
from grabberd.errors import StorageError
from grabberd.files.disk import is_damaged
from grabberd.work.job_rows import StoredJob, Unanalysed

FOLDER, QUEUE = "jobs", "queue.sqlite"
MIGRATIONS: Migrations = (
    (
        """CREATE TABLE jobs (
            number INTEGER PRIMARY KEY, kind TEXT NOT NULL, subject TEXT NOT NULL, automatic INTEGER NOT NULL,
            state TEXT NOT NULL, created_utc TEXT NOT NULL, ended_utc TEXT, attempts INTEGER NOT NULL,
            parameters TEXT, result TEXT, problem TEXT)""",
        """CREATE TABLE unanalysed (
            capture TEXT PRIMARY KEY, state TEXT NOT NULL, problem TEXT NOT NULL) WITHOUT ROWID""",
    ),
)
"""Like those of `state.sqlite`."""
_COLUMNS = 11


class JobStore(StateDatabase):
    """The tables in `queue.sqlite`: the jobs, and the captures that could not be analysed.

    Args:
        directory: State directory.
    """

    migrations: ClassVar[Migrations] = MIGRATIONS

    def __init__(self, directory: Path) -> None:
        super().__init__(directory / FOLDER / QUEUE, self._start_anew)
        self._lost: Callable[[str], None] = lambda what: None

    @property
    def folder(self) -> Path:
        """Folder of the queue."""
        return self.path.parent

    def open(self, lost: Callable[[str], None] = lambda what: None) -> None:
        """Opens the queue; a damaged one is set aside and replaced by an empty one, now or later.

        Args:
            lost: Called with what was lost and where it is kept, whenever a damaged queue was set aside.

        Raises:
            StorageError: It cannot be read or written now.
        """
        self._lost = lost
        if (reason := self._damage()) is not None:
            self._start_anew(reason)
        super().open()

    def jobs(self) -> list[StoredJob]:
        """All jobs in the order in which they were submitted."""
        with self.errors():
            rows = self.execute("SELECT * FROM jobs ORDER BY number")
            return [StoredJob(*row)._replace(automatic=bool(row[3])) for row in rows]

    def unanalysed(self) -> list[Unanalysed]:
        """The captures that could not be analysed."""
        with self.errors():
            return [Unanalysed(*row) for row in self.execute("SELECT * FROM unanalysed")]

    def put(
        self, *jobs: StoredJob, unanalysed: Iterable[Unanalysed] = (), analysed: Iterable[str] = ()
    ) -> None:
        """Writes the present state of jobs and the consequences for captures, all in one transaction.

        Args:
            jobs: The jobs; each replaces the row with its number.
            unanalysed: Captures that could not be analysed.
            analysed: Captures for which such a record is removed.
        """
        marks = ", ".join("?" * _COLUMNS)
        with self.transaction() as connection:
            connection.executemany(f"INSERT OR REPLACE INTO jobs VALUES ({marks})", jobs)  # noqa: S608 - marks alone
            connection.executemany("DELETE FROM unanalysed WHERE capture = ?", [(one,) for one in analysed])
            connection.executemany("INSERT OR REPLACE INTO unanalysed VALUES (?, ?, ?)", unanalysed)

    def remove(self, numbers: Iterable[int]) -> None:
        """Removes jobs."""
        with self.transaction() as connection:
            connection.executemany("DELETE FROM jobs WHERE number = ?", [(one,) for one in numbers])

    def forget_capture(self, capture_id: str) -> None:
        """Removes the record that a capture could not be analysed."""
        self.execute("DELETE FROM unanalysed WHERE capture = ?", capture_id)

    def _damage(self) -> str | None:
        """Reason why the file cannot be used; None if it can, or does not exist yet."""
        if not self.path.exists() or not self.path.stat().st_size:
            return None
        try:
            version = read_header(self.path).user_version
            if version > len(MIGRATIONS):
                return f"it is of version {version}, this program knows up to {len(MIGRATIONS)}"
            with closing(open_tables(self.path, tables_of(version, MIGRATIONS))) as connection:
                whole = str(connection.execute("PRAGMA quick_check").fetchone()[0])
                return None if whole == "ok" else whole
        except ValueError as error:
            return str(error)
        except (sqlite3.Error, OSError) as error:
            if isinstance(error, sqlite3.Error) and is_damaged(error, self.path):
                return str(error)
            raise StorageError(f"{QUEUE} cannot be read: {error}", "fix the disk, or its rights") from error

    def _start_anew(self, reason: str) -> None:
        """Sets the file aside and starts an empty queue."""
        aside = set_aside(self.path, datetime.now(UTC))  # the wall clock is only used for the file's name
        super().open()
        kept = f"; it is kept as {aside}" if aside else ""
        self._lost(f"{FOLDER}/{QUEUE} could not be used ({reason}){kept}")
