"""The captures folder, identified so that no other can take its place, and printable file names.

A folder that is renamed, deleted or unmounted must not be replaced by a new, empty one: captures would be
written to the wrong disk, unnoticed. So it has an id, stored in its lock file and in the state database. File
names from a USB stick may be arbitrary bytes; they are changed so that they can be shown, logged and sent.
"""

import logging
import os
import secrets
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote_from_bytes

from grabberd import runtime
from grabberd.errors import Cause, StorageError
from grabberd.files.disk import DirectoryLock, storage_errors, write_through

log = logging.getLogger(__name__)
ANY = ""
"""Stored instead of an id: any folder is accepted, or a new one created."""
ACCEPT = "if it is meant to be so: grabberd storage accept"
_PLAIN = " !#$&'()+,-.=@[]^_`{}~"
"""Characters besides letters and digits that are kept when a name is made printable."""
LONGEST_BYTES = 200
"""Longest name, which leaves room for added suffixes; file systems allow 255 bytes."""


class CapturesFolder:
    """The locked folder.

    Args:
        path: Its path.
        remembered: Returns the id of the expected folder; None: any, if no folder was locked before.
        remember: Stores the id of the locked folder.
    """

    def __init__(
        self,
        path: Path,
        remembered: Callable[[], str | None] = lambda: None,
        remember: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.path = path
        self._lock = DirectoryLock(path)
        self._remembered = remembered
        self._remember = remember
        self._id: str | None = None

    @property
    def in_place(self) -> bool:
        """True if the locked folder is the one at its path."""
        return self._lock.in_place

    def take(self) -> bool:
        """Locks the folder if it is the right one; returns False if it was locked already.

        Raises:
            StorageError: The folder is missing or a different one (with a cause), is in use by another
                program, or cannot be written. Nothing has been written.
        """
        if self.in_place:
            return False
        self._check(self._expected())
        taken = DirectoryLock(self.path)
        taken.acquire()
        self._lock.release()
        self._lock = taken
        self.identify()
        return True

    def identify(self) -> None:
        """Creates the folder's id if needed and stores it; does nothing on errors, so call it again later."""
        with suppress(StorageError):
            self._id = id_of(self.path) or self._new_id()
            if self._remembered() != self._id:
                self._remember(self._id)

    def release(self) -> None:
        """Unlocks the folder."""
        self._lock.release()

    def _expected(self) -> str | None:
        with suppress(StorageError):
            if (known := self._remembered()) is not None:
                return known
        return self._id

    def _check(self, expected: str | None) -> None:
        if expected in (None, ANY):
            return
        if _is_empty(self.path):
            raise StorageError(
                f"the folder of captures {self.path} is gone: it was renamed, deleted or unmounted",
                f"put it back or mount its disk, and everything resumes on its own; {ACCEPT}",
                Cause.CAPTURES_MISSING,
            )
        if id_of(self.path) != expected:
            raise StorageError(
                f"{self.path} is not the folder of captures, but another one in its place",
                f"move it away and put the right one back, and everything resumes on its own; {ACCEPT}",
                Cause.CAPTURES_REPLACED,
            )

    def _new_id(self) -> str:
        given = secrets.token_hex(16)
        with storage_errors(self._lock.path):
            write_through(self._lock.path, f"{given}\n".encode())
        return given


def _is_empty(folder: Path) -> bool:
    """True if a folder is empty, like the mount point of an unmounted disk, or does not exist."""
    try:
        return not any(folder.iterdir())
    except OSError:
        return True


def id_of(folder: Path) -> str | None:
    """Id of a captures folder; None if it has none."""
    with suppress(OSError, ValueError):
        return DirectoryLock(folder).path.read_text(encoding="ascii").strip() or None
    return None


def is_plain(name: str) -> bool:
    """True if a name is UTF-8, printable and not too long."""
    try:
        return name.isprintable() and len(name.encode()) <= LONGEST_BYTES
    except UnicodeEncodeError:
        return False


def plainly_named(path: Path) -> Path | None:
    """Path of a file with a printable name; the file is renamed if necessary.

    Unprintable bytes are written as in URLs, %FF. None if the file cannot be renamed.
    """
    if is_plain(path.name):
        return path
    stem, *endings = os.fsencode(path.name).split(b".")
    ending = quote_from_bytes(b"".join(b"." + one for one in endings), safe=_PLAIN)[-20:]
    name = quote_from_bytes(stem, safe=_PLAIN)[: LONGEST_BYTES - 20]
    for number in range(1, 1000):
        plain = path.with_name(f"{name}{'' if number == 1 else f'-{number}'}{ending}")
        if not plain.exists():
            break
    try:
        runtime.rename(path, plain)
    except OSError as error:
        log.error("%r stays unlisted, since it cannot be renamed: %s", os.fsencode(path), error)
        return None
    log.warning("%r has a name that cannot be shown, and is now %s", os.fsencode(path), plain.name)
    return plain
