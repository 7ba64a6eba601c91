"""The daemon of `recorded.py`, with a disk and a wall clock that can be told to fail.

    FAULTS_CONTROLS=controls.json python injected.py serve --config grabberd.yaml

The file of controls is read anew at each use:
    stall        true: no commit into a capture file ends
    full         parts of the names of databases into which nothing can be inserted
    max_pages    of databases that are opened from now on, by parts of their names
    step_s       by how much the wall clock has been set on
"""

import json
import os
import sqlite3
import sys
import time
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import grabberd_fake.grabber
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.cli import main
from grabberd.runtime import SystemClock

sys.path.append(str(Path(__file__).parents[2]))

from recorded_world import world_of

CONTROLS = Path(os.environ["FAULTS_CONTROLS"])
_commit, _utc_now, _connect = CaptureWriter.commit, SystemClock.utc_now, sqlite3.connect


def control(name: str, otherwise: Any) -> Any:
    """What the file says at this moment."""
    try:
        return json.loads(CONTROLS.read_text()).get(name, otherwise)
    except OSError:  # no descriptor is left, which is what is done to it at this moment
        return otherwise


def commit(writer: CaptureWriter) -> None:
    """Ends when the disk has stopped stalling."""
    while control("stall", False):
        time.sleep(0.01)
    _commit(writer)


def utc_now(clock: SystemClock) -> datetime:
    """The machine's time, as it has been set."""
    return _utc_now(clock) + timedelta(seconds=control("step_s", 0.0))


class FullDisk(sqlite3.Connection):
    """A database on a disk that has no room."""

    def execute(self, statement: str, *values: Any) -> sqlite3.Cursor:
        """What would need room fails."""
        self._refuse(statement)
        return super().execute(statement, *values)

    def executemany(self, statement: str, *values: Any) -> sqlite3.Cursor:
        """What would need room fails."""
        self._refuse(statement)
        return super().executemany(statement, *values)

    def _refuse(self, statement: str) -> None:
        if statement.startswith("INSERT"):
            raise sqlite3.OperationalError("database or disk is full")


def connect(database: Any, *arguments: Any, **options: Any) -> sqlite3.Connection:
    """A connection, to a full disk where the controls say so."""
    if any(part in str(database) for part in control("full", ())):
        options["factory"] = FullDisk
    connection = _connect(database, *arguments, **options)
    for part, pages in control("max_pages", {}).items():
        if part in str(database):
            connection.execute(f"PRAGMA max_page_count = {pages:d}")
    return connection


if __name__ == "__main__":  # a process of jobs imports this module, too
    grabberd_fake.grabber.World = world_of  # type: ignore[misc]
    grabberd_fake.grabber.DrawnAhead = world_of  # type: ignore[misc]
    CaptureWriter.commit = commit  # type: ignore[method-assign]
    SystemClock.utc_now = utc_now  # type: ignore[method-assign]
    sqlite3.connect = connect  # type: ignore[assignment]
    main()
