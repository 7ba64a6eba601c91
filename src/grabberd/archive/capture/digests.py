"""Digests of a capture's content, which reveal whatever the disk has changed.

Every row of the tables `fields`, `points` and `readings` has its own digest, so a flipped bit costs only one
row: a field in format 1, half a second of fields in format 2. The digests are in the table `meta`, one row
for each commit, written in the same transaction as the data; earlier versions ignore unknown keys there.
Everything else is covered by two kinds of digests written at the end: `digest.sealed` for metadata, ledger
and channels, and `digest.run.N` for a run.
"""

import json
import sqlite3
from collections.abc import Collection, Iterable, Mapping, Sequence
from hashlib import blake2b
from typing import Any, NamedTuple

from grabberd.archive.capture.meta import coverage_key, write_meta
from grabberd.archive.capture.schema import WITH_CHANNELS, format_of
from grabberd.files.json_value import read_json

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
    changed = [f"its {part}" for part in now if sealed.get(part) != now[part]]
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
