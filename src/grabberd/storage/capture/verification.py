"""Verifying a capture file: is everything in it what was written?"""

import math
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import NamedTuple

from grabberd.errors import CaptureFileError, StorageError
from grabberd.reconstruction.points import Points
from grabberd.storage.capture.checked_rows import CheckedRows
from grabberd.storage.capture.codec import decode_points
from grabberd.storage.capture.digests import CHANGED, FIELDS, Damage, Row, changed_parts, points_prefix
from grabberd.storage.capture.meta import read_meta
from grabberd.storage.capture.reader import ALL_FIELDS, ALL_POINTS
from grabberd.storage.capture.rows import recorded_field
from grabberd.storage.capture.schema import connect, reading_errors
from grabberd.storage.disk import is_disk_error

_OF_DATABASE = 20
"""Findings that SQLite lists."""


class Verification(NamedTuple):
    """Findings of a capture file.

    Attributes:
        fields: Number of sound fields in it.
        points: Number of those that have sound points, of all runs.
        has_digests: False for files of earlier versions, in which a changed bit may go unnoticed.
        damages: What is not as it was written, in words.
    """

    fields: int
    points: int
    has_digests: bool
    damages: list[str]


def verify(path: Path) -> Verification:
    """Reads a sealed capture whole, and compares all of it with its digests.

    Raises:
        CaptureFileError: It cannot be opened as a capture at all.
        StorageError: It cannot be read now.
    """
    told: list[str] = []
    left_out: list[Damage] = []
    runs: list[int] = []
    fields = points = 0
    with closing(connect(path)) as connection:
        # A capture of days takes longer than any reader may; here nobody waits for a single statement.
        connection.longest_s = math.inf
        with _told(path, told):
            told += _of_the_database(connection)
        with _told(path, told):
            read_meta(connection)
            told += [f"{part}: {CHANGED}" for part in changed_parts(connection)]
        with _told(path, told):
            runs += [run for (run,) in connection.execute("SELECT run FROM runs ORDER BY run")]
        rows = CheckedRows(path, connection, left_out)
        with _told(path, told):
            fields = _number(rows.each(ALL_FIELDS, FIELDS, recorded_field))
        for run in runs:
            with _told(path, told):
                of_run = ALL_POINTS._replace(what="points" if run == 1 else f"points of run {run}")
                points += _number(rows.each(of_run, points_prefix(run), _decoded_points, run=run))
    return Verification(fields, points, rows.has_digests, [*told, *(one.in_words for one in left_out)])


def _decoded_points(row: Row) -> Points:
    _, _, count, data = row
    return decode_points(data, count)


@contextmanager
def _told(path: Path, told: list[str]) -> Iterator[None]:
    """Adds what damaged content raises, or a disk that cannot read it, to what is told of the file."""
    try:
        with reading_errors(path):
            yield
    except CaptureFileError as error:
        told.append(f"{error.__cause__ or error.message}")
    except StorageError as error:
        if not is_disk_error(error.__cause__):
            raise  # a lock, say
        told.append(f"the disk: {error.__cause__}")


def _of_the_database(connection: sqlite3.Connection) -> list[str]:
    # Digests tell of every row that is found; this tells of a tree in which not every way finds them.
    rows = connection.execute(f"PRAGMA integrity_check({_OF_DATABASE})").fetchall()
    return [f"the database: {words}" for (words,) in rows if words != "ok"]


def _number(items: Iterator[object]) -> int:
    return sum(1 for _ in items)
