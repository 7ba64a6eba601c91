"""Entries of the index: the properties of each file that lists of captures show.

They are read in a separate process, which is killed if a file makes it hang.
"""

import json
from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from grabberd import runtime
from grabberd.archive.capture.captures_folder import is_plain
from grabberd.archive.capture.crash_recovery import numbered, reason_of
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import DAMAGED, PART, SUFFIX
from grabberd.errors import CaptureFileError, LaterVersion, ReadingGivenUp, StorageError
from grabberd.files.disk import storage_errors
from grabberd.files.reading import Patience, read_json, within
from grabberd.work.process import HOSTILE, ask_each

SEALED_ENTRY, DAMAGED_ENTRY = "sealed", "damaged"
CAPTURES = (SUFFIX, SUFFIX + PART)
"""Suffixes of listed files."""
LONGEST_REASON = 1000


class IndexEntry(NamedTuple):
    """One capture.

    Attributes:
        file: Path below the folder.
        state: "sealed" or "damaged".
        note: Note in the file, for searching.
        labels: Labels in the file as a JSON object, for searching.
        reason: Why it is damaged; empty if it is not.
        size_bytes: Size of the file when it was read; −1 if it must be read again each time.
        changed_ns: Its change time (ctime) then, which programs cannot set; −1 likewise.
        verdict: "complete" or "incomplete"; empty if it is damaged.
        length: Number of expected fields, and `losses`, of those not received; −1 if unknown.
        runs: Number of runs.
        calibration: Id of the calibration of the newest run; empty if there is none.
        widths: Curve of the wall's width as a JSON list, see `catalogue.capture_list`; empty until it is
            first requested.
    """

    id: str
    file: str
    device: str
    created_utc: str
    state: str
    note: str = ""
    labels: str = "{}"
    reason: str = ""
    size_bytes: int = -1
    changed_ns: int = -1
    verdict: str = ""
    length: int = -1
    losses: int = -1
    runs: int = 0
    calibration: str = ""
    widths: str = ""

    def still_holds(self, path: Path) -> bool:
        """True if the file need not be read again: its name, size and change time are the same."""
        # A file whose id is not its name may be a copy: which of them gets the id depends on all files.
        if self.state != SEALED_ENTRY or path.name != f"{self.id}{SUFFIX}":
            return False
        try:
            found = path.lstat()
        except OSError:
            return False
        return (found.st_size, found.st_ctime_ns) == (self.size_bytes, self.changed_ns)


def check_entry(entry: IndexEntry) -> None:
    """Checks an entry from the index: a forged one could name any file, to be downloaded or deleted.

    Raises:
        ValueError: The entry is invalid.
    """
    if not all(isinstance(text, str) for text in (*entry[:8], entry.verdict, *entry[-2:])):
        raise ValueError("an entry has a value that is not text")
    if not all(isinstance(number, int) for number in (entry.length, entry.losses, entry.runs)):
        raise ValueError("an entry has a value that is not a number")
    name = entry.file.removeprefix(f"{DAMAGED}/")
    if not is_plain(name) or "/" in name or not name.endswith(CAPTURES):
        raise ValueError(f"it names the file {entry.file!r}")
    if entry.state not in (SEALED_ENTRY, DAMAGED_ENTRY) or not all(map(str.isprintable, entry[:5])):
        raise ValueError(f"the entry of {name} is damaged")
    if entry.state == SEALED_ENTRY and datetime.fromisoformat(entry.created_utc).tzinfo is None:
        raise ValueError(f"the time of {name} is {entry.created_utc!r}, without a zone")
    labels = read_json(entry.labels)
    if not all(isinstance(text, str) for text in labels.values()):
        raise ValueError(f"the labels of {name} are {labels!r}")
    check_widths(entry.widths)


def check_widths(text: str) -> list[float | None]:
    """Parses the curve of the wall's width in an entry; empty for an empty text.

    Raises:
        ValueError: The text is not a list of numbers.
    """
    widths = read_json(text) if text else []
    if not isinstance(widths, list) or not all(isinstance(width, float | int | None) for width in widths):
        raise ValueError("the widths of an entry are invalid")
    return widths


def entry_of(path: Path) -> IndexEntry:
    """A capture file's entry; an unreadable file is damaged, with its name as id."""
    try:
        return sealed_entry(path)
    except (CaptureFileError, StorageError) as error:
        return damaged_entry(path, error.message)


def sealed_entry(path: Path) -> IndexEntry:
    """Entry of a readable file.

    Raises:
        CaptureFileError: The file is damaged.
        StorageError: The file cannot be read now.
    """
    with storage_errors(path):
        found = path.lstat()  # before reading, so that a file that changes meanwhile is read again
    with CaptureReader(path) as reader:
        meta = reader.meta
        entry = IndexEntry(
            meta.id,
            path.name,
            str(meta.device["name"]),
            meta.created_utc,
            SEALED_ENTRY,
            meta.note,
            json.dumps(meta.labels, ensure_ascii=False),
            size_bytes=found.st_size,
            changed_ns=found.st_ctime_ns,
            verdict="complete" if meta.complete else "incomplete",
            length=reader.length,
            losses=reader.losses,
            runs=reader.run_count,
            calibration=reader.calibration_id,
        )
    # Checked before it enters the index, which would otherwise be rebuilt again and again because of it.
    try:
        check_entry(entry)
    except ValueError as error:
        raise CaptureFileError(f"{path} cannot be listed: {error}", "its metadata are damaged") from error
    return entry


def damaged_entry(path: Path, reason: str) -> IndexEntry:
    """Entry of an unreadable file."""
    folder = f"{DAMAGED}/" if path.parent.name == DAMAGED else ""
    short = reason[:LONGEST_REASON]
    name = path.name.split(".")[0] or path.name
    return IndexEntry(name, folder + path.name, "", "", DAMAGED_ENTRY, reason=short)


def aside_entry(path: Path) -> IndexEntry:
    """Entry of a file in the folder `damaged`, with the reason stored beside it."""
    try:
        with reason_of(path).open(encoding="utf-8", errors="replace") as file:
            reason = file.read(LONGEST_REASON).strip()
    except OSError:
        reason = f"it lies in the folder {DAMAGED}, without a reason beside it"
    return damaged_entry(path, reason)


def distinct(entries: Iterable[IndexEntry]) -> Iterator[IndexEntry]:
    """Entries with distinct ids: a second file of the same id, such as a copy, gets `ID-2` and so on."""
    taken: set[str] = set()
    for entry in entries:
        free = next(name for name in numbered(entry.id) if name not in taken)
        taken.add(free)
        yield entry._replace(id=free)


LONGEST_S = 30.0
"""Time limit for one file, of which only some rows are read; a disk may need ten seconds to spin up."""
READ = f"{__name__}:read_entry"
"""The function that the process calls."""


class Reading(NamedTuple):
    """Result of reading a file.

    Attributes:
        path: The file.
        entry: Its entry.
        is_damage: True if its content is damaged; False for a later version, a lock or a failing disk.
    """

    path: Path
    entry: IndexEntry
    is_damage: bool = False


def read_entries(paths: Iterable[Path], longest_s: float = LONGEST_S) -> Iterator[Reading]:
    """Reads the entries of capture files, in order.

    Args:
        paths: The files.
        longest_s: Time limit for each.

    Raises:
        StorageError: No process can be started.
    """
    for path, answer in ask_each(HOSTILE, READ, paths, lambda _: longest_s, longest_s):
        if answer is None:
            reason = f"reading it ends the reader, or takes longer than {longest_s:g} s"
            yield Reading(path, damaged_entry(path, reason))
        else:
            is_damage, *entry = answer
            yield Reading(path, IndexEntry(*entry), is_damage)


def read_entry(path: Path, longest_s: float) -> list[Any]:
    """`is_damage` and the entry of a file; called in the separate process."""
    try:
        # Half of the time limit, so that a slow statement is interrupted with a reason.
        with within(Patience(runtime.monotonic() + longest_s / 2)):
            return [False, *sealed_entry(path)]
    except (LaterVersion, ReadingGivenUp, StorageError) as error:  # the file itself may be sound
        return [False, *damaged_entry(path, error.message)]
    except CaptureFileError as error:
        return [True, *damaged_entry(path, error.message)]
    except Exception as error:
        return [False, *damaged_entry(path, f"{type(error).__name__}: {error}")]
