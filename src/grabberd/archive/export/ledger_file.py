"""The ledger of a capture as `ledger.csv`, beside whatever is exported of it."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

from grabberd.archive.capture.digests import Damage
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.csv_file import cells
from grabberd.archive.export.read_back import csv_check
from grabberd.core.ledger import Ledger, cause_of_loss
from grabberd.files.checked_file import checked_path

LEDGER = "ledger.csv"
LEDGER_COLUMNS = ("first_n", "count", "outcome", "cause", "reason")
LEFT_OUT = "left_out.csv"
LEFT_OUT_COLUMNS = Damage._fields
REBASE = "rebase"
"""Outcome of a row that counts no fields: a change of what numbers and times go by from that field on."""


def write_ledger_file(reader: CaptureReader, directory: Path) -> None:
    """Writes `ledger.csv`: a row for each entry and each rebase, in order; only a header for a good capture.

    Raises:
        CaptureFileError: The capture is damaged.
        StorageError: The file cannot be written, or is there already.
    """
    _write(directory / LEDGER, LEDGER_COLUMNS, ledger_rows(reader.ledger))


def write_left_out_file(left_out: Sequence[Damage] | None, directory: Path) -> None:
    """Writes `left_out.csv`, what the disk has damaged and is not among the results; none if all was sound.

    Raises:
        StorageError: The file cannot be written.
    """
    if left_out:
        _write(directory / LEFT_OUT, LEFT_OUT_COLUMNS, left_out)


def _write(path: Path, columns: Sequence[str], rows: Sequence[tuple[object, ...]]) -> None:
    with (
        checked_path(path, csv_check(columns, rows.__len__)) as part,
        part.open("w", newline="", encoding="utf-8") as file,
    ):
        table = csv.writer(file)
        table.writerow(columns)
        table.writerows(map(cells, rows))


def ledger_rows(ledger: Ledger) -> list[tuple[int, int, str, str, str]]:
    """Rows of `LEDGER_COLUMNS`: one for each entry and each rebase, in order."""
    return sorted(_rows(ledger))


def _rows(ledger: Ledger) -> Iterator[tuple[int, int, str, str, str]]:
    for entry in ledger.entries:
        cause = cause_of_loss(entry.outcome, entry.reason)
        yield entry.first_n, entry.count, str(entry.outcome), str(cause), entry.reason
    for event in ledger.events:
        yield event.n, 0, REBASE, str(event.kind), event.reason
