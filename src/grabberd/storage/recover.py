"""What a crash left: sealed as far as it goes, or set aside with a reason; never deleted."""

import itertools
import os
from pathlib import Path

from grabberd.acquisition import Ledger, LedgerEntry, Outcome
from grabberd.errors import CaptureFileError
from grabberd.storage.meta import SEALED, write_meta
from grabberd.storage.reader import CaptureReader
from grabberd.storage.schema import DAMAGED, PART, connect, storage_errors
from grabberd.storage.writer import FAILED, RUNNING, publish, write_ledger

JOURNAL = "-journal"
INTERRUPTED = "the program ended while it was recording"


def recover(part: Path) -> Path:
    """Seals a `.grab.part` file that nobody writes any more; returns its final path.

    The database rolls an unfinished commit back by itself when it is opened. The capture is marked
    incomplete: how much is missing at its end, at most the last second, nobody can know. A file that cannot
    be read is renamed `NAME.grab.damaged`, with the reason in `NAME.grab.damaged.txt`.

    Raises:
        StorageError: the disk does not let it be written.
    """
    try:
        with CaptureReader(part) as reader:
            ledger, sealed = reader.ledger, reader.meta.state == SEALED
    except CaptureFileError as error:
        return set_aside(part, error.message)
    if not sealed:  # otherwise only its name was still missing
        _seal(part, ledger)
    with storage_errors(part):
        part.with_name(part.name + JOURNAL).unlink(missing_ok=True)  # empty: its transaction has ended
        return publish(part)


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
    """At least the next field is missing."""
    ledger.add(LedgerEntry(ledger.end_n or 0, 1, Outcome.LOST, INTERRUPTED))
    return ledger


def set_aside(path: Path, reason: str) -> Path:
    """Renames a file that cannot be read, and writes the reason beside it."""
    with storage_errors(path):
        aside = _free_name(path)
        aside.with_name(aside.name + ".txt").write_text(reason + "\n", encoding="utf-8")
        os.rename(path, aside)
    return aside


def _free_name(path: Path) -> Path:
    """`NAME.grab.damaged`, or `NAME-2.grab.damaged` and so on where there is one already."""
    name, dot, rest = path.name.removesuffix(PART).partition(".")
    names = itertools.chain([name], (f"{name}-{number}" for number in itertools.count(2)))
    candidates = (path.with_name(f"{free}{dot}{rest}{DAMAGED}") for free in names)
    return next(candidate for candidate in candidates if not candidate.exists())
