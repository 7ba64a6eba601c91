"""Files and folders on a disk: written for good, locked, and errors as an operator can act on them."""

import errno
import fcntl
import os
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from grabberd.errors import NO_PERMISSION, StorageError

OWNER_ONLY, READ_ONLY = 0o600, 0o444
"""Permissions of files."""
SCRATCH = ".part-"
"""Beginning of the names of folders that are being written."""


_DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def is_damaged(error: sqlite3.Error) -> bool:
    """True if the content of a database is to blame, and not its disk, or another program that holds it."""
    # The low byte; errors raised by the Python module itself have no code.
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _DAMAGE


def is_disk_error(error: BaseException | None) -> bool:
    """True if the disk could not read or write a database."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_IOERR


@contextmanager
def storage_errors(path: Path) -> Iterator[None]:
    """Turns errors of SQLite and of the system while writing into `StorageError`."""
    try:
        yield
    except (sqlite3.OperationalError, OSError) as error:
        raise StorageError(f"{path.name} cannot be written: {error}", _hint(error)) from error


def _hint(error: Exception) -> str:
    kept = "what was written before is kept and readable"
    # SQLite keeps the reason to itself: whether descriptors are to blame, only opening another file tells.
    number = error.errno if isinstance(error, OSError) else _error_of_opening()
    if number in (errno.EMFILE, errno.ENFILE):
        return f"no file descriptor is left: close clients, or raise the limit (ulimit -n); {kept}"
    if number in (errno.EACCES, errno.EPERM):
        return NO_PERMISSION
    return f"make room or fix the disk; {kept}"


def _error_of_opening() -> int | None:
    """Error number of opening any file; None if that is possible."""
    try:
        os.close(os.open(os.devnull, os.O_RDONLY))
    except OSError as error:
        return error.errno
    return None


def new_folder(directory: Path) -> None:
    """Makes a folder for results; an empty one that exists already is accepted.

    Raises:
        StorageError: It cannot be made, or is not empty.
    """
    with storage_errors(directory):
        directory.mkdir(parents=True, exist_ok=True)
        if any(directory.iterdir()):
            raise StorageError(
                f"the folder {directory} is not empty", "name a new one; nothing is overwritten"
            )


@contextmanager
def results_folder(directory: Path) -> Iterator[None]:
    """A folder for results as `new_folder` makes it, which is gone again if none are written.

    Raises:
        StorageError: See `new_folder`.
    """
    there_before = directory.exists()
    new_folder(directory)
    try:
        yield
    finally:
        if not there_before and directory.is_dir() and not any(directory.iterdir()):
            directory.rmdir()


@contextmanager
def scratch_folder(directory: Path, prefix: str = SCRATCH) -> Iterator[Path]:
    """A hidden folder in an existing one, which is removed afterwards unless it was renamed.

    It is on the same disk as what stays, so that a rename publishes what was written, whole or not at all.

    Raises:
        StorageError: It cannot be made.
    """
    with storage_errors(directory):
        scratch = Path(tempfile.mkdtemp(prefix=prefix, dir=directory))
    try:
        yield scratch
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def clear_scratch(directory: Path) -> None:
    """Creates `directory` if necessary, and removes the scratch folders that a crash left in it.

    Raises:
        StorageError: It cannot be written.
    """
    with storage_errors(directory):
        directory.mkdir(parents=True, exist_ok=True)
        for left in directory.glob(f"{SCRATCH}*"):
            shutil.rmtree(left)


def write_synced(path: Path, content: bytes, mode: int) -> None:
    """Writes a new file with these permissions and returns when it is on the disk."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def write_through(path: Path, content: bytes) -> None:
    """Writes into a file that exists and returns when it is on the disk."""
    with path.open("r+b") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def sync_directory(directory: Path) -> None:
    """Returns when the folder's names are on the disk.

    Renaming a file that was synchronised is not enough: the new name is an entry of the folder, which the
    system writes when it likes.
    """
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


NAME = ".lock"


class DirectoryLock:
    """Held from `acquire` to `release`, or until the process ends, however it ends.

    flock rather than a file with a process id: the kernel releases it with the process.
    """

    def __init__(self, directory: Path) -> None:
        self.path = directory / NAME
        self._descriptor: int | None = None

    def acquire(self) -> None:
        """Acquires the lock; does nothing if it is held already.

        Raises:
            StorageError: Another program holds it, or the folder cannot be written.
        """
        if self._descriptor is not None:
            return
        with storage_errors(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise StorageError(
                f"another grabberd uses {self.path.parent}",
                "stop it, or give this one a folder of its own (storage.directory)",
            ) from None
        self._descriptor = descriptor

    def release(self) -> None:
        """Releases the lock; does nothing if it is not held."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    @property
    def in_place(self) -> bool:
        """True if it is held, and the folder at its path is the one that it was acquired in."""
        if self._descriptor is None:
            return False
        try:
            there = os.stat(self.path)
        except OSError:
            return False
        return os.path.samestat(there, os.fstat(self._descriptor))


def is_for_want_of_memory(error: Exception) -> bool:
    """True if memory was lacking; OpenCV and SQLite have errors of their own for it."""
    return isinstance(error, MemoryError) or "insufficient memory" in str(error).lower()
