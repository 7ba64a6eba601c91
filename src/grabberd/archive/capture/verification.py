"""Verifying capture files: is everything in them what was written?

A daemon has it done in a process of its own, behind everybody else on this computer.
"""

import math
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from grabberd.archive.capture.checked_rows import END
from grabberd.archive.capture.digests import CHANGED, Damage, changed_parts
from grabberd.archive.capture.meta import read_meta
from grabberd.archive.capture.reader import content_of
from grabberd.archive.capture.recorded_channels import RecordedChannels
from grabberd.archive.capture.schema import connect, reading_errors
from grabberd.errors import CaptureFileError, GrabberdError, StorageError
from grabberd.files.disk import is_disk_error
from grabberd.work.process import HOSTILE, ask_each

_OF_DATABASE = 20
"""Findings that SQLite lists."""


class Verification(NamedTuple):
    """Findings of a capture file.

    Attributes:
        fields: Number of sound fields in it.
        points: Number of those that have sound points, of all runs.
        readings: Number of sound readings, of all channels.
        has_digests: False for files of earlier versions, in which a changed bit may go unnoticed.
        damages: What is not as it was written, in words.
    """

    fields: int
    points: int
    readings: int
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
    fields = points = readings = 0
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
        content = content_of(path, connection, left_out)
        with _told(path, told):
            fields = sum(1 for _ in content.fields(0, END))
            told += content.unaccounted()
        for run in runs:
            with _told(path, told):
                points += content.measured(run)
        readings = _readings(path, RecordedChannels(path, connection, left_out), told)
    damages = [*told, *(one.in_words for one in left_out)]
    return Verification(fields, points, readings, content.has_digests, damages)


def _readings(path: Path, channels: RecordedChannels, told: list[str]) -> int:
    """Reads all channels; returns the number of sound readings."""
    count = 0
    with _told(path, told):
        found = channels.all
        _ = channels.account  # damaged, it is told
        for channel in found:
            with _told(path, told):
                count += sum(len(group.time_ns) for group in channels.groups(channel))
    return count


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


CHECK = f"{__name__}:check_file"
"""The function that the process calls, which works behind everybody else."""
_LONGEST_S, _BYTES_A_SECOND = 600.0, 1_000_000
"""Time for a file beside that for its size, at a tenth of what a slow disk reads: others go first."""
_BEHIND = replace(HOSTILE, niceness=19, is_last=True)


def verify_files(paths: Iterable[Path]) -> Iterator[tuple[Path, Verification]]:
    """Findings of capture files, in order; one that cannot be read is damaged.

    Raises:
        StorageError: No process can be started.
    """
    for path, answer in ask_each(_BEHIND, CHECK, paths, _longest_s):
        if answer is None:
            reason = f"reading it ends the reader, or takes longer than {_longest_s(path):.0f} s"
            yield path, Verification(0, 0, 0, has_digests=False, damages=[reason])
        else:
            yield path, Verification(*answer)


def _longest_s(path: Path) -> float:
    size = path.lstat().st_size if path.exists() else 0
    return _LONGEST_S + size / _BYTES_A_SECOND


def check_file(path: Path) -> Verification:
    """Findings of a file, whatever becomes of reading it; called in a process of its own."""
    try:
        return verify(path)
    except GrabberdError as error:
        return Verification(0, 0, 0, has_digests=False, damages=[error.message])
    except Exception as error:
        return Verification(0, 0, 0, has_digests=False, damages=[f"{type(error).__name__}: {error}"])
