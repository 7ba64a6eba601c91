"""Captures of format 1, made up for the tests as the versions that wrote it did."""

import sqlite3
import zlib
from contextlib import closing
from dataclasses import asdict

import zstandard

from archive.captures import MADE_WITH, META, ledger_of, meta, points
from grabberd.archive.capture.digests import (
    FIELDS,
    points_prefix,
    row_digest,
    write_row_digests,
    write_sealed_digest,
)
from grabberd.archive.capture.encodings import encode_field_points
from grabberd.archive.capture.meta import coverage_key, write_meta
from grabberd.archive.capture.rows import write_ledger
from grabberd.archive.capture.schema import APPLICATION_ID, TABLES_1
from grabberd.archive.capture.writer import run_row
from grabberd.core.ledger import Outcome


def encode_field(packed):
    """Codec and bytes of a picture."""
    raw = packed.data.tobytes()
    if packed.bits == 1:
        return "zlib", zlib.compress(raw, 1)
    return "zstd", zstandard.ZstdCompressor(level=1).compress(raw)


def write_first_format(directory, taken, *, measured=(), again=(), name="liner", coverage=None, **changes):
    """A sealed capture of format 1; the runs' points are those of `points(n)` and `points(n + 50)`."""
    path = directory / f"{name}.grab"
    ledger = ledger_of(taken)
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute("PRAGMA user_version = 1")
        connection.executescript("BEGIN;" + TABLES_1)
        verdict = {"state": "sealed", "complete": ledger.complete, "ended_because": "length reached"}
        write_meta(connection, {"digests": 1, **asdict(meta(**changes)), **verdict})
        for one in taken:
            if one.outcome is not Outcome.NO_SIGNAL:
                _write_field(connection, one)
        write_ledger(connection, ledger)
        for run, kind, numbers, shift in ((1, "live", measured, 0), (2, "measure", again, 50)):
            if numbers:
                _write_run(connection, run, kind, {n: points(n + shift) for n in numbers})
        write_meta(connection, {coverage_key(run): one for run, one in (coverage or {}).items()})
        write_sealed_digest(connection)
        connection.execute("COMMIT")
    return path


def _write_field(connection, slot):
    numbered, packed = slot.numbered, slot.numbered.packed
    where = (numbered.n, int(numbered.time_ns), numbered.sequence, packed.parity, packed.y0, packed.y_step)
    what = (packed.rows, packed.columns, packed.bits, int(packed.threshold))
    row = (*where, *what, str(slot.outcome), slot.reason, *encode_field(packed))
    connection.execute(f"INSERT INTO fields VALUES ({', '.join('?' * len(row))})", row)
    write_row_digests(connection, FIELDS, {numbered.n: row_digest(row)})


def _write_run(connection, run, kind, measured):
    row = run_row(run, kind, META.created_utc, "0.1.0", "done", MADE_WITH)
    connection.execute("INSERT INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
    for n, of_field in measured.items():
        row = (run, n, len(of_field), encode_field_points(of_field))
        connection.execute("INSERT INTO points VALUES (?, ?, ?, ?)", row)
        write_row_digests(connection, points_prefix(run), {n: row_digest(row)})
