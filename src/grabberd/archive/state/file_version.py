"""Version of a database file, read without SQLite, and what is remembered of that version alone."""

import errno
import os
import threading
import weakref
from collections import OrderedDict
from collections.abc import Callable, Hashable
from contextlib import suppress
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")

_HEAD = 40
"""Bytes of the header that hold all that is read here."""
_FORMATS = slice(18, 20)
_ROLLBACK_JOURNAL = b"\x01\x01"
"""Write and read format of a file without a write-ahead log, which would not count its changes here."""
_CHANGES = slice(24, 40)
"""The change counter and what follows it: the bytes by which SQLite itself knows that its cache is old."""


class Version(NamedTuple):
    """A file and its content at one moment; two that are equal are of the same content.

    Attributes:
        identity: Device, inode, size and times of the file, which tell one that was put in its place.
        changes: Bytes of the header that every transaction changes.
    """

    identity: tuple[int, int, int, int, int]
    changes: bytes


class FileVersion:
    """Tells the version of a database file from moment to moment; it never waits for the disk.

    The file is held open: SQLite's locks belong to the process, and closing any descriptor of a file would
    drop those that other threads have on it.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._descriptor: int | None = None
        self._of: tuple[int, int] | None = None
        self._close: Callable[[], object] = lambda: None

    def now(self) -> Version | None:
        """The present version; None if it is not known at once, or the file does not count its changes.

        Contents are read only if they are in memory; the name is looked up, which in general it is, too.
        """
        with suppress(OSError), self._lock:
            found = os.stat(self._path)
            head = bytearray(_HEAD)
            # What is not in memory is not waited for: the event loop asks, and a disk may hang.
            read = os.preadv(self._opened(found), [head], 0, os.RWF_NOWAIT)
            if read == _HEAD and head[_FORMATS] == _ROLLBACK_JOURNAL:
                identity = (found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns)
                return Version(identity, bytes(head[_CHANGES]))
        return None

    def _opened(self, found: os.stat_result) -> int:
        """A descriptor of the file; another one if another file has taken its place."""
        if self._descriptor is None or self._of != (found.st_dev, found.st_ino):
            self._close()
            self._descriptor = descriptor = os.open(self._path, os.O_RDONLY | os.O_CLOEXEC)
            self._close = weakref.finalize(self, os.close, descriptor)
            opened = os.fstat(descriptor)
            self._of = (opened.st_dev, opened.st_ino)
            if self._of != (found.st_dev, found.st_ino):
                raise OSError(errno.ESTALE, os.strerror(errno.ESTALE), str(self._path))
        return self._descriptor


class NotRemembered(Exception):
    """A value cannot be told without reading the database."""


class Remembered(Generic[T]):
    """Values read of a database, kept as long as nobody changes anything in it; any thread may call.

    Args:
        version: Tells the version of the database's file.
        most: Number of values; the one that was asked for least recently is dropped.
    """

    def __init__(self, version: FileVersion, most: int) -> None:
        self._version = version
        self._most = most
        self._lock = threading.Lock()
        self._of: Version | None = None
        self._values: OrderedDict[Hashable, T] = OrderedDict()

    def get(self, key: Hashable, read: Callable[[], T | None], *, at_once: bool = False) -> T | None:
        """The value of a key, remembered or read; that there is none is not remembered.

        Args:
            key: Its key.
            read: Reads it from the database.
            at_once: True if the database must not be read.

        Raises:
            NotRemembered: It would have to be.
        """
        before = self._version.now()
        with self._lock:
            if before is not None and before == self._of and key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
        if at_once:
            raise NotRemembered
        value = read()
        # One before, another after: what was read is of either. After a transaction that is rolled back, the
        # next one makes the counter again what it was meanwhile, of another content.
        if value is not None and before is not None and before == self._version.now():
            self._enter(key, value, before)
        return value

    def _enter(self, key: Hashable, value: T, version: Version) -> None:
        with self._lock:
            if version != self._of:
                self._values.clear()
                self._of = version
            self._values[key] = value
            self._values.move_to_end(key)
            if len(self._values) > self._most:
                self._values.popitem(last=False)
