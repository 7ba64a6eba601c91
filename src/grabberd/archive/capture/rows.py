"""Rows of a capture file as objects: fields of format 1, runs and ledger.

Invalid rows are errors, never guessed at. Rebases, the ledger's events, are stored in the metadata, as the
key `rebases` of `extra`.
"""

import sqlite3
from bisect import bisect_right
from collections.abc import Container, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.codec import decode_field
from grabberd.archive.capture.meta import LARGEST_N, LARGEST_TIME_NS, LONGEST_REASON
from grabberd.core.field import BIT_DEPTHS, LARGEST_SIDE_PX, PROGRESSIVE, NumberedField, PackedField
from grabberd.core.ledger import Ledger, LedgerEntry, LedgerEvent, Outcome, Rebase
from grabberd.files.json_value import read_json

FIELD_COLUMNS = (
    "n, time_ns, sequence, parity, y0, y_step, rows, columns, bits, threshold, outcome, reason, codec, data"
)
"""Columns in the order of the table of format 1, which is also that of the digests."""
_LARGEST_RUN = 1_000_000
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


def run_info(row: tuple[Any, ...], coverage: str | None = None) -> RunInfo:
    """Decodes a row of the table `runs`, and the run's coverage, a JSON document.

    Raises:
        ValueError: The row or the coverage is damaged.
    """
    documents = dict(zip(("calibration", "object", "settings"), map(read_json, row[6:9]), strict=True))
    for name, document in documents.items():
        if not isinstance(document, dict | None):
            raise ValueError(f"{name} is {document!r}")
    run, *texts = row[:6]
    if not isinstance(run, int) or run not in range(1, _LARGEST_RUN):
        raise ValueError(f"a run has the number {run!r}")
    kind, created_utc, version, state, reason = map(text_of, texts)
    if None in (kind, created_utc, version, state):
        raise ValueError(f"run {run} of {created_utc!r} is a {kind!r} by {version!r}, {state!r}")
    covered = None if coverage is None else read_json(coverage)
    if not isinstance(covered, dict | None):
        raise ValueError(f"the coverage of run {run} is {covered!r}")
    return RunInfo(run, str(kind), str(created_utc), str(version), str(state), reason, documents, covered)


def ledger(
    fields: Iterable[tuple[Any, ...]],
    entries: Iterable[tuple[Any, ...]],
    events: Sequence[LedgerEvent] = (),
) -> Ledger:
    """Makes a ledger from (n, outcome, reason) of the fields in the file and the entries for all others.

    Raises:
        ValueError: They contradict each other.
    """
    listed = [_entry(*row) for row in entries]
    rows = [(_n(n), Outcome(outcome), text_of(reason)) for n, outcome, reason in fields]
    received = [n for n, outcome, _ in rows if outcome is Outcome.RECEIVED]
    damaged = [
        LedgerEntry(n, 1, outcome, reason or outcome)
        for n, outcome, reason in rows
        if outcome is not Outcome.RECEIVED and not _covers(listed, n)
    ]
    return Ledger.restore(received, [*listed, *damaged], events=events)


def _entry(first_n: Any, count: Any, outcome: Any, reason: Any) -> LedgerEntry:
    end_n = _n(_n(first_n) + _n(count))
    return LedgerEntry(first_n, end_n - first_n, Outcome(outcome), text_of(reason) or "")


def _n(value: Any) -> int:
    if isinstance(value, int) and 0 <= value < LARGEST_N:
        return value
    raise ValueError(f"a number of a field, or of fields, is {value!r}")


def _covers(entries: Sequence[LedgerEntry], n: int) -> bool:
    """True if one of the entries, which are in order, covers field n."""
    before = bisect_right(entries, n, key=lambda entry: entry.first_n)
    return before > 0 and n < entries[before - 1].end_n


def text_of(value: Any) -> str | None:
    """Checks that a cell is a text or None.

    Raises:
        ValueError: The cell is neither, or too long.
    """
    if isinstance(value, str | None) and len(value or "") <= LONGEST_REASON:
        return value
    raise ValueError(f"a text is {type(value).__name__}, or has more than {LONGEST_REASON} characters")


NOT_WRITTEN = "not written to disk"


def as_far_as_written(connection: sqlite3.Connection, ledger: Ledger) -> Ledger:
    """The ledger with received fields that are not in the file entered as lost."""
    rows = connection.execute("SELECT n FROM fields WHERE outcome = ? ORDER BY n", (str(Outcome.RECEIVED),))
    written = [n for (n,) in rows]
    if len(written) == ledger.received:
        return ledger
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


KEY = "rebases"


def with_rebases(extra: Mapping[str, Any], events: Sequence[LedgerEvent]) -> Mapping[str, Any]:
    """The metadata with these events added."""
    return {**extra, KEY: [event._asdict() for event in events]} if events else extra


def rebases_in(extra: Mapping[str, Any]) -> list[LedgerEvent]:
    """The events in a capture's metadata; empty in files of earlier versions.

    Raises:
        ValueError: The events are damaged.
    """
    return [_event(one) for one in extra.get(KEY, ())]


def _event(stored: Any) -> LedgerEvent:
    match stored:
        case {"n": int(n), "kind": str(kind), "reason": str(reason)}:
            return LedgerEvent(n, Rebase(kind), reason)
    raise ValueError(f"a rebase is {stored!r}")
