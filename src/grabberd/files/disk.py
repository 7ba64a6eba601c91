"""Files and folders on a disk: written durably, locked, held open for SQLite; errors that tell what to do.

SQLite locks with `fcntl`. Such a lock belongs to the process, and closing any descriptor of the file drops
all that the process has on it, whoever opened it. A writer in the middle of a transaction would go on without
its lock; the next process to read the file would take its journal for one that a crash left, and roll back.

So whoever opens such a file by itself does it here, connections included. There is one entry for each file,
by device and inode as in SQLite, for as long as anybody holds it: a descriptor that was opened here is closed
only when no connection is left whose locks that could drop. Reading needs no lock of its own: `pread`.
"""

import errno
import fcntl
import os
import shutil
import sqlite3
import tempfile
from collections import deque
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any, Self, TypeVar

from grabberd import runtime
from grabberd.errors import NO_PERMISSION, StorageError

OWNER_ONLY, READ_ONLY = 0o600, 0o444
"""Permissions of files."""
SCRATCH = ".part-"
"""Beginning of the names of folders that are being written."""


_PIECE_BYTES = 1 << 20
_DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def is_damaged(error: sqlite3.Error, path: Path) -> bool:
    """True if the content of a database is to blame, and not its disk, or another program that holds it.

    It is read again: a disk that failed just then, for which SQLite blames the content, may work by now.
    """
    if not _speaks_of_damage(error) or not _can_be_read(path):
        return False
    try:
        uri = f"{path.absolute().as_uri()}?mode=rw"
        with closing(runtime.connect(uri, uri=True)) as connection:
            return connection.execute("PRAGMA quick_check(1)").fetchone() != ("ok",)
    except sqlite3.Error as again:
        return _speaks_of_damage(again) and _can_be_read(path)


def is_unreadable(error: sqlite3.Error, path: Path) -> bool:
    """True if the disk fails to read a database: SQLite says of that (EIO) that the content is damaged."""
    return _speaks_of_damage(error) and not _can_be_read(path)


def _speaks_of_damage(error: Exception) -> bool:
    # The low byte; errors raised by the Python module itself have no code.
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _DAMAGE


def _can_be_read(path: Path) -> bool:
    """True unless the disk fails."""
    try:
        with hold(path) as held:
            place = 0
            while piece := os.pread(held.descriptor, _PIECE_BYTES, place):
                place += len(piece)
    except OSError as error:
        return error.errno != errno.EIO
    return True


def is_disk_error(error: BaseException | None) -> bool:
    """True if the disk could not read or write a database."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_IOERR


@contextmanager
def storage_errors(path: Path, *, takes_damage: bool = True) -> Iterator[None]:
    """Turns errors of SQLite and of the system while writing into `StorageError`.

    Args:
        path: The file.
        takes_damage: False where a damaged database is another fault than one that cannot be written.
    """
    try:
        yield
    except (sqlite3.DatabaseError, OSError) as error:
        is_its = isinstance(error, sqlite3.OperationalError | OSError) or is_unreadable(error, path)
        if not is_its and not (takes_damage and _speaks_of_damage(error)):
            raise
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
        runtime.fsync(file.fileno())


def write_through(path: Path, content: bytes) -> None:
    """Writes into a file that exists and returns when it is on the disk."""
    with path.open("r+b") as file:
        file.write(content)
        file.flush()
        runtime.fsync(file.fileno())


def sync_directory(directory: Path) -> None:
    """Returns when the folder's names are on the disk.

    Renaming a file that was synchronised is not enough: the new name is an entry of the folder, which the
    system writes when it likes.
    """
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        runtime.fsync(descriptor)
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


_READ = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW
_NEW = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
_PERMISSIONS = 0o644
"""Those of files that SQLite creates."""
_ATTEMPTS = 10
"""Times that a file may be replaced by another while it is being opened."""

Key = tuple[int, int]


class _Held:
    """A file that is held.

    Attributes:
        key: Its device and inode; no other file has them as long as a descriptor is open.
        descriptors: Those opened so far. The first is read from; the others cannot be closed any earlier.
        holders: Number of those who hold it.
    """

    def __init__(self, key: Key) -> None:
        self.key = key
        self.descriptors: list[int] = []
        self.holders = 0


# Of the process, as the locks are.
_lock = runtime.lock()
_files: dict[Key, _Held] = {}
_ended: deque[_Held] = deque()


class Hold:
    """A share in a file's descriptors, from `hold` to `release`.

    Attributes:
        descriptor: For reading by place (`pread`); it must not be closed, nor locked.
    """

    def __init__(self, held: _Held) -> None:
        self._held: _Held | None = held
        self.descriptor = held.descriptors[0]
        self._key = held.key

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def is_at(self, path: Path) -> bool:
        """True if the file that is held is the one at a path.

        Raises:
            OSError: None is there, or it cannot be looked up.
        """
        return _key(path.lstat()) == self._key

    def release(self) -> None:
        """Ends the share; safe twice."""
        if (held := self._held) is not None:
            self._held = None
            _ended.append(held)
            _close_unused()

    def __del__(self) -> None:
        self.release()


def hold(path: Path) -> Hold:
    """Holds a file, which has to be no link.

    Raises:
        OSError: It cannot be opened.
    """
    key = _key(path.lstat())
    if (shared := _shared(key)) is not None:
        return shared
    # Outside the lock: a disk that hangs must not hold up those who read from another one.
    return _enter(os.open(path, _READ))


@contextmanager
def flocked(path: Path) -> Iterator[int]:
    """Locks a file by `flock` while the block lasts; gives a descriptor that must not be closed.

    Raises:
        BlockingIOError: Somebody else has it locked.
        OSError: It cannot be opened.
    """
    descriptor = os.open(path, _READ)  # of its own: whoever shares one shares its lock
    with _enter(descriptor):
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        try:
            yield descriptor
        finally:
            fcntl.flock(descriptor, fcntl.LOCK_UN)


def create(path: Path) -> Hold:
    """Creates an empty file and holds it.

    Raises:
        OSError: It exists, or cannot be created.
    """
    return _enter(os.open(path, _NEW, _PERMISSIONS))


def _shared(key: Key) -> Hold | None:
    """A share in a file that somebody holds already."""
    with _lock:
        if (held := _files.get(key)) is not None:
            held.holders += 1
    _close_unused()
    return None if held is None else Hold(held)


def _enter(descriptor: int) -> Hold:
    """A share in the file of a descriptor, which is not closed before anybody else's share has ended."""
    key = _key(os.fstat(descriptor))
    with _lock:
        held = _files.setdefault(key, _Held(key))
        held.descriptors.append(descriptor)
        held.holders += 1
    _close_unused()
    return Hold(held)


def _close_unused() -> None:
    """Closes the descriptors of files that nobody holds any longer."""
    # It never waits: the garbage collector may call it inside the lock. Whoever has the lock calls it after
    # releasing it, so that nothing is left.
    while _ended and _lock.acquire(blocking=False):
        try:
            while _ended:
                held = _ended.popleft()
                held.holders -= 1
                if not held.holders:
                    del _files[held.key]
                    # Inside the lock: nobody may open a connection to it in between.
                    for descriptor in held.descriptors:
                        os.close(descriptor)
        finally:
            _lock.release()


def _key(found: os.stat_result) -> Key:
    return found.st_dev, found.st_ino


class HeldConnection(sqlite3.Connection):
    """A connection that holds its file until SQLite has closed it."""

    _hold: Hold | None = None

    def keep(self, held: Hold) -> None:
        """Releases a hold with the end of the connection."""
        self._hold = held

    def close(self) -> None:
        """Rolls back what is not committed, closes the file and releases it; safe twice."""
        # A cursor that was not read to its end would keep the transaction alive, without its locks.
        with suppress(sqlite3.Error):
            self.rollback()
        super().close()
        if self._hold is not None:
            self._hold.release()

    def __del__(self) -> None:
        with suppress(sqlite3.Error):  # one whose opening has failed
            self.close()


C = TypeVar("C", bound=HeldConnection)


def connect(path: Path, factory: type[C], *, writable: bool = True, **options: Any) -> C:
    """Connects to a database that exists; it is in autocommit mode, and any thread may use it in turn.

    Args:
        path: Its file.
        factory: Class of the connection.
        writable: False if not even what a crash left unfinished may be rolled back.
        options: Further arguments of `sqlite3.connect`.

    Raises:
        sqlite3.Error: It cannot be opened.
        OSError: It cannot be opened, or is being replaced again and again.
    """
    for _ in range(_ATTEMPTS):
        held = hold(path)
        try:
            connection = _connected(path, factory, "rw" if writable else "ro", **options)
        except BaseException:
            held.release()
            raise
        connection.keep(held)
        # SQLite opens by the name, too. It takes no lock before the first statement: until then, the file may
        # turn out to be another one, that is not held.
        try:
            if held.is_at(path):
                return connection
        except OSError:
            connection.close()
            raise
        connection.close()
    raise OSError(errno.ESTALE, os.strerror(errno.ESTALE), str(path))


def _connected(path: Path, factory: type[C], mode: str, **options: Any) -> C:
    # Without a mode, SQLite would create an empty file in place of one that is being renamed just now.
    uri = f"{path.absolute().as_uri()}?mode={mode}"
    return runtime.connect(
        uri, uri=True, isolation_level=None, check_same_thread=False, factory=factory, **options
    )
