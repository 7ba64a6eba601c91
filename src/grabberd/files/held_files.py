"""Descriptors of files that SQLite may have open in this process: shared, and closed with the last user.

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
import sqlite3
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self, TypeVar

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
_lock = threading.Lock()
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
    return sqlite3.connect(
        uri, uri=True, isolation_level=None, check_same_thread=False, factory=factory, **options
    )
