"""Hidden folders that `grabberd capture` records into without a daemon, and what a kill leaves there."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from grabberd.archive.capture.crash_recovery import reason_of, recover
from grabberd.archive.capture.schema import DAMAGED, PART, sealed_path
from grabberd.errors import CaptureFileError, StorageError
from grabberd.files.directory_lock import DirectoryLock
from grabberd.files.disk import scratch_folder, storage_errors

PREFIX = ".grabberd-"


@contextmanager
def recording_folder(directory: Path) -> Iterator[Path]:
    """A hidden folder for a file that is being recorded, locked against others and removed afterwards.

    The lock tells a capture in the making from one that a kill cut off: the system releases it with the
    process, however that ends.

    Raises:
        StorageError: It cannot be made.
    """
    with scratch_folder(directory, PREFIX) as folder:
        lock = DirectoryLock(folder)
        lock.acquire()
        try:
            yield folder
        finally:
            lock.release()


def interrupted_captures(directory: Path) -> list[Path]:
    """Unsealed captures in a folder that a killed `grabberd capture` left."""
    return [part for part in sorted(directory.glob(f"{PREFIX}*/*{PART}")) if _is_free(part.parent)]


def seal(part: Path) -> Path:
    """Seals an interrupted capture, and moves it next to the hidden folder that it was recorded in.

    Raises:
        CaptureFileError: It is no `.grab.part`, cannot be read, or is of a later version; it is kept.
        StorageError: It is still being written, or a capture of its name exists.
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
            os.rename(sealed, final)
    if hidden:
        shutil.rmtree(part.parent, ignore_errors=True)
    return final


@contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Locks a folder against recording; one that was never locked gets no lock file."""
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
