"""Saves what is whole of a capture whose file lacks a part, such as its end.

SQLite reads what is left of such a file; a row whose pages are missing is an error. The rows are read round
those, by their keys, and copied into a new file. In that one digests decide, group by group, what is whole,
or decoding does where a digest is lost: everything else is removed, and lost in the ledger.
"""

import itertools
import json
import sqlite3
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

from grabberd import runtime
from grabberd.archive.capture.content import PICTURE_GROUPS, POINT_GROUPS, WITHOUT_PICTURE
from grabberd.archive.capture.digests import (
    END,
    FIELDS,
    FORM_KEY,
    SEALED_KEY,
    Kind,
    changed_parts,
    has_digests,
    points_prefix,
    read_row_digests,
    readings_prefix,
    row_digest,
    some_rows,
    write_row_digests,
    write_sealed_digest,
)
from grabberd.archive.capture.groups import measured_points, recorded_fields
from grabberd.archive.capture.meta import (
    BEFORE,
    CONVERSION,
    SEALED,
    CaptureMeta,
    coverage_key,
    read_meta,
    write_meta,
)
from grabberd.archive.capture.reading_groups import MOST_CHANNELS, RecordedChannel, decode_readings
from grabberd.archive.capture.recorded_channels import KEY, RecordedChannels, groups_of, write_account
from grabberd.archive.capture.recorded_ledger import RecordedLedger, rebases_in
from grabberd.archive.capture.rows import write_ledger
from grabberd.archive.capture.schema import (
    DAMAGE,
    FORMAT_1,
    PART,
    WITH_CHANNELS,
    connect,
    create,
    format_of,
    reading_errors,
)
from grabberd.archive.capture.writer import FAILED
from grabberd.archive.guarded_database import schema_of
from grabberd.core.channels.account import Account, ChannelAccount, ChannelLedger
from grabberd.core.ledger import FILE_DAMAGED, UNACCOUNTED, Ledger, LedgerEntry, Outcome
from grabberd.files.disk import scratch_folder
from grabberd.files.reading import check_patience, read_json

_USUAL = 200
_AT_ONCE = {"pictures": 2, "points": 2}
"""Rows read at once, of tables with large ones."""
_BEYOND = 1000
"""Fields after the last known one among which others are looked for: more than a page of rows has."""
_MOST_MISSED = 50_000
"""Keys in turn without a readable row, after which a table is given up: below an inner page are fewer."""
_BELIEVED = 1_000_000
"""Fields after the last whole one that a row may name; damaged rows name any number."""
_ROWS_A_PAGE, _PAGE_BYTES = 8, 4096
"""Rows of groups that a page of the file has at most, and its size."""
_DIGESTS_A_ROW = 100
Row = tuple[Any, ...]

SAVE = f"{__name__}:save"
"""The function that a process for hostile files calls."""


def save(cut: Path, part: Path) -> int:
    """Saves what is whole of a capture into a new file; returns the number of whole fields.

    The new file has the state of the old one: a sealed capture lacks its name alone, another one is to be
    sealed as after a crash.

    Args:
        cut: The file that lacks a part; it stays as it is.
        part: The new file.

    Raises:
        CaptureFileError: Not even its metadata are left, or no whole field.
        StorageError: The new file cannot be written.
    """
    with scratch_folder(part.parent) as folder, closing(connect(cut, is_cut=True)) as source:
        new = folder / part.name
        with reading_errors(cut):
            version = format_of(source)
            if version == FORMAT_1:
                raise ValueError("parts of format 1 are not saved")
            with closing(create(new, version=version, reserve_bytes=0)) as connection:
                last_n = _copy(source, connection, cut.stat().st_size // _PAGE_BYTES)
                if cut.suffix != PART and read_meta(connection).state != SEALED:  # its last row is gone
                    write_meta(connection, {"state": SEALED, "ended_because": FILE_DAMAGED})
                saved = _keep_whole(new, connection, last_n)
                connection.execute("PRAGMA journal_mode = DELETE")
            if not saved:
                raise ValueError("no field of it is whole")
        runtime.rename(new, part)
    return saved


def _copy(source: sqlite3.Connection, target: sqlite3.Connection, pages: int) -> int:
    """Copies all rows that can be read; returns the last field that the end of a table names."""
    last_n = _last_n(source)
    last = max(last_n + _BEYOND, _ROWS_A_PAGE * pages)
    target.execute("BEGIN")
    target.execute("DELETE FROM reserve")
    target.executemany("INSERT INTO reserve VALUES (?)", zip(_first_metadata(source), strict=True))
    target.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", _meta_rows(source, last_n + _BEYOND))
    for table in {name for kind, name, _ in schema_of(target) if kind == "table"} - {"meta", "reserve"}:
        for _, *row in _rows(_table(source, table), last, _AT_ONCE.get(table, _USUAL)):
            marks = ", ".join("?" * len(row))
            target.execute(f"INSERT OR IGNORE INTO {table} VALUES ({marks})", row)  # noqa: S608 - of the schema
    target.execute("COMMIT")
    return last_n


Fetch = Callable[[int, int, int], list[Row]]
"""Fetches at most so many rows whose keys are between the first two numbers, in order; keys come first."""


def _table(source: sqlite3.Connection, table: str) -> Fetch:
    query = f"SELECT rowid, * FROM {table} WHERE rowid BETWEEN ? AND ? ORDER BY rowid LIMIT ?"  # noqa: S608 - of the schema
    return lambda *values: some_rows(source.execute(query, values))


def _numbered(source: sqlite3.Connection, prefix: str, digits: int = 10) -> Fetch:
    """Fetches rows of the metadata by the number after a prefix of their keys."""
    query = f"""SELECT CAST(substr(key, {len(prefix) + 1}) AS INTEGER), key, value FROM meta
        WHERE key BETWEEN ? AND ? ORDER BY key LIMIT ?"""  # noqa: S608 - a number
    return lambda first, last, some: source.execute(
        query, (f"{prefix}{first:0{digits}d}", f"{prefix}{last:0{digits}d}", some)
    ).fetchall()


def _rows(fetch: Fetch, last: int, at_once: int = _USUAL) -> Iterator[Row]:
    """All rows that can be read, up to a key; where one cannot, it goes on with the next key."""
    first, some, after = 0, at_once, 0
    while first <= min(last, after + _MOST_MISSED):
        check_patience("what is left of a capture")
        try:
            rows = fetch(first, last, some)
        except sqlite3.DatabaseError:
            first, some = first + (some == 1), 1
            continue
        yield from rows
        if not rows:
            return
        first, some = rows[-1][0] + 1, at_once
        after = first


def _meta_rows(source: sqlite3.Connection, last_n: int) -> Iterator[Row]:
    """Keys and values of the metadata; the later ones count."""
    for first in _first_metadata(source):
        with suppress(*DAMAGE):
            yield from (
                (key, json.dumps(value, ensure_ascii=False)) for key, value in read_json(first).items()
            )
    runs = [row[0] for row in _rows(_table(source, "runs"), _USUAL)]
    names = [one.name for one in fields(CaptureMeta)] + [coverage_key(run) for run in runs]
    for key in (*names, FORM_KEY, SEALED_KEY, KEY, CONVERSION, BEFORE):
        with suppress(sqlite3.DatabaseError):
            yield from source.execute("SELECT key, value FROM meta WHERE key = ?", (key,)).fetchall()
    channels = _rows(_table(source, "channels"), MOST_CHANNELS) if format_of(source) == WITH_CHANNELS else ()
    prefixes = [FIELDS, "marks.", *map(points_prefix, runs), *(readings_prefix(row[0]) for row in channels)]
    numbered = [_rows(_numbered(source, prefix), last_n) for prefix in prefixes]
    for _, key, value in itertools.chain(*numbered, _rows(_numbered(source, "digest.run.", 7), _USUAL)):
        yield key, value


def _first_metadata(source: sqlite3.Connection) -> list[str]:
    with suppress(sqlite3.DatabaseError):
        return _column(source, "SELECT data FROM reserve WHERE typeof(data) = 'text'")
    return []


_LAST_N = (
    "SELECT n FROM fields ORDER BY n DESC LIMIT 1",
    "SELECT last_n FROM pictures ORDER BY first_n DESC LIMIT 1",
    "SELECT first_n + count - 1 FROM ledger ORDER BY first_n DESC LIMIT 1",
    "SELECT last_n FROM points ORDER BY rowid DESC LIMIT 1",
    f"SELECT CAST(substr(key, {len(FIELDS) + 1}) AS INTEGER) FROM meta WHERE key < 'digest.fields/'"  # noqa: S608 - a number
    " ORDER BY key DESC LIMIT 1",
)


def _last_n(source: sqlite3.Connection) -> int:
    """Number of the last field that the end of a table names; 0 if no end can be read."""
    found = [0]
    for query in _LAST_N:
        with suppress(sqlite3.DatabaseError):
            found += [n for n in _column(source, query) if isinstance(n, int)]
    return max(found)


class _Groups(NamedTuple):
    """Groups of one kind.

    Attributes:
        key: The column with their numbers, in `table`, of those that the clause `where` selects.
        prefix: Prefix of the keys of their digests.
        kind: How they are read, with `values`.
        decode: Decodes one; raises if it is damaged.
    """

    table: str
    key: str
    where: str
    prefix: str
    kind: Kind
    decode: Callable[[Any], object]
    values: Mapping[str, int]


_PICTURES = _Groups("pictures", "first_n", "true", FIELDS, PICTURE_GROUPS, recorded_fields, {})


def _points_of(run: int) -> _Groups:
    values = {"run": run}
    return _Groups("points", "first_n", f"run = {run:d}", points_prefix(run), POINT_GROUPS, _measured, values)


def _measured(group: Any) -> object:
    return measured_points(group.points)


def _readings_of(channel: RecordedChannel) -> _Groups:
    number, kind = channel.channel, groups_of(channel)
    where, values = f"channel = {number:d}", {"channel": number}
    return _Groups("readings", "number", where, readings_prefix(number), kind, decode_readings, values)


_UNPROVEN = {"its metadata", "its ledger", "the digest of its metadata and ledger"}


def _keep_whole(path: Path, connection: sqlite3.Connection, last_n: int) -> int:
    """Removes what is not whole, and enters it as lost; returns the number of fields that are left."""
    meta = read_meta(connection)
    is_proven = meta.state == SEALED and has_digests(connection)
    changed = set(changed_parts(connection)) if is_proven else _UNPROVEN
    channels = RecordedChannels(path, connection, [])
    runs = _column(connection, "SELECT run FROM runs")
    named = [*read_row_digests(connection, FIELDS), *_column(connection, "SELECT n FROM fields")]
    lacks_pictures = _remove_damaged(connection, _PICTURES)
    connection.execute(f"DELETE FROM fields AS f {WITHOUT_PICTURE}")  # noqa: S608 - constants
    connection.execute("DELETE FROM points WHERE run NOT IN (SELECT run FROM runs)")
    lacking_points = [run for run in runs if _remove_damaged(connection, _points_of(run))]
    lacking = [one for one in channels.all if _remove_damaged(connection, _readings_of(one))]
    if channels.account is None and channels.all:
        lacking = channels.all
    _count_anew(connection, channels, lacking)
    account = _account(connection, meta, named, last_n)
    if lacks_pictures or changed & _UNPROVEN:
        _leave_end_open(account, meta)
    connection.execute("BEGIN")
    write_ledger(connection, account)
    if meta.state == SEALED:
        cut = {*lacking_points, *(run for run in runs if f"run {run}" in changed)}
        _seal_anew(connection, cut, complete=bool(meta.complete) and account.complete)
    connection.execute("COMMIT")
    return _column(connection, "SELECT count(*) FROM fields")[0]


def _remove_damaged(connection: sqlite3.Connection, groups: _Groups) -> bool:
    """Removes damaged groups, and the digests of lost ones; returns True if there are any."""
    digests = read_row_digests(connection, groups.prefix)
    there = _column(connection, f"SELECT {groups.key} FROM {groups.table} WHERE {groups.where}")  # noqa: S608 - constants
    whole = _whole(connection, groups, digests)
    connection.execute("BEGIN")
    remove = f"DELETE FROM {groups.table} WHERE {groups.where} AND {groups.key} = ?"  # noqa: S608 - constants
    connection.executemany(remove, [(key,) for key in set(there) - whole.keys()])
    after = groups.prefix[:-1] + "/"  # the character after the dot
    connection.execute("DELETE FROM meta WHERE key > ? AND key < ?", (groups.prefix, after))
    keys = list(whole)
    for first in range(0, len(keys), _DIGESTS_A_ROW):
        some = keys[first : first + _DIGESTS_A_ROW]
        write_row_digests(connection, groups.prefix, {key: whole[key] for key in some})
    connection.execute("COMMIT")
    return whole.keys() != digests.keys() | set(there)


def _whole(connection: sqlite3.Connection, groups: _Groups, digests: Mapping[int, str]) -> dict[int, str]:
    """Digests of the groups that are whole, in order; one whose digest is lost needs to be decoded alone."""
    kind, whole, first = groups.kind, dict[int, str](), 0
    while rows := kind.fetch(connection, {**groups.values, "first": first, "end": END}):
        check_patience("what is left of a capture")
        for row in rows:
            with suppress(*DAMAGE):
                found = row_digest(kind.stored(row))
                groups.decode(row)
                if digests.get(kind.key(row), found) == found:
                    whole[kind.key(row)] = found
        first = kind.key(rows[-1]) + 1
    return whole


def _count_anew(
    connection: sqlite3.Connection, channels: RecordedChannels, lacking: Iterable[RecordedChannel]
) -> None:
    """Replaces the accounts of channels that lack readings."""
    counted = {one.name: _counted(connection, channels, one) for one in lacking}
    if counted:
        account = channels.account or Account(tuple(counted.values()))
        known = tuple(counted.get(one.name, one) for one in account.channels)
        write_account(connection, account._replace(channels=known))


def _counted(
    connection: sqlite3.Connection, channels: RecordedChannels, channel: RecordedChannel
) -> ChannelAccount:
    counted = ChannelLedger(ChannelAccount(channel.name, channel.logger, late=FILE_DAMAGED))
    query = f"SELECT number FROM readings WHERE channel = {channel.channel:d} ORDER BY number"  # noqa: S608 - a number
    expected = 0
    for number, readings in zip(_column(connection, query), channels.groups(channel), strict=True):
        if number != expected:
            counted.interrupted(FILE_DAMAGED)
        counted.enter(readings.time_ns)
        expected = number + 1
    counted.interrupted(FILE_DAMAGED)
    return counted.account


def _account(
    connection: sqlite3.Connection, meta: CaptureMeta, named: Collection[int], last_n: int
) -> Ledger:
    """The ledger of the fields that are left, with those that are known to have been there as lost."""
    entered = _column(connection, "SELECT first_n FROM ledger")
    first_n = min([*named, *entered], default=None)
    account = RecordedLedger(Path(meta.id), connection).read(rebases_in(meta.extra), first_n)
    account.entries = [
        one._replace(reason=FILE_DAMAGED) if one.reason == UNACCOUNTED else one for one in account.entries
    ]
    end_n = account.end_n or 0
    account.close(max([end_n - 1, *(n for n in (last_n, *named) if n < end_n + _BELIEVED)]) + 1, FILE_DAMAGED)
    return account


def _leave_end_open(account: Ledger, meta: CaptureMeta) -> None:
    """Enters that further fields may have been there; one that is recording is closed when it is sealed."""
    if meta.state == SEALED:
        unknown = f"{FILE_DAMAGED}; unknown"
        account.add(LedgerEntry(account.end_n or 0, 1, Outcome.LOST, unknown))


def _seal_anew(connection: sqlite3.Connection, cut_runs: Iterable[int], *, complete: bool) -> None:
    failed = [(FAILED, FILE_DAMAGED, run) for run in cut_runs]
    connection.executemany("UPDATE runs SET state = ?, reason = ? WHERE run = ?", failed)
    write_meta(connection, {"complete": complete})
    connection.execute("DELETE FROM meta WHERE key GLOB 'digest.run.*'")
    write_sealed_digest(connection)


def _column(connection: sqlite3.Connection, query: str) -> list[Any]:
    return [value for (value,) in connection.execute(query)]
