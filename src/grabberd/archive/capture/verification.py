"""Verification of capture files: is everything in them as it was written?

A daemon does it in a separate process with the lowest priority.
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
"""Maximum number of problems listed by SQLite."""


class Verification(NamedTuple):
    """Result of verifying a capture file.

    Attributes:
        fields: Number of intact fields.
        points: Number of fields with intact points, summed over all runs.
        readings: Number of intact readings of all channels.
        has_digests: False for files of earlier versions, in which a changed bit may go unnoticed.
        damages: Descriptions of all damage.
    """

    fields: int
    points: int
    readings: int
    has_digests: bool
    damages: list[str]


def verify(path: Path) -> Verification:
    """Reads a sealed capture completely and checks it against its digests.

    Raises:
        CaptureFileError: The file cannot be opened as a capture at all.
        StorageError: The file cannot be read now.
    """
    problems: list[str] = []
    left_out: list[Damage] = []
    runs: list[int] = []
    fields = points = readings = 0
    with closing(connect(path)) as connection:
        # On a capture of several days, statements take longer than the usual limit; here nobody waits.
        connection.longest_s = math.inf
        with _collected(path, problems):
            problems += _of_the_database(connection)
        with _collected(path, problems):
            read_meta(connection)
            problems += [f"{part}: {CHANGED}" for part in changed_parts(connection)]
        with _collected(path, problems):
            runs += [run for (run,) in connection.execute("SELECT run FROM runs ORDER BY run")]
        content = content_of(path, connection, left_out)
        with _collected(path, problems):
            fields = sum(1 for _ in content.fields(0, END))
            problems += content.unaccounted()
        for run in runs:
            with _collected(path, problems):
                points += content.measured(run)
        readings = _readings(path, RecordedChannels(path, connection, left_out), problems)
    damages = [*problems, *(one.in_words for one in left_out)]
    return Verification(fields, points, readings, content.has_digests, damages)


def _readings(path: Path, channels: RecordedChannels, problems: list[str]) -> int:
    """Reads all channels; returns the number of intact readings."""
    count = 0
    with _collected(path, problems):
        found = channels.all
        _ = channels.account  # raises if it is damaged
        for channel in found:
            with _collected(path, problems):
                count += sum(len(group.time_ns) for group in channels.groups(channel))
    return count


@contextmanager
def _collected(path: Path, problems: list[str]) -> Iterator[None]:
    """Adds errors from damaged content or a failing disk to the problems."""
    try:
        with reading_errors(path):
            yield
    except CaptureFileError as error:
        problems.append(f"{error.__cause__ or error.message}")
    except StorageError as error:
        if not is_disk_error(error.__cause__):
            raise  # such as a lock
        problems.append(f"the disk: {error.__cause__}")


def _of_the_database(connection: sqlite3.Connection) -> list[str]:
    # Digests cover the rows that are found; this finds damaged trees, in which rows may not be found.
    rows = connection.execute(f"PRAGMA integrity_check({_OF_DATABASE})").fetchall()
    return [f"the database: {words}" for (words,) in rows if words != "ok"]


CHECK = f"{__name__}:check_file"
"""The function that the low-priority process calls."""
_LONGEST_S, _BYTES_A_SECOND = 600.0, 1_000_000
"""Time limit for a file, plus its size at a tenth of a slow disk's speed, since other programs go first."""
_BEHIND = replace(HOSTILE, niceness=19, is_last=True)


def verify_files(paths: Iterable[Path]) -> Iterator[tuple[Path, Verification]]:
    """Verifies capture files, in order; an unreadable one is damaged.

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
    """Verifies a file without raising errors; called in the separate process."""
    try:
        return verify(path)
    except GrabberdError as error:
        return Verification(0, 0, 0, has_digests=False, damages=[error.message])
    except Exception as error:
        return Verification(0, 0, 0, has_digests=False, damages=[f"{type(error).__name__}: {error}"])
