"""Crash recovery: unsealed captures are sealed, or set aside with a reason; nothing is ever deleted.

`grabberd capture` records without a daemon into a hidden folder, so that interrupted captures can be found.
"""

import itertools
import logging
import math
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from grabberd import runtime
from grabberd.archive.capture.digests import write_sealed_digest
from grabberd.archive.capture.meta import SEALED, CaptureMeta, write_meta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.recorded_channels import close_account, read_account, write_account
from grabberd.archive.capture.rows import write_ledger
from grabberd.archive.capture.salvage import SAVE
from grabberd.archive.capture.schema import DAMAGED, FREE_RESERVE, PART, connect, reading_errors, sealed_path
from grabberd.archive.capture.writer import FAILED, RUNNING, publish
from grabberd.archive.guarded_database import JOURNAL
from grabberd.core.ledger import Ledger, LedgerEntry, Outcome
from grabberd.errors import CaptureFileError, GrabberdError, LaterVersion, StorageError, count_of
from grabberd.files.disk import DirectoryLock, scratch_folder, storage_errors
from grabberd.runtime import Now
from grabberd.work.process import HOSTILE, ask_each

REASON = ".txt"
INTERRUPTED = "the program ended while it was recording"
UNSEALED = "the program ended before it was sealed"
PREFIX = ".grabberd-"
"""Prefix of the hidden folders for recording."""
_LONGEST_S, _BYTES_A_SECOND = 60.0, 2_000_000
"""Time for saving what is whole of a file, which delays the start, and that for its size."""

log = logging.getLogger(__name__)


class Tail(NamedTuple):
    """Last field on disk; the fields after it are missing.

    Attributes:
        after_n: Number of the last field on disk, whose time is known.
        time_ns: Its time, CLOCK_MONOTONIC.
    """

    after_n: int
    time_ns: int


def recover(part: Path, now: Now | None = None) -> Path:
    """Seals a `.grab.part` file that is no longer being written; returns its final path.

    SQLite rolls back an unfinished commit when the file is opened. For a capture of given length, the number
    of missing fields is known. Otherwise it is bounded by the time until now, measured by the monotonic clock
    if the computer has not been restarted since. A file that cannot be read is set aside, and what is whole
    of it, if anything, is sealed in its place.

    Args:
        part: The file.
        now: Present time; None: from the system's clocks.

    Raises:
        LaterVersion: The file was written by a later version.
        StorageError: The file cannot be written.
    """
    try:
        _seal_at_second_sight(part, now or Now.by_the_system())
    except LaterVersion:
        raise
    except CaptureFileError as error:
        aside = set_aside(part, error.message)
        return save_whole(aside, now) or aside
    return _published(part)


def _published(part: Path) -> Path:
    with storage_errors(part):
        # SQLite keeps the journal's file after its transaction (PERSIST), but a sealed capture is one file.
        part.with_name(part.name + JOURNAL).unlink(missing_ok=True)
        return publish(part)


def save_whole(aside: Path, now: Now | None = None) -> Path | None:
    """Seals what is whole of a file that was set aside, in its former place; None if nothing can be saved.

    It is read by another process, which may crash or take too long.

    Args:
        aside: The file in the folder `damaged`, where it stays.
        now: See `recover`.
    """
    part = aside.parent.parent / f"{sealed_path(aside).name}{PART}"
    if part.exists() or sealed_path(part).exists():
        return None
    try:
        [(_, fields)] = ask_each(HOSTILE, SAVE, [aside], _longest_s, part)
        if not fields:
            return None
        _seal_if_need_be(part, now or Now.by_the_system())
        saved = _published(part)
        with reason_of(aside).open("a", encoding="utf-8") as reason:
            reason.write(f"what is whole of it is in {saved.name}: {count_of(fields, 'field')}\n")
    except (GrabberdError, OSError, RuntimeError) as error:
        log.warning("nothing of %s could be saved: %s", aside.name, error)
        return None
    return saved


def _longest_s(path: Path) -> float:
    return _LONGEST_S + path.stat().st_size / _BYTES_A_SECOND


def _seal_at_second_sight(part: Path, now: Now) -> None:
    """Seals it; SQLite says of a disk that failed for a moment what it says of a damaged file."""
    try:
        _seal_if_need_be(part, now)
    except LaterVersion:
        raise
    except CaptureFileError:
        _seal_if_need_be(part, now)


def _seal_if_need_be(part: Path, now: Now) -> None:
    connect(part, writable=True).close()  # rolls back an unfinished commit, which a reader must not do
    with CaptureReader(part) as reader:
        ledger, meta, last = reader.ledger, reader.meta, reader.last_field
    if meta.state != SEALED:  # after a crash between sealing and renaming, only the name is missing
        with reading_errors(part):
            before_start = meta.extra.get("trigger", {}).get("n", 0)
            tail = Tail(*last) if last is not None else Tail(before_start - 1, meta.start_ns)
            _seal(part, *_cut_off(ledger, meta, tail, now))


def _seal(part: Path, ledger: Ledger, because: str) -> None:
    connection = connect(part, writable=True)
    try:
        with storage_errors(part, takes_damage=False), connection:
            connection.execute("BEGIN IMMEDIATE")
            connection.execute(FREE_RESERVE)
            write_ledger(connection, ledger)
            if (account := read_account(connection)) is not None:
                write_account(connection, close_account(connection, account))
            change = "UPDATE runs SET state = ?, reason = ? WHERE state = ?"
            connection.execute(change, (FAILED, INTERRUPTED, RUNNING))
            verdict = {"state": SEALED, "complete": ledger.complete, "ended_because": because}
            write_meta(connection, verdict)
            write_sealed_digest(connection)
    finally:
        connection.close()


def _cut_off(ledger: Ledger, meta: CaptureMeta, tail: Tail, now: Now) -> tuple[Ledger, str]:
    """The ledger up to the requested length, and why the capture ended."""
    end_n, order = ledger.end_n or 0, meta.extra.get("order", {})
    ordered = order["fields"] if order else None
    if ordered is not None and not isinstance(ordered, int):
        raise ValueError(f"order is {order!r}")
    if ordered is None:
        reason = f"{INTERRUPTED}; unknown{_bound(end_n, meta, tail, now)}"
        ledger.add(LedgerEntry(end_n, 1, Outcome.LOST, reason))
        return ledger, INTERRUPTED
    ledger.close(ordered, INTERRUPTED)
    return ledger, INTERRUPTED if end_n < ordered else UNSEALED


def _bound(end_n: int, meta: CaptureMeta, tail: Tail, now: Now) -> str:
    """Upper bound, in words, on the number of fields missing at the end; empty if there is none.

    Only the monotonic clock proves a bound, and only if the computer was not restarted: the wall clock may
    have been set back unnoticed.
    """
    if meta.device.get("stream", {}).get("waits_for_reader"):
        return ""  # it has no rate
    if meta.boot_id and meta.boot_id == now.boot_id:
        since_ns, condition = now.ns - tail.time_ns, ""
    else:
        since_start_s = (now.utc - datetime.fromisoformat(meta.created_utc)).total_seconds()
        since_ns = meta.start_ns + round(since_start_s * 1e9) - tail.time_ns
        condition = " unless the clock was set back"
    if since_ns < 0:
        return ""
    # One more than the interval holds: neither time is exactly that of a field.
    last_n = tail.after_n + math.floor(since_ns * meta.rate_hz / 1e9) + 1
    most = last_n + 1 - end_n
    return f", at most {most}{condition}" if most > 0 else ""


def set_aside(path: Path, reason: str) -> Path:
    """Moves an unreadable file into the folder `damaged`, with the reason in a text file beside it.

    Raises:
        StorageError: The file cannot be moved; it stays in place.
    """
    with storage_errors(path):
        folder = path.parent / DAMAGED
        folder.mkdir(exist_ok=True)
        aside = _free_name(folder / path.name)
        reason_of(aside).write_text(reason + "\n", encoding="utf-8")
        journal = path.with_name(path.name + JOURNAL)
        if journal.exists():  # repairing the database needs it
            runtime.rename(journal, aside.with_name(aside.name + JOURNAL))
        runtime.rename(path, aside)
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


@contextmanager
def recording_folder(directory: Path) -> Iterator[Path]:
    """A hidden, locked folder for a file that is being recorded; removed afterwards.

    The lock distinguishes a running capture from an interrupted one: the system releases it when the process
    ends for any reason.

    Raises:
        StorageError: The folder cannot be created.
    """
    with scratch_folder(directory, PREFIX) as folder:
        lock = DirectoryLock(folder)
        lock.acquire()
        try:
            yield folder
        finally:
            lock.release()


def interrupted_captures(directory: Path) -> list[Path]:
    """Unsealed captures in a folder, left by a killed `grabberd capture`."""
    return [part for part in sorted(directory.glob(f"{PREFIX}*/*{PART}")) if _is_free(part.parent)]


def seal(part: Path) -> Path:
    """Seals an interrupted capture, and moves it next to the hidden folder that it was recorded in.

    Raises:
        CaptureFileError: The file is not a `.grab.part`, unreadable, or of a later version; it is kept.
        StorageError: The file is still being written, or a capture with its name exists.
    """
    if part.suffix != PART or not part.is_file():
        raise CaptureFileError(f"{part} is not an interrupted capture", "name a file NAME.grab.part")
    hidden = part.parent.name.startswith(PREFIX)
    home = part.parent.parent if hidden else part.parent
    final = home / sealed_path(part).name
    if final.exists():
        raise StorageError(f"{final} exists already", "move it away first; nothing is overwritten")
    with _held(part.parent):
        sealed = recover(part)
        if sealed.parent.name == DAMAGED:
            reason = reason_of(sealed).read_text(encoding="utf-8").strip()
            raise CaptureFileError(reason, f"it is kept as {sealed}")
        with storage_errors(final):
            runtime.rename(sealed, final)
    if hidden and not (part.parent / DAMAGED).exists():
        shutil.rmtree(part.parent, ignore_errors=True)
    return final


@contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Locks a folder against recording; creates no lock file in a folder that has none."""
    lock = DirectoryLock(folder)
    if lock.path.exists():
        lock.acquire()
    try:
        yield
    finally:
        lock.release()


def _is_free(folder: Path) -> bool:
    try:
        with _held(folder):
            return True
    except StorageError:
        return False
