"""The list of captures as a table, for spreadsheets: a row a capture."""

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence

from grabberd.archive.export.csv_file import cells
from grabberd.core.ledger import Outcome
from grabberd.documents.captures import CaptureDocument
from grabberd.extension import extensions, load

Columns = Callable[[CaptureDocument | None], Mapping[str, object]]
"""Gives the columns that an extension adds, with a capture's values; of None their names count alone."""


def captures_csv(captures: Sequence[CaptureDocument]) -> str:
    """The captures as CSV, with a column for each label that any of them has, and those of extensions."""
    labels = sorted({name for capture in captures for name in capture.labels})
    added: list[Columns] = [load(one.columns) for one in extensions() if one.columns]
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(cells([*_head(labels), *(name for columns in added for name in columns(None))]))
    for capture in captures:
        more = (value for columns in added for value in columns(capture).values())
        writer.writerow(cells([*_row(capture, labels), *more]))
    return text.getvalue()


def _head(labels: Iterable[str]) -> list[object]:
    return [
        *("id", "device", "created_utc", "state", "verdict", "fields", "received"),
        *("coverage_verdict", "share_found", "bits", "lines"),
        *(f"label_{name}" for name in labels),
        *("note", "pinned", "size_bytes"),
    ]


def _row(capture: CaptureDocument, labels: Iterable[str]) -> list[object]:
    covered = capture.coverage
    received = capture.ledger.counts.get(Outcome.RECEIVED, 0)
    return [
        *(capture.id, capture.device, capture.created_utc, capture.state, capture.verdict or ""),
        *(capture.fields, received),
        *((covered.verdict, covered.share) if covered else ("", None)),
        *(capture.bits, capture.lines or ""),
        *(capture.labels.get(name, "") for name in labels),
        *(capture.note, str(capture.pinned).lower(), capture.size_bytes),
    ]
