"""Entries of the index: what a list of captures shows of each file.

They are read in a process of its own, which is killed where a file holds it up.
"""

import json
from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

from grabberd.archive.capture.captures_folder import is_plain
from grabberd.archive.capture.crash_recovery import numbered, reason_of
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import DAMAGED, PART, SUFFIX
from grabberd.errors import CaptureFileError, LaterVersion, ReadingGivenUp, StorageError
from grabberd.files.disk import storage_errors
from grabberd.files.json_value import read_json
from grabberd.files.patience import Patience, within
from grabberd.work.process import HOSTILE, ask_each

SEALED_ENTRY, DAMAGED_ENTRY = "sealed", "damaged"
CAPTURES = (SUFFIX, SUFFIX + PART)
"""Endings of the files that are listed."""
LONGEST_REASON = 1000


class IndexEntry(NamedTuple):
    """One capture.

    Attributes:
        file: Path below the folder.
        state: "sealed" or "damaged".
        note: Note in the file, for searching.
        labels: Labels in the file as a JSON object, for searching.
        reason: Why it is damaged; empty if it is not.
        size_bytes: Size of the file when it was read, and `changed_ns`, when it, its name or its rights had
            last been changed, which nobody can set; −1 if it is read again each time.
        verdict: "complete" or "incomplete"; empty if it is damaged.
        length: Number of fields that should have come, and `losses`, of those that did not; −1 if unknown.
        runs: Number of runs.
        calibration: Id of the calibration of the newest run; empty if there is none.
        widths: Course of the wall's width as a JSON list, see `archive.export.width_course`; empty until
            somebody has asked for it.
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
        """True if the file need not be read again: same name, size and time of its last change."""
        # One whose id is not its name may be a copy: which of them has the id depends on all files.
        if self.state != SEALED_ENTRY or path.name != f"{self.id}{SUFFIX}":
            return False
        try:
            found = path.lstat()
        except OSError:
            return False
        return (found.st_size, found.st_ctime_ns) == (self.size_bytes, self.changed_ns)


def check_entry(entry: IndexEntry) -> None:
    """Checks an entry that was read from the index: a forged one could name any file, to be sent or deleted.

    Raises:
        ValueError: It is none that this program writes.
    """
    if not all(isinstance(text, str) for text in (*entry[:8], entry.verdict, *entry[-2:])):
        raise ValueError("an entry has what is no text")
    if not all(isinstance(number, int) for number in (entry.length, entry.losses, entry.runs)):
        raise ValueError("an entry has what is no number")
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
    """The course of the wall's width in an entry; none where there is no text.

    Raises:
        ValueError: It is no list of numbers.
    """
    widths = read_json(text) if text else []
    if not isinstance(widths, list) or not all(isinstance(width, float | int | None) for width in widths):
        raise ValueError("the widths of an entry are none")
    return widths


def entry_of(path: Path) -> IndexEntry:
    """A capture file's entry; one that cannot be read is damaged, with its file's name as id."""
    try:
        return sealed_entry(path)
    except (CaptureFileError, StorageError) as error:
        return damaged_entry(path, error.message)


def sealed_entry(path: Path) -> IndexEntry:
    """Entry of a file that can be read.

    Raises:
        CaptureFileError: It is damaged.
        StorageError: It cannot be read now.
    """
    with storage_errors(path):
        found = path.lstat()  # before it is read: what changes meanwhile is read again
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
    # Here, and not where it is read from the index, which would be made again and again because of it.
    try:
        check_entry(entry)
    except ValueError as error:
        raise CaptureFileError(f"{path} cannot be listed: {error}", "its metadata are damaged") from error
    return entry


def damaged_entry(path: Path, reason: str) -> IndexEntry:
    """Entry of a file that cannot be read."""
    folder = f"{DAMAGED}/" if path.parent.name == DAMAGED else ""
    short = reason[:LONGEST_REASON]
    name = path.name.split(".")[0] or path.name
    return IndexEntry(name, folder + path.name, "", "", DAMAGED_ENTRY, reason=short)


def aside_entry(path: Path) -> IndexEntry:
    """Entry of a file in the folder `damaged`, by the reason beside it."""
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
"""Time for one file, of which only some rows are read; a disk that has to spin up takes ten seconds."""
READ = f"{__name__}:read_entry"
"""The function that the process calls."""


class Reading(NamedTuple):
    """Outcome of reading a file.

    Attributes:
        path: The file.
        entry: Its entry.
        is_damage: True if its content is to blame, and no later version, lock or disk.
    """

    path: Path
    entry: IndexEntry
    is_damage: bool = False


def read_entries(paths: Iterable[Path], longest_s: float = LONGEST_S) -> Iterator[Reading]:
    """Reads the entries of capture files, in order.

    Args:
        paths: The files.
        longest_s: Time for each of them.

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
    """The entry of a file, after whether its content is to blame; called in a process of its own."""
    try:
        # Half the time: a statement that is too long ends by itself, with a reason.
        with within(Patience(monotonic() + longest_s / 2)):
            return [False, *sealed_entry(path)]
    except (LaterVersion, ReadingGivenUp, StorageError) as error:  # the file itself may be sound
        return [False, *damaged_entry(path, error.message)]
    except CaptureFileError as error:
        return [True, *damaged_entry(path, error.message)]
    except Exception as error:
        return [False, *damaged_entry(path, f"{type(error).__name__}: {error}")]
