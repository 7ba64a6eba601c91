"""Captures that are recorded straight into somebody's folder, and what a kill leaves of them there."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from grabberd.errors import CaptureFileError, StorageError
from grabberd.storage.capture.crash_recovery import reason_of, recover
from grabberd.storage.capture.directory_lock import DirectoryLock
from grabberd.storage.capture.schema import DAMAGED, PART, sealed_path
from grabberd.storage.disk import storage_errors

PREFIX = ".grabberd-"


@contextmanager
def recording_folder(directory: Path) -> Iterator[Path]:
    """A hidden folder for a file that is being recorded; held against others, and gone afterwards.

    Raises:
        StorageError: it cannot be made.
    """
    with storage_errors(directory):
        folder = Path(tempfile.mkdtemp(dir=directory, prefix=PREFIX))
    lock = DirectoryLock(folder)
    lock.acquire()
    try:
        yield folder
    finally:
        lock.release()
        shutil.rmtree(folder, ignore_errors=True)


def leftovers(directory: Path) -> list[Path]:
    """Unsealed captures in a folder that a killed `grabberd capture` left; nobody writes them any more."""
    return [part for part in sorted(directory.glob(f"{PREFIX}*/*{PART}")) if _is_free(part.parent)]


def seal(part: Path) -> Path:
    """Seals a capture that was cut off, and puts it beside the hidden folder that it was recorded in.

    Raises:
        CaptureFileError: it is no `.grab.part`, cannot be read, or is of a later version; it is kept.
        StorageError: it is still being written, or there is a capture of its name.
    """
    if part.suffix != PART or not part.is_file():
        raise CaptureFileError(f"{part} is no capture that was cut off", "name a file NAME.grab.part")
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
    """Nobody else records into it; a folder that nobody ever held gets no lock file."""
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
