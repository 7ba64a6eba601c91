"""Sealing what a crash left, or setting it aside with a reason; nothing is ever deleted."""

import itertools
import os
from collections.abc import Iterator
from pathlib import Path

from grabberd.acquisition import Ledger, LedgerEntry, Outcome
from grabberd.errors import CaptureFileError, LaterVersion
from grabberd.storage.capture.reader import CaptureReader
from grabberd.storage.capture.schema import DAMAGED, JOURNAL, SEALED, connect, reading_errors, write_meta
from grabberd.storage.capture.writer import FAILED, RUNNING, publish, write_ledger
from grabberd.storage.disk import storage_errors

REASON = ".txt"
INTERRUPTED = "the program ended while it was recording"


def recover(part: Path) -> Path:
    """Seals a `.grab.part` file that nobody writes any more; returns its final path.

    SQLite rolls an unfinished commit back when the file is opened. The capture is marked incomplete: nobody
    can know how much is missing at its end, which is at most the last second. A file that cannot be read is
    set aside.

    Raises:
        LaterVersion: A later version has to seal it.
        StorageError: It cannot be written.
    """
    try:
        _seal_if_need_be(part)
    except LaterVersion:
        raise
    except CaptureFileError as error:
        return set_aside(part, error.message)
    with storage_errors(part):
        # SQLite keeps the journal's file after its transaction (PERSIST), but a sealed capture is one file.
        part.with_name(part.name + JOURNAL).unlink(missing_ok=True)
        return publish(part)


def _seal_if_need_be(part: Path) -> None:
    with CaptureReader(part) as reader:
        ledger, sealed = reader.ledger, reader.meta.state == SEALED
    if not sealed:  # a crash between sealing and renaming leaves only the name to be done
        with reading_errors(part):
            _seal(part, ledger)


def _seal(part: Path, ledger: Ledger) -> None:
    connection = connect(part, writable=True)
    try:
        with storage_errors(part), connection:
            connection.execute("BEGIN IMMEDIATE")
            connection.execute("DELETE FROM reserve")
            write_ledger(connection, _with_cut(ledger))
            change = "UPDATE runs SET state = ?, reason = ? WHERE state = ?"
            connection.execute(change, (FAILED, INTERRUPTED, RUNNING))
            write_meta(connection, {"state": SEALED, "complete": False, "ended_because": INTERRUPTED})
    finally:
        connection.close()


def _with_cut(ledger: Ledger) -> Ledger:
    """Adds the field after the last: at least that one is missing, so the ledger is not complete."""
    ledger.add(LedgerEntry(ledger.end_n or 0, 1, Outcome.LOST, INTERRUPTED))
    return ledger


def set_aside(path: Path, reason: str) -> Path:
    """Moves a file that cannot be read into the folder `damaged`, with the reason in a text file beside it.

    Raises:
        StorageError: It cannot be moved; it stays where it is.
    """
    with storage_errors(path):
        folder = path.parent / DAMAGED
        folder.mkdir(exist_ok=True)
        aside = _free_name(folder / path.name)
        reason_of(aside).write_text(reason + "\n", encoding="utf-8")
        journal = path.with_name(path.name + JOURNAL)
        if journal.exists():  # repairing the database needs it
            os.rename(journal, aside.with_name(aside.name + JOURNAL))
        os.rename(path, aside)
    return aside


def reason_of(aside: Path) -> Path:
    """The text file with the reason why a file was set aside."""
    return aside.with_name(aside.name + REASON)


def _free_name(path: Path) -> Path:
    """The path, or `NAME-2.grab` and so on if it is taken."""
    name, dot, rest = path.name.partition(".")
    candidates = (path.with_name(f"{free}{dot}{rest}") for free in numbered(name))
    return next(candidate for candidate in candidates if not candidate.exists())


def numbered(name: str) -> Iterator[str]:
    """`NAME`, `NAME-2`, `NAME-3` and so on."""
    yield name
    yield from (f"{name}-{number}" for number in itertools.count(2))
