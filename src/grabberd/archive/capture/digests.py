"""Digests of a capture's content, which reveal whatever the disk has changed, and rows checked by them.

Every row of the tables `fields`, `points` and `readings` has its own digest, so a flipped bit costs only one
row: a field in format 1, half a second of fields in format 2. The digests are in the table `meta`, one row
for each commit, written in the same transaction as the data; earlier versions ignore unknown keys there.
Everything else is covered by two kinds of digests written at the end: `digest.sealed` for metadata, ledger
and channels, and `digest.run.N` for a run.
"""

import json
import sqlite3
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from hashlib import blake2b
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from grabberd.archive.capture.meta import coverage_key, write_meta
from grabberd.archive.capture.schema import DAMAGE, WITH_CHANNELS, format_of, reading_errors
from grabberd.errors import CaptureFileError
from grabberd.files.reading import check_patience, read_json

FORM_KEY, FORM = "digests", 1
"""Key and value in files with digests, from the first commit on."""
SEALED_KEY = "digest.sealed"
FIELDS = "digest.fields."
READINGS = "readings of "
"""Prefix of the name of a damaged group of readings, before the name of its channel."""
CHANGED = "it is not what was written: its digest differs"
MISSING = "it is missing"
_ROW_BYTES, _REST_BYTES = 8, 32
"""Sizes of digests. They detect accidents, not forgery, so 64 bits are plenty for one row."""
_OF_META = """SELECT key, value FROM meta WHERE key <> 'digest.sealed' AND key NOT GLOB 'digest.run.*'
    AND key NOT GLOB 'digest.points.*' AND key NOT GLOB 'coverage.*' ORDER BY key"""
_OF_LEDGER = "SELECT * FROM ledger ORDER BY first_n"
_OF_COPY = "SELECT data FROM reserve"
_OF_CHANNELS = "SELECT * FROM channels ORDER BY channel"
_RUN_ROW = "SELECT * FROM runs WHERE run = ?"
_RUN_META = "SELECT key, value FROM meta WHERE key = ? OR key BETWEEN ? AND ? ORDER BY key"
_SAID = 5
_RUN_KEYS = "SELECT key FROM meta WHERE key GLOB 'digest.run.*'"
_FIRST, _LAST = 0, 10**10 - 1
_BETWEEN = """SELECT value FROM meta WHERE key BETWEEN
    coalesce((SELECT max(key) FROM meta WHERE key BETWEEN :first AND :begin), :first) AND :end"""

Row = tuple[Any, ...]


class Damage(NamedTuple):
    """A damaged row, which is skipped.

    Attributes:
        what: "field", "points", "points of run N" or "readings of NAME".
        n: Number of the field, or of the group of readings.
        reason: What is wrong with it.
    """

    what: str
    n: int
    reason: str

    @property
    def in_words(self) -> str:
        """A sentence for people."""
        counted = "group" if self.what.startswith(READINGS) else "field"
        subject = self.what if self.what == counted else f"{self.what}, {counted}"
        return f"{subject} {self.n}: {self.reason}"


def left_out_in_words(left_out: Sequence[Damage]) -> list[str]:
    """Sentences about damaged rows, at most the first few."""
    said = [f"left out: {one.in_words}" for one in left_out[:_SAID]]
    more = len(left_out) - len(said)
    return [*said, f"left out: {more} more; grabberd storage verify lists them"] if more else said


def points_prefix(run: int) -> str:
    """Prefix of the keys of a run's digests of points."""
    return f"digest.points.{run:07d}."


def readings_prefix(channel: int) -> str:
    """Prefix of the keys of a channel's digests of readings."""
    return f"digest.readings.{channel:07d}."


def row_digest(row: Sequence[Any]) -> str:
    """The digest of a row: all cells but the last as a JSON array, followed by the last, its data."""
    *cells, data = row
    head = json.dumps(cells, separators=(",", ":"), ensure_ascii=False).encode()
    return blake2b(head + data, digest_size=_ROW_BYTES).hexdigest()


def check_row(row: Sequence[Any], digest: str | None) -> None:
    """Checks a row against its digest.

    Raises:
        ValueError: The digest differs.
        TypeError: The row's data are not bytes.
    """
    if row_digest(row) != digest:
        raise ValueError(CHANGED)


def write_row_digests(connection: sqlite3.Connection, prefix: str, digests: Mapping[int, str]) -> None:
    """Writes digests of rows, by n, within the transaction that adds the rows."""
    if digests:
        write_meta(connection, {_key(prefix, min(digests)): digests})


def read_row_digests(
    connection: sqlite3.Connection, prefix: str, first_n: int = _FIRST, last_n: int = _LAST
) -> dict[int, str]:
    """Digests of the rows with first_n ≤ n ≤ last_n, by n.

    Raises:
        ValueError: The digests are damaged.
    """
    ends = {"first": _FIRST, "begin": first_n, "end": min(last_n, _LAST)}
    keys = {name: _key(prefix, n) for name, n in ends.items()}
    found: dict[int, str] = {}
    for (value,) in connection.execute(_BETWEEN, keys):
        found.update((int(n), digest) for n, digest in read_json(value).items())
    return {n: digest for n, digest in found.items() if first_n <= n <= last_n}


def has_digests(connection: sqlite3.Connection) -> bool:
    """True if a file has digests of the known form."""
    row = connection.execute("SELECT value FROM meta WHERE key = ?", (FORM_KEY,)).fetchone()
    return row is not None and row[0] == str(FORM)


def write_sealed_digest(connection: sqlite3.Connection) -> None:
    """Writes the digests of metadata, ledger and runs, as the last change of the transaction that seals."""
    if not has_digests(connection):
        return  # started by an earlier version that crashed
    for (run,) in connection.execute("SELECT run FROM runs").fetchall():
        write_run_digest(connection, run)
    write_meta(connection, {SEALED_KEY: _sealed(connection)})


def write_run_digest(connection: sqlite3.Connection, run: int) -> None:
    """Writes the digest of a run, as the last change of the transaction that adds it."""
    if has_digests(connection):
        write_meta(connection, {_run_key(run): _run(connection, run)})


def changed_parts(connection: sqlite3.Connection, runs: Collection[int] | None = None) -> list[str]:
    """Names of the changed parts of a sealed file, apart from fields and points.

    Args:
        connection: A connection to the file.
        runs: The runs to check; None: all.

    Raises:
        ValueError: A digest is damaged.
    """
    if not has_digests(connection):
        return []
    sealed = _stored(connection, SEALED_KEY)
    if not isinstance(sealed, dict):
        return ["the digest of its metadata and ledger"]
    now = _sealed(connection)
    changed = [f"its {part}" for part in now | sealed if sealed.get(part) != now.get(part)]
    there = {run for (run,) in connection.execute("SELECT run FROM runs")}
    listed = {int(key[-7:]) for (key,) in connection.execute(_RUN_KEYS)}
    for run in sorted(there | listed if runs is None else set(runs)):
        if _stored(connection, _run_key(run)) != _run(connection, run):
            changed.append(f"run {run}")
    return changed


def forget_points_after(connection: sqlite3.Connection, run: int) -> None:
    """Removes the digests of points of all runs beyond `run`, which were never completed."""
    between = (points_prefix(run + 1), "digest.points/")  # the character after the dot
    connection.execute("DELETE FROM meta WHERE key >= ? AND key < ?", between)


def _key(prefix: str, n: int) -> str:
    # Padded, so that keys sort like numbers.
    return f"{prefix}{max(n, 0):010d}"


def _run_key(run: int) -> str:
    return f"digest.run.{run:07d}"


def _stored(connection: sqlite3.Connection, key: str) -> Any:
    row = connection.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
    return None if row is None else read_json(row[0])


def _sealed(connection: sqlite3.Connection) -> dict[str, str]:
    parts = {"metadata": _OF_META, "ledger": _OF_LEDGER}
    if format_of(connection) == WITH_CHANNELS:
        parts["channels"] = _OF_CHANNELS
    if connection.execute("SELECT count(*) FROM reserve").fetchone()[0]:  # no copy in files of before
        parts["copy of its first metadata"] = _OF_COPY
    return {part: _digest(connection.execute(query)) for part, query in parts.items()}


def _run(connection: sqlite3.Connection, run: int) -> str:
    prefix = points_prefix(run)
    keys = (coverage_key(run), _key(prefix, _FIRST), _key(prefix, _LAST))
    rows = connection.execute(_RUN_ROW, (run,)).fetchall()
    return _digest([*rows, *connection.execute(_RUN_META, keys)])


def _digest(rows: Iterable[Row]) -> str:
    """The digest of rows as JSON arrays, one per line."""
    digest = blake2b(digest_size=_REST_BYTES)
    for row in rows:
        digest.update(json.dumps(row, separators=(",", ":"), ensure_ascii=False).encode() + b"\n")
    return digest.hexdigest()


T = TypeVar("T")
FIELDS_AT_ONCE = 50
"""Fields read under one lock: the writer commits twice a second, and cannot while a reader's statement is
open."""
BYTES_AT_ONCE = 32 << 20
"""Size of the pictures at which a batch ends, and with it the lock."""
END = 2**62
"""A number greater than that of any field."""


class Kind(NamedTuple):
    """A kind of rows.

    Attributes:
        what: Name of the kind for messages.
        fetch: Fetches a batch of rows in the order of their keys, with `first` ≤ key < `end`.
        stored: Returns the form of a row that its digest covers.
        key: Number of a row's field, or of its first.
        lost: Numbers of the fields that are lost with the row whose key is `first`; None: only that field.
        whole: True if the query selects every row.
    """

    what: str
    fetch: Callable[[sqlite3.Connection, Mapping[str, int]], Sequence[Any]]
    stored: Callable[[Any], Row] = lambda row: row
    key: Callable[[Any], int] = lambda row: row[0]
    lost: Callable[[sqlite3.Connection, Mapping[str, int]], list[int]] | None = None
    whole: bool = True


def query_rows(query: str) -> Callable[[sqlite3.Connection, Mapping[str, int]], list[Row]]:
    """Fetches the rows of a query, at most `:some`."""
    return lambda connection, values: some_rows(connection.execute(query, {**values, "some": FIELDS_AT_ONCE}))


class CheckedRows:
    """Reads rows of a capture file.

    Args:
        path: The file.
        connection: A connection to it in autocommit mode.
        left_out: Collects damaged rows, which are skipped; None: a damaged row is an error.

    Attributes:
        left_out: See above.
        has_digests: False for files of earlier versions.
    """

    def __init__(
        self, path: Path, connection: sqlite3.Connection, left_out: list[Damage] | None = None
    ) -> None:
        self.left_out = left_out
        self._path = path
        self._connection = connection
        with reading_errors(path):
            self.has_digests = has_digests(connection)

    def each(
        self,
        kind: Kind,
        prefix: str,
        decode: Callable[[Any], T],
        first_n: int = 0,
        end_n: int = END,
        wanted_from: int = 0,
        **values: int,
    ) -> Iterator[T]:
        """Decoded rows with first_n ≤ key < end_n, in order.

        Args:
            kind: Kind of the rows.
            prefix: Prefix of the keys of their digests.
            decode: Decodes a row; raises one of `DAMAGE` if it is damaged.
            first_n: Number of the first field.
            end_n: Number after the last.
            wanted_from: Number of the first requested field; damage before it is ignored.
            values: Further parameters of the query.

        Raises:
            CaptureFileError: A row is damaged or missing, and damaged rows are not skipped.
            StorageError: The file cannot be read now.
            ReadingGivenUp: The reading was cancelled.
        """
        while True:
            check_patience(self._path.name)
            limits = {**values, "first": first_n, "end": end_n}
            rows, digests = self._some(kind, prefix, limits)
            keys = [kind.key(row) for row in rows]
            damages = _Damages(kind, limits, wanted_from, sorted({*keys, *digests}))
            yield from self._sound(damages, dict(zip(keys, rows, strict=True)), digests, decode)
            if not rows:
                return
            if keys[-1] < first_n:  # a damaged tree, which would be read for ever
                raise self._error(Damage(kind.what, keys[-1], f"it stands behind field {first_n}"))
            first_n = keys[-1] + 1

    def _sound(
        self,
        damages: "_Damages",
        rows: Mapping[int, Any],
        digests: Mapping[int, str],
        decode: Callable[[Any], T],
    ) -> Iterator[T]:
        """Decodes rows, by their keys, and skips those that are damaged or missing."""
        for key, row in rows.items():
            try:
                decoded = self._decoded(damages.kind, row, digests.get(key), decode)
            except DAMAGE as error:
                self._leave_out(damages, key, f"{error}", error)
            else:
                yield decoded
        if damages.kind.whole:
            for key in sorted(set(digests) - set(rows)):
                self._leave_out(damages, key, MISSING)

    def _some(
        self, kind: Kind, prefix: str, values: Mapping[str, int]
    ) -> tuple[Sequence[Any], Mapping[int, str]]:
        """A batch of rows, and the digests up to the last of them, or to the end if the batch is empty."""
        first_n, end_n = values["first"], values["end"]
        with reading_errors(self._path), self._connection:
            # One snapshot for both: rows committed in between would appear to be missing.
            self._connection.execute("BEGIN")
            rows = kind.fetch(self._connection, values)
            if not self.has_digests:
                return rows, {}
            last_n = kind.key(rows[-1]) if rows else end_n - 1
            return rows, read_row_digests(self._connection, prefix, first_n, last_n)

    def _decoded(self, kind: Kind, row: Any, digest: str | None, decode: Callable[[Any], T]) -> T:
        if self.has_digests:
            check_row(kind.stored(row), digest)
        return decode(row)

    def _leave_out(self, damages: "_Damages", key: int, reason: str, error: Exception | None = None) -> None:
        with reading_errors(self._path):
            found = damages.of(self._connection, key, reason)
        if found and self.left_out is None:
            raise self._error(found[0]) from error
        if self.left_out is not None:
            self.left_out += found

    def _error(self, damage: Damage) -> CaptureFileError:
        hint = "all others can be read; grabberd storage verify shows what else is damaged"
        return CaptureFileError(f"{self._path}: {damage.in_words}", hint)


class _Damages(NamedTuple):
    """Fields that are lost with damaged rows."""

    kind: Kind
    limits: Mapping[str, int]
    wanted_from: int
    keys: Sequence[int]

    def of(self, connection: sqlite3.Connection, key: int, reason: str) -> list[Damage]:
        """The requested fields that are lost with one row."""
        lost = [key]
        if self.kind.lost is not None:
            following = bisect_right(self.keys, key)
            end = self.keys[following] if following < len(self.keys) else self.limits["end"]
            lost = self.kind.lost(connection, {**self.limits, "first": key, "end": end}) or lost
        return [Damage(self.kind.what, n, reason) for n in lost if self.wanted_from <= n < self.limits["end"]]


def some_rows(cursor: sqlite3.Cursor) -> list[tuple[Any, ...]]:
    """The first rows of a query, until they exceed `BYTES_AT_ONCE`."""
    taken: list[tuple[Any, ...]] = []
    size = 0
    with closing(cursor):  # releases its lock
        for row in cursor:
            taken.append(row)
            size += sum(len(cell) for cell in row if isinstance(cell, bytes))
            if size > BYTES_AT_ONCE:
                break
    return taken
