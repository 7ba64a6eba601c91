"""Rows of a capture file as objects: fields of format 1 and runs; the ledger's rows as they are written.

Invalid rows are errors, never guessed at.
"""

import sqlite3
from collections.abc import Container, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.encodings import decode_field
from grabberd.archive.capture.meta import (
    LARGEST_N,
    LARGEST_TIME_NS,
    LONGEST_NAME,
    LONGEST_REASON,
    LONGEST_SAID,
)
from grabberd.core.field import BIT_DEPTHS, LARGEST_SIDE_PX, PROGRESSIVE, NumberedField, PackedField
from grabberd.core.ledger import Ledger, LedgerEntry, Outcome
from grabberd.files.reading import read_json

FIELD_COLUMNS = (
    "n, time_ns, sequence, parity, y0, y_step, rows, columns, bits, threshold, outcome, reason, codec, data"
)
"""Columns in the order of the table of format 1, which is also that of the digests."""
LARGEST_RUN = 1_000_000
"""Upper bound of a run's number."""
_OF_PICTURES = {
    "bits": BIT_DEPTHS,
    "rows": range(1, LARGEST_SIDE_PX + 1),
    "columns": range(1, LARGEST_SIDE_PX + 1),
}
_OF_FIELDS = {
    "parity": (0, 1, PROGRESSIVE),
    "y0": range(LARGEST_SIDE_PX),
    "y_step": (1, 2),
    "threshold": range(256),
    "n": range(LARGEST_N),
    "time_ns": range(LARGEST_TIME_NS),
}


class RunInfo(NamedTuple):
    """A run without its points; `made_with` has the documents calibration, object and settings.

    `coverage` states how well it was measured; None for runs of earlier versions, which did not count that.
    """

    run: int
    kind: str
    created_utc: str
    version: str
    state: str
    reason: str | None
    made_with: dict[str, Any]
    coverage: dict[str, Any] | None = None


class RecordedField(NamedTuple):
    """A field of the file and its outcome."""

    numbered: NumberedField
    outcome: Outcome
    reason: str | None


def recorded_field(row: tuple[Any, ...]) -> RecordedField:
    """Decodes a row of `FIELD_COLUMNS`.

    Raises:
        ValueError: The row is damaged.
    """
    cells = dict(zip(FIELD_COLUMNS.split(", "), row, strict=True))
    check_picture(cells)
    check_field(cells)
    bits, columns = cells["bits"], cells["columns"]
    planes = decode_field(cells["codec"], cells["data"], cells["rows"], columns, bits)
    return field_of(cells, planes, bits, columns)


def field_of(cells: Mapping[str, Any], planes: NDArray[np.uint8], bits: int, columns: int) -> RecordedField:
    """A field from its decoded picture and its checked cells.

    Raises:
        ValueError: The outcome is unknown, or the reason is not a text.
    """
    image = (cells[name] for name in ("parity", "y0", "y_step", "threshold"))
    packed = PackedField(planes, bits, columns, *image)
    numbered = NumberedField(cells["n"], cells["time_ns"], cells["sequence"], packed)
    return RecordedField(numbered, Outcome(cells["outcome"]), text_of(cells["reason"]))


def check_picture(cells: Mapping[str, Any]) -> None:
    """Checks the size of a picture and its bits per pixel.

    Raises:
        ValueError: A value is out of range.
    """
    _check_among(cells, _OF_PICTURES)


def check_field(cells: Mapping[str, Any]) -> None:
    """Checks the numbers of a field.

    Raises:
        ValueError: A value is out of range.
    """
    _check_among(cells, _OF_FIELDS)
    if not isinstance(cells["sequence"], int | None):
        raise ValueError(f"sequence is {cells['sequence']!r}")


def _check_among(cells: Mapping[str, Any], among: Mapping[str, Container[int]]) -> None:
    for name, values in among.items():
        if not isinstance(cells[name], int) or cells[name] not in values:
            raise ValueError(f"{name} is {cells[name]!r}")


def run_info(row: tuple[Any, ...], coverage: dict[str, Any] | None = None) -> RunInfo:
    """Decodes a row of the table `runs`; `coverage` is the run's.

    Raises:
        ValueError: The row is damaged.
    """
    documents = dict(zip(("calibration", "object", "settings"), map(read_json, row[6:9]), strict=True))
    for name, document in documents.items():
        if not isinstance(document, dict | None):
            raise ValueError(f"{name} is {document!r}"[:LONGEST_SAID])
    run, *texts, reason = row[:6]
    if not isinstance(run, int) or run not in range(1, LARGEST_RUN):
        raise ValueError(f"a run has the number {run!r}"[:LONGEST_SAID])
    kind, created_utc, version, state = (text_of(text, LONGEST_NAME) for text in texts)
    if None in (kind, created_utc, version, state):
        raise ValueError(f"run {run} of {created_utc!r} is a {kind!r} by {version!r}, {state!r}")
    known = (str(kind), str(created_utc), str(version), str(state))
    return RunInfo(run, *known, text_of(reason), documents, coverage)


def text_of(value: Any, longest: int = LONGEST_REASON) -> str | None:
    """Checks that a cell is a text or None.

    Raises:
        ValueError: The cell is neither, or too long.
    """
    if isinstance(value, str | None) and len(value or "") <= longest:
        return value
    raise ValueError(f"a text is {type(value).__name__}, or has more than {longest} characters")


NOT_WRITTEN = "not written to disk"


def as_far_as_written(connection: sqlite3.Connection, ledger: Ledger) -> Ledger:
    """The ledger with received fields that are not in the file entered as lost."""
    received = ("FROM fields WHERE outcome = ?", (str(Outcome.RECEIVED),))
    if connection.execute(f"SELECT count(*) {received[0]}", received[1]).fetchone()[0] == ledger.received:
        return ledger
    written = [n for (n,) in connection.execute(f"SELECT n {received[0]} ORDER BY n", received[1])]
    kept = Ledger.restore(
        written, ledger.entries, events=ledger.events, first_n=ledger.first_n, gap=NOT_WRITTEN
    )
    kept.close(ledger.end_n or 0, NOT_WRITTEN)
    return kept


def write_ledger(connection: sqlite3.Connection, ledger: Ledger) -> None:
    """Replaces the table `ledger`."""
    connection.execute("DELETE FROM ledger")
    for entry in ledger.entries:
        insert_entry(connection, entry)


def insert_entry(connection: sqlite3.Connection, entry: LedgerEntry) -> None:
    """Adds one entry of the ledger."""
    row = (entry.first_n, entry.count, str(entry.outcome), entry.reason)
    connection.execute("INSERT INTO ledger VALUES (?, ?, ?, ?)", row)
