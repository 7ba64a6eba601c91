"""Captures that look valid, with more of everything in them than a capture ever has."""

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from archive.captures import slots, write
from grabberd.archive.capture.digests import write_sealed_digest
from grabberd.archive.capture.meta import read_meta, write_meta

Inflated = Callable[[sqlite3.Connection], None]
TEXT = "a" * 190


def hostile(folder: Path, name: str, *inflated: Inflated, fields: int = 4) -> Path:
    """A sealed capture changed so, whose digests are right."""
    path = write(folder, slots(fields), name=name, id=name, measured=[0, 1])
    with closing(sqlite3.connect(path)) as connection, connection:
        for inflate in inflated:
            inflate(connection)
        write_sealed_digest(connection)
    return path


def with_ledger(entries: int, reason: str = "time gap", first_n: int = 4, step: int = 1) -> Inflated:
    """Single fields that were lost or not taken; with a greater step, those between them have no entry."""
    outcomes = ("lost", "overrun")

    def inflate(connection: sqlite3.Connection) -> None:
        rows = ((first_n + step * k, 1, outcomes[k % 2], reason) for k in range(entries))
        connection.executemany("INSERT INTO ledger VALUES (?, ?, ?, ?)", rows)

    return inflate


def with_rebases(count: int) -> Inflated:
    """So many events."""
    events = [{"n": k, "kind": "count", "reason": "the driver's count has restarted"} for k in range(count)]
    return with_extra(rebases=events)


def with_extra(**findings: object) -> Inflated:
    """Further findings."""

    def inflate(connection: sqlite3.Connection) -> None:
        write_meta(connection, {"extra": {**read_meta(connection).extra, **findings}})

    return inflate


def with_meta(**values: object) -> Inflated:
    """Metadata."""
    return lambda connection: write_meta(connection, values)


def with_runs(count: int, document: object = None) -> Inflated:
    """So many runs, each with that calibration."""

    def inflate(connection: sqlite3.Connection) -> None:
        text = json.dumps(document)
        rows = (
            (run, "measure", "2026-03-01T09:30:00Z", "1", "done", None, text, "null", "null")
            for run in range(2, count + 1)
        )
        connection.executemany("INSERT INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", rows)

    return inflate


LABELS = {f"{k:03}{TEXT}"[:190]: TEXT for k in range(60)}


def folder_of(folder: Path, long: int, entries: int = 400_000) -> list[Path]:
    """Captures of which each is as heavy as it may be, so many of them with a ledger of that length."""
    heavy = [
        hostile(
            folder, f"ledger-{k}", with_ledger(entries), with_rebases(8000), with_runs(100, {"id": "rig"})
        )
        for k in range(long)
    ]
    return [
        *heavy,
        hostile(folder, "loose", with_ledger(entries, step=2)),
        hostile(folder, "reasons", with_ledger(20, "b" * 1_000_000), with_meta(ended_because="c" * 10**6)),
        hostile(folder, "runs", with_runs(1000, [[] for _ in range(300_000)])),
        hostile(folder, "more-runs", with_runs(5000)),
        hostile(folder, "labels", with_meta(labels=LABELS, note="d" * 10_000)),
        hostile(folder, "config", with_meta(config={"marks": [[] for _ in range(2_000_000)]})),
        hostile(folder, "extra", with_extra(rig={"v": [[] for _ in range(600_000)]})),
    ]
