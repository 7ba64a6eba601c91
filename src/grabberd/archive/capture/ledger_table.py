"""The table `ledger` of a capture file: what became of the fields that were not received."""

import sqlite3

from grabberd.core.ledger import Ledger, LedgerEntry, Outcome

NOT_WRITTEN = "not written to disk"


def as_far_as_written(connection: sqlite3.Connection, ledger: Ledger) -> Ledger:
    """The ledger, in which received fields that are not in the file are lost."""
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
