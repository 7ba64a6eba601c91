"""Whether the files of captures are what they should be."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from grabberd.archive.capture.reader import CaptureReader
from grabberd.core.ledger import Outcome


class Checked(NamedTuple):
    """A file: how many fields should have come, came whole, have points; and what is wrong with it."""

    name: str
    total: int
    received: int
    measured: int
    complete: bool
    faults: tuple[str, ...]


def check_captures(folder: Path) -> list[Checked]:
    """Every capture below a folder, sealed or not."""
    return [check_capture(path) for path in sorted(folder.rglob("*.grab*"))]


def check_capture(path: Path) -> Checked:
    """Opens it, decodes every field and point of it, and compares them with its ledger and its verdict."""
    try:
        with CaptureReader(path) as reader:
            return _checked(path, reader)
    except Exception as error:
        return Checked(path.name, 0, 0, 0, False, (f"{type(error).__name__}: {error}",))


def _checked(path: Path, reader: CaptureReader) -> Checked:
    ledger = reader.ledger
    fields = [recorded.numbered.n for recorded in reader.fields() if recorded.outcome is Outcome.RECEIVED]
    measured = [n for n, _ in reader.points()] if reader.runs else []
    whole = ledger.total == ledger.received
    found = {
        "is not sealed": path.suffix != ".grab",
        f"is damaged: {(integrity := _integrity(path))}": integrity != "ok",
        f"its ledger has {ledger.received} fields received, the file {len(fields)}": ledger.received
        != len(fields),
        "its ledger does not add up": ledger.total
        != ledger.received + sum(one.count for one in ledger.entries),
        f"of {len(fields)} fields {len(measured)} have been measured": measured != fields,
        f"its verdict is {reader.meta.complete}": bool(reader.meta.complete) != (whole and ledger.total > 0),
    }
    faults = tuple(words for words, wrong in found.items() if wrong)
    return Checked(path.name, ledger.total, len(fields), len(measured), bool(reader.meta.complete), faults)


def _integrity(path: Path) -> str:
    with closing(sqlite3.connect(path)) as connection:
        return str(connection.execute("PRAGMA integrity_check").fetchone()[0])


def in_words(checked: list[Checked]) -> Iterator[str]:
    """A sentence for each file that something is wrong with."""
    return (f"{one.name}: {'; '.join(one.faults)}" for one in checked if one.faults)
