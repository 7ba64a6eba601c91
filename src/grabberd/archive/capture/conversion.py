"""Conversion of sealed captures of format 1 to the current format."""

import itertools
import os
import shutil
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from grabberd import runtime
from grabberd.archive.capture.content_digest import content_sha256
from grabberd.archive.capture.digests import write_sealed_digest
from grabberd.archive.capture.encodings import COLUMNS, quantised
from grabberd.archive.capture.meta import CONVERSION, SEALED, Conversion, write_meta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.rows import RecordedField
from grabberd.archive.capture.runs import alone
from grabberd.archive.capture.schema import (
    FORMAT_1,
    FREE_RESERVE,
    PART,
    VERSION,
    connect,
    format_of,
    reading_errors,
)
from grabberd.archive.capture.verification import verify
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.ledger import Slot
from grabberd.core.reconstruction.points import Points
from grabberd.errors import CaptureFileError, StorageError
from grabberd.files.disk import storage_errors, sync_directory

FOLDER = ".converting-"
_FIELDS_A_COMMIT = 500
_COPIED, _VERIFIED = 0.5, 0.75
"""Progress after copying and after verifying."""
T = TypeVar("T")
Progress = Callable[[float], None]


class Converted(NamedTuple):
    """Sizes of a capture before and after its conversion; equal if it had the current format already."""

    before_bytes: int
    after_bytes: int


def convert(path: Path, now: datetime, progress: Progress = lambda _: None) -> Converted:
    """Converts a sealed capture and replaces it once the new file has been compared with it completely.

    Pictures, times and ledger are unchanged; points are rounded to their quanta. If anything is damaged,
    differs or fails, the capture stays as it is. Readers that have it open continue with the old file.

    Args:
        path: The capture.
        now: Present time.
        progress: Called with the completed share of the work.

    Raises:
        CaptureFileError: The file is not a capture, damaged, or not sealed.
        StorageError: The file cannot be written, another program is adding a run, or the new file differs.
    """
    with reading_errors(path):
        before = path.stat()
    with CaptureReader(path) as reader, closing(connect(path)) as connection:
        if format_of(connection) != FORMAT_1:
            return Converted(before.st_size, before.st_size)
        _check(reader)
        with alone(path, before.st_ino), storage_errors(path), _folder(path) as folder:
            part = folder / f"{path.name}{PART}"
            _copy(reader, part, progress)
            _finish(connection, part, _conversion(reader, now))
            _compare(reader, part, progress)
            _replace(part, path)
    return Converted(before.st_size, path.stat().st_size)


@contextmanager
def _folder(path: Path) -> Iterator[Path]:
    """A hidden folder on the capture's disk; if a conversion was killed, the next one removes it."""
    folder = path.with_name(f"{FOLDER}{path.name}")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _check(reader: CaptureReader) -> None:
    if reader.meta.state != SEALED:
        hint = "seal it first: grabberd storage seal"
        raise CaptureFileError(f"{reader.path} is not sealed", hint)
    reader.check_unchanged()


def _conversion(reader: CaptureReader, now: datetime) -> Conversion:
    sha256 = content_sha256(reader.path, reader.meta)
    return Conversion(version=FORMAT_1, content_sha256=sha256, converted_utc=now.isoformat())


def _copy(reader: CaptureReader, part: Path, progress: Progress) -> None:
    """Writes fields and points like a running capture; each commit is read back."""
    # Without a reserve: if the disk is full, nothing is lost.
    writer = CaptureWriter.create(part, reader.meta, reserve_bytes=0)
    total = max(reader.field_count, 1) * (1 + reader.run_count)
    done = itertools.count(1)

    def written() -> None:
        if (fields := next(done)) % _FIELDS_A_COMMIT == 0:
            writer.commit()
            progress(_COPIED * fields / total)

    try:
        for recorded in reader.fields():
            writer.append([_slot(recorded)])
            written()
        for run in reader.run_numbers:
            for n, points in reader.points(run):
                writer.append_points(run, n, points)
                written()
        writer.commit()
    finally:
        writer.close()


def _slot(recorded: RecordedField) -> Slot:
    numbered = recorded.numbered
    return Slot(numbered, numbered.n, recorded.outcome, recorded.reason, (), numbered.time_ns)


def _finish(source: sqlite3.Connection, part: Path, conversion: Conversion) -> None:
    """Copies metadata, ledger and runs, and seals the file."""
    with closing(connect(part, writable=True)) as connection:
        connection.execute("BEGIN IMMEDIATE")
        connection.execute(FREE_RESERVE)
        for table, columns in (("ledger", 4), ("runs", 9)):
            rows = source.execute(f"SELECT * FROM {table}").fetchall()  # noqa: S608 - constants
            marks = ", ".join("?" * columns)
            connection.executemany(f"INSERT INTO {table} VALUES ({marks})", rows)  # noqa: S608 - constants
        kept = source.execute("SELECT key, value FROM meta WHERE key NOT GLOB 'digest.*'").fetchall()
        connection.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", kept)
        write_meta(connection, {CONVERSION: conversion.model_dump()})
        write_sealed_digest(connection)
        connection.execute("COMMIT")
        connection.execute("PRAGMA journal_mode = DELETE")


def _compare(reader: CaptureReader, part: Path, progress: Progress) -> None:
    """Checks the new file against its digests, and all of its content against the old file.

    Raises:
        StorageError: Something differs.
    """
    if damages := verify(part).damages:
        raise _mismatch(part, damages[0])
    progress(_VERIFIED)
    with CaptureReader(part) as new:
        one, other = reader.ledger, new.ledger
        whole = (new.meta, new.runs, other.received, other.entries, other.events)
        if whole != (reader.meta, reader.runs, one.received, one.entries, one.events):
            raise _mismatch(part, "its metadata, runs or ledger")
        _compare_fields(part, reader.fields(), new.fields())
        for run in reader.runs:
            _compare_points(part, reader.points(run.run), new.points(run.run))


def _compare_fields(part: Path, before: Iterable[RecordedField], after: Iterable[RecordedField]) -> None:
    for one, other in _pairs(part, before, after):
        packed, now = one.numbered.packed, other.numbered.packed
        about = (packed.bits, packed.columns, packed.parity, packed.y0, packed.y_step, packed.threshold)
        about_now = (now.bits, now.columns, now.parity, now.y0, now.y_step, now.threshold)
        same = one[1:] == other[1:] and one.numbered[:3] == other.numbered[:3] and about == about_now
        if not same or not np.array_equal(packed.data, now.data):
            raise _mismatch(part, f"field {one.numbered.n}")


def _compare_points(
    part: Path, before: Iterable[tuple[int, Points]], after: Iterable[tuple[int, Points]]
) -> None:
    for (n, one), (now, other) in _pairs(part, before, after):
        expected = quantised(one)
        arrays = ((getattr(expected, name), getattr(other, name)) for name in COLUMNS)
        if n != now or any(array.tobytes() != found.tobytes() for array, found in arrays):
            raise _mismatch(part, f"the points of field {n}")


def _pairs(part: Path, before: Iterable[T], after: Iterable[T]) -> Iterator[tuple[T, T]]:
    try:
        yield from zip(before, after, strict=True)
    except ValueError as error:
        raise _mismatch(part, f"the number of fields ({error})") from error


def _mismatch(part: Path, what: str) -> StorageError:
    hint = "the capture is kept as it was; check the disk and the memory of this computer, and report it"
    return StorageError(f"{part.name} converted to format {VERSION} differs: {what}", hint)


def _replace(part: Path, path: Path) -> None:
    """Replaces the old file, preserving its owner, permissions and times."""
    old = path.stat()
    if (old.st_uid, old.st_gid) != (os.geteuid(), os.getegid()):
        os.chown(part, old.st_uid, old.st_gid)
    shutil.copystat(path, part)  # retention counts a capture's age from its last change
    runtime.replace(part, path)
    sync_directory(path.parent)
