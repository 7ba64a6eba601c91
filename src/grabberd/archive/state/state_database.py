"""`state.sqlite`, which cannot be rebuilt from captures: its schema by version, one transaction per call.

Its stores: settings, annotations of captures (pins, notes, labels, marks), tokens and sessions, answers to
requests that must take effect only once, and summaries that await acknowledgement by a receiver.
"""

import json
import sqlite3
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from grabberd import runtime
from grabberd.archive.guarded_database import JOURNAL
from grabberd.errors import Conflict, NotFound, StorageError
from grabberd.files.disk import OWNER_ONLY, is_damaged, storage_errors, sync_directory

Migrations = tuple[tuple[str, ...], ...]
MIGRATIONS: Migrations = (
    ("CREATE TABLE IF NOT EXISTS settings (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID",),
    (
        """CREATE TABLE tokens (
            name TEXT PRIMARY KEY, role TEXT NOT NULL CHECK (role IN ('viewer', 'operator', 'admin')),
            hash BLOB NOT NULL UNIQUE, created_utc TEXT NOT NULL) WITHOUT ROWID""",
        """CREATE TABLE sessions (
            hash BLOB PRIMARY KEY, token TEXT NOT NULL REFERENCES tokens (name) ON DELETE CASCADE,
            created_utc TEXT NOT NULL, expires_utc TEXT NOT NULL) WITHOUT ROWID""",
    ),
    (
        """CREATE TABLE annotations (
            capture TEXT PRIMARY KEY, pinned INTEGER NOT NULL, note TEXT, labels TEXT) WITHOUT ROWID""",
        """CREATE TABLE idempotency (
            key TEXT PRIMARY KEY, digest BLOB NOT NULL, created_utc TEXT NOT NULL, status INTEGER,
            location TEXT, body BLOB NOT NULL DEFAULT x'') WITHOUT ROWID""",
    ),
    ("ALTER TABLE tokens ADD COLUMN expires_utc TEXT",),
    (
        "CREATE TABLE outbox (capture TEXT PRIMARY KEY, summary TEXT) WITHOUT ROWID",
        "CREATE INDEX outbox_waiting ON outbox (capture) WHERE summary IS NOT NULL",
    ),
    (
        """CREATE TABLE profiles (
            kind TEXT NOT NULL, name TEXT NOT NULL, version INTEGER NOT NULL CHECK (version >= 1),
            created_utc TEXT NOT NULL, sha256 TEXT NOT NULL, content TEXT NOT NULL,
            PRIMARY KEY (kind, name, version)) WITHOUT ROWID""",
        """CREATE TABLE retired_profiles (
            kind TEXT NOT NULL, name TEXT NOT NULL, retired_utc TEXT NOT NULL,
            PRIMARY KEY (kind, name)) WITHOUT ROWID""",
    ),
    ("ALTER TABLE annotations ADD COLUMN marks TEXT",),
)
"""Entry n migrates from version n to n + 1. Released entries never change; new ones are appended."""
TIMEOUT_S = 10.0
SESSIONS_A_TOKEN = 32
"""Maximum number of sessions per token; beyond it, the oldest end."""
STAMP = "%Y%m%dT%H%M%S%fZ"
"""Format of a time in a file name."""
GUARDED = "guarded"
"""Key of the settings: tokens were lost, so access requires a token until a new one is added."""
ASIDE = "damaged-"
"""Prefix of the time in the name of a database that was set aside."""


def tables_of(version: int, migrations: Migrations = MIGRATIONS) -> str:
    """The statements that create the tables of a version.

    Raises:
        ValueError: The version does not exist.
    """
    if version not in range(1, len(migrations) + 1):
        raise ValueError(f"its version is {version}")
    return ";".join(statement for statements in migrations[:version] for statement in statements)


def copy_of(path: Path, mode: str) -> bytes:
    """A consistent copy of a database, even while it is being written.

    Args:
        path: The file.
        mode: "rw" if an interrupted transaction may be rolled back, otherwise "ro".

    Raises:
        sqlite3.Error: The database is damaged, or cannot be read.
    """
    uri = f"{path.absolute().as_uri()}?mode={mode}"
    with closing(runtime.connect(uri, uri=True)) as source, closing(runtime.connect(":memory:")) as copy:
        source.backup(copy)
        return copy.serialize()


def set_aside(path: Path, now: datetime) -> str | None:
    """Renames a database and its journal to a dated name; returns the name, None if the file is missing.

    Raises:
        StorageError: The files cannot be renamed.
    """
    aside = path.with_name(f"{path.name}.{ASIDE}{now.astimezone(UTC):{STAMP}}")
    with storage_errors(path):
        for end in (JOURNAL, ""):  # a remaining journal would be applied to the next database
            if (there := path.with_name(path.name + end)).exists():
                runtime.rename(there, aside.with_name(aside.name + end))
        sync_directory(path.parent)
        return aside.name if aside.exists() else None


class StateDatabase:
    """A database for any thread, and for several programs: each call has its own connection.

    The stores in `state.sqlite` are subclasses; a store in another file has its own migrations.

    Args:
        path: The file.
        heal: Recovers a file that seems damaged or missing, given the reason; None: that is an error.

    Attributes:
        migrations: The file's schema, version by version.

    Raises:
        StorageError: From any method of a store: the file cannot be read or written.
    """

    migrations: ClassVar[Migrations] = MIGRATIONS

    def __init__(self, path: Path, heal: Callable[[str], None] | None = None) -> None:
        self.path = path
        self._heal = heal

    def open(self) -> None:
        """Creates the file if necessary, readable by its owner alone, and migrates it to this version.

        May be called again, and by several programs at once.

        Raises:
            StorageError: The file cannot be written, is damaged, or is of a later version.
        """
        with self.errors():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            # Before SQLite creates it with the umask's permissions: it holds the tokens' hashes.
            self.path.touch(OWNER_ONLY)
        with self.errors(), closing(self._connect()) as connection, connection:
            _migrate(connection, self.path, self.migrations)

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """A connection with one transaction, which is rolled back on an error.

        Raises:
            StorageError: The file cannot be used.
        """
        with self.errors(), closing(self._opened()) as connection, connection:
            yield connection

    def execute(self, statement: str, *values: Any) -> list[tuple[Any, ...]]:
        """Runs one statement in its own transaction; returns its rows.

        Raises:
            StorageError: The file cannot be used.
        """
        with self.transaction() as connection:
            return connection.execute(statement, values).fetchall()

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Translates errors with the file to `StorageError`, whose text an operator can act on."""
        try:
            yield
        except (sqlite3.Error, OSError, ValueError) as error:
            if isinstance(error, sqlite3.Error) and self._heal is not None and self._is_lost(error):
                self._heal(str(error))
                again = f"{self.path.name} was damaged ({error}) and has been recovered"
                raise StorageError(again, "try again; GET /api/v1/state says what was lost") from error
            raise StorageError(
                f"{self.path.name} cannot be used: {error}",
                "make room, fix the disk, or restore its latest backup",
            ) from error

    def _opened(self) -> sqlite3.Connection:
        """A connection to the file, after recovering it if necessary."""
        try:
            return self._checked()
        except sqlite3.Error as error:
            if self._heal is None or not self._is_lost(error):
                raise
            self._heal(str(error))
            return self._checked()

    def _checked(self) -> sqlite3.Connection:
        connection = self._connect()
        try:
            if self._heal is not None and not connection.execute("PRAGMA user_version").fetchone()[0]:
                raise _Empty("it is empty")
        except BaseException:
            connection.close()
            raise
        return connection

    def _connect(self) -> sqlite3.Connection:
        # Without the mode, SQLite would create one that is missing.
        uri = f"{self.path.absolute().as_uri()}?mode=rw"
        connection = runtime.connect(uri, uri=True, timeout=TIMEOUT_S)
        connection.execute("PRAGMA foreign_keys = ON")  # else sessions of a removed token would stay valid
        connection.execute("PRAGMA synchronous = EXTRA")  # else a power cut may bring back a deleted journal
        return connection

    def _is_lost(self, error: sqlite3.Error) -> bool:
        return isinstance(error, _Empty) or is_damaged(error, self.path) or not self.path.exists()


class _Empty(sqlite3.DatabaseError):
    """The file is empty, so it is not the one that was opened at the start."""


def _migrate(connection: sqlite3.Connection, path: Path, migrations: Migrations) -> None:
    # The write lock is taken before the version is read: another program may be migrating right now.
    connection.execute("BEGIN IMMEDIATE")
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if version > len(migrations):
        known = f"this program knows up to {len(migrations)}"
        raise StorageError(f"{path.name} is of version {version}, {known}", "use a newer grabberd")
    for statements in migrations[version:]:
        for statement in statements:
            connection.execute(statement)
    connection.execute(f"PRAGMA user_version = {len(migrations):d}")


class StateStore(StateDatabase):
    """The settings in `state.sqlite`: a JSON value for each key."""

    def get(self, key: str) -> Any:
        """The value of a key; None if there is none."""
        with self.errors():
            rows = self.execute("SELECT value FROM settings WHERE key = ?", key)
            return json.loads(rows[0][0]) if rows else None

    def put(self, values: Mapping[str, Any]) -> None:
        """Writes keys, all or none of them."""
        rows = [(key, json.dumps(value, ensure_ascii=False)) for key, value in values.items()]
        with self.transaction() as connection:
            connection.executemany("INSERT OR REPLACE INTO settings VALUES (?, ?)", rows)

    def remove(self, key: str) -> None:
        """Removes a key, if it exists."""
        self.execute("DELETE FROM settings WHERE key = ?", key)


@dataclass(frozen=True, slots=True)
class Annotation:
    """Annotation of one capture.

    Attributes:
        pinned: True if retention must not remove the capture.
        note: Replacement for the note in the file; None to use that.
        labels: Replacement for the labels in the file; None to use those.
        marks: Names of marked fields, by number.
    """

    pinned: bool = False
    note: str | None = None
    labels: Mapping[str, str] | None = None
    marks: Mapping[int, str] = field(default_factory=dict)


_QUERY = "SELECT capture, pinned, note, labels, marks FROM annotations"


class AnnotationStore(StateDatabase):
    """The annotations in `state.sqlite`."""

    def get(self, capture_id: str) -> Annotation:
        """The annotation of a capture; an empty one by default."""
        with self.errors():
            rows = self.execute(f"{_QUERY} WHERE capture = ?", capture_id)
            return _annotation(rows[0]) if rows else Annotation()

    def all(self) -> dict[str, Annotation]:
        """All annotations by capture id."""
        with self.errors():
            return {row[0]: _annotation(row) for row in self.execute(_QUERY)}

    def put(self, capture_id: str, annotation: Annotation) -> None:
        """Replaces the annotation of a capture."""
        labels = None if annotation.labels is None else json.dumps(dict(annotation.labels))
        marks = json.dumps(dict(annotation.marks)) if annotation.marks else None
        row = (capture_id, annotation.pinned, annotation.note, labels, marks)
        self.execute("INSERT OR REPLACE INTO annotations VALUES (?, ?, ?, ?, ?)", *row)

    def remove(self, capture_id: str) -> None:
        """Removes the annotation of a capture, if there is one."""
        self.execute("DELETE FROM annotations WHERE capture = ?", capture_id)


def _annotation(row: tuple[Any, ...]) -> Annotation:
    _, pinned, note, labels, marks = row
    named = {int(n): name for n, name in json.loads(marks or "{}").items()}
    return Annotation(bool(pinned), note, None if labels is None else json.loads(labels), named)


class TokenRow(NamedTuple):
    """A token without its secret, with the number of its active sessions.

    Attributes:
        expires_utc: Expiry; None: valid until it is removed.
    """

    name: str
    role: str
    created_utc: str
    sessions: int
    expires_utc: str | None = None


class Holder(NamedTuple):
    """Holder of a token or of a session.

    Attributes:
        name: Name of the token.
        role: Role of the token.
        expires_utc: Time when the token expires; None: never.
        ends_utc: Time when the session ends, which is never after that; None for a token.
    """

    name: str
    role: str
    expires_utc: str | None = None
    ends_utc: str | None = None


class TokenStore(StateDatabase):
    """The tokens and sessions in `state.sqlite`. Times are ISO 8601 UTC in one format: they sort as text."""

    def add(
        self, name: str, role: str, token_hash: bytes, created_utc: str, expires_utc: str | None = None
    ) -> None:
        """Stores a token.

        Raises:
            Conflict: A token with that name already exists.
        """
        with self.transaction() as connection:
            if connection.execute("SELECT 1 FROM tokens WHERE name = ?", (name,)).fetchone():
                raise Conflict(
                    f"token {name!r} exists already",
                    f"choose another name, or remove the old one first: grabberd token remove {name}",
                )
            connection.execute("DELETE FROM settings WHERE key = ?", (GUARDED,))
            connection.execute(
                "INSERT INTO tokens (name, role, hash, created_utc, expires_utc) VALUES (?, ?, ?, ?, ?)",
                (name, role, token_hash, created_utc, expires_utc),
            )

    def remove(self, name: str) -> None:
        """Removes a token and all its sessions.

        Raises:
            NotFound: No token has that name.
        """
        with self.transaction() as connection:
            if not connection.execute("DELETE FROM tokens WHERE name = ?", (name,)).rowcount:
                raise NotFound(f"no token {name!r}", "grabberd token list shows the existing tokens")

    def list(self, now_utc: str) -> list[TokenRow]:
        """All tokens, sorted by name."""
        query = (
            "SELECT name, role, created_utc, (SELECT count(*) FROM sessions "
            "WHERE token = name AND sessions.expires_utc > ?), expires_utc FROM tokens ORDER BY name"
        )
        return [TokenRow(*row) for row in self.execute(query, now_utc)]

    def guards(self) -> bool:
        """True if there is any token, even an expired one, or tokens may have been lost."""
        return bool(
            self.execute(
                "SELECT 1 FROM tokens UNION ALL SELECT 1 FROM settings WHERE key = ? LIMIT 1", GUARDED
            )
        )

    def of_token(self, token_hash: bytes) -> Holder | None:
        """Holder of a token, expired or not."""
        return self._holder("SELECT name, role, expires_utc FROM tokens WHERE hash = ?", token_hash)

    def of_session(self, session_hash: bytes, now_utc: str) -> Holder | None:
        """Holder of the token behind a session, if neither has expired."""
        query = (
            "SELECT name, role, tokens.expires_utc, "
            "min(sessions.expires_utc, ifnull(tokens.expires_utc, sessions.expires_utc)) "
            "FROM sessions JOIN tokens ON token = name "
            "WHERE sessions.hash = ?1 AND sessions.expires_utc > ?2 "
            "AND (tokens.expires_utc IS NULL OR tokens.expires_utc > ?2)"
        )
        return self._holder(query, session_hash, now_utc)

    def add_session(self, session_hash: bytes, token: str, now_utc: str, expires_utc: str) -> None:
        """Stores a session, and removes expired ones.

        Raises:
            NotFound: The token has been removed.
        """
        with self.transaction() as connection:
            if not connection.execute("SELECT 1 FROM tokens WHERE name = ?", (token,)).fetchone():
                raise NotFound(f"no token {token!r}", "it has just been removed; ask for another")
            connection.execute(
                "INSERT INTO sessions VALUES (?, ?, ?, ?)", (session_hash, token, now_utc, expires_utc)
            )
            connection.execute("DELETE FROM sessions WHERE expires_utc <= ?", (now_utc,))
            connection.execute(
                "DELETE FROM sessions WHERE token = ? AND hash NOT IN (SELECT hash FROM sessions "
                "WHERE token = ? ORDER BY created_utc DESC, hash LIMIT ?)",
                (token, token, SESSIONS_A_TOKEN),
            )

    def remove_session(self, session_hash: bytes) -> None:
        """Ends a session, if it exists."""
        self.execute("DELETE FROM sessions WHERE hash = ?", session_hash)

    def _holder(self, query: str, *values: object) -> Holder | None:
        rows = self.execute(query, *values)
        return Holder(*rows[0]) if rows else None


class KeptAnswer(NamedTuple):
    """The answer to a request with a key.

    Attributes:
        digest: Digest of the request.
        status: HTTP status; None while the request is unanswered.
        location: Header `Location` of the answer.
        body: Body of the answer.
    """

    digest: bytes
    status: int | None = None
    location: str | None = None
    body: bytes = b""


class IdempotencyStore(StateDatabase):
    """The keys in `state.sqlite`. Times are ISO 8601 UTC in one format: they sort as text."""

    def begin(self, key: str, digest: bytes, now_utc: str, oldest_utc: str) -> KeptAnswer | None:
        """Stores a key unless it exists, and drops keys older than `oldest_utc`; returns what was stored."""
        with self.transaction() as connection:
            connection.execute("DELETE FROM idempotency WHERE created_utc < ?", (oldest_utc,))
            row = connection.execute(
                "SELECT digest, status, location, body FROM idempotency WHERE key = ?", (key,)
            ).fetchone()
            if row is not None:
                return KeptAnswer(*row)
            connection.execute(
                "INSERT INTO idempotency (key, digest, created_utc) VALUES (?, ?, ?)", (key, digest, now_utc)
            )
            return None

    def finish(self, key: str, answer: KeptAnswer) -> None:
        """Stores the answer."""
        change = "UPDATE idempotency SET status = ?, location = ?, body = ? WHERE key = ?"
        self.execute(change, answer.status, answer.location, answer.body, key)

    def forget(self, key: str) -> None:
        """Removes a key whose request had no effect, so that it may be sent again."""
        self.execute("DELETE FROM idempotency WHERE key = ?", key)


class Outbox(StateDatabase):
    """Captures in `state.sqlite` whose summaries are to be sent, each kept until it is acknowledged.

    An acknowledged capture stays without its summary, so that it is not sent again.
    """

    def entered(self) -> set[str]:
        """Ids of all captures, acknowledged or not."""
        return {capture_id for (capture_id,) in self.execute("SELECT capture FROM outbox")}

    def enter(self, capture_id: str, summary: Mapping[str, Any]) -> None:
        """Stores a summary until it is acknowledged; does not replace an earlier one of the capture."""
        document = json.dumps(summary, ensure_ascii=False)
        self.execute("INSERT OR IGNORE INTO outbox VALUES (?, ?)", capture_id, document)

    def waiting(self) -> int:
        """Number of summaries that are not acknowledged."""
        return int(self.execute("SELECT count(*) FROM outbox WHERE summary IS NOT NULL")[0][0])

    def first(self) -> tuple[str, dict[str, Any]] | None:
        """The first waiting capture, by id, and its summary; None if none is waiting."""
        query = "SELECT capture, summary FROM outbox WHERE summary IS NOT NULL ORDER BY capture LIMIT 1"
        return next(((capture_id, json.loads(text)) for capture_id, text in self.execute(query)), None)

    def acknowledge(self, capture_id: str) -> None:
        """Drops a summary that was received."""
        self.execute("UPDATE outbox SET summary = NULL WHERE capture = ?", capture_id)

    def forget(self, captures: Collection[str]) -> None:
        """Removes captures that no longer exist, except those whose summary is waiting."""
        with self.transaction() as connection:
            connection.executemany(
                "DELETE FROM outbox WHERE capture = ? AND summary IS NULL", [(one,) for one in captures]
            )
