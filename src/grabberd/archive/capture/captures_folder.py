"""The folder of captures, told from any other that may take its place, and names of files that can be shown.

A folder that is renamed, deleted or unmounted must not be replaced by a new, empty one: captures would go
onto the wrong disk, unnoticed. So it has an id, which its lock file holds and the state database remembers.
A USB stick may bring any bytes as the name of a file; it gets one that can be shown, logged and sent.
"""

import logging
import os
import secrets
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote_from_bytes

from grabberd.errors import Cause, StorageError
from grabberd.files.disk import DirectoryLock, storage_errors, write_through

log = logging.getLogger(__name__)
ANY = ""
"""Remembered in place of an id: whatever folder is there is accepted, or a new one made."""
ACCEPT = "if it is meant to be so: grabberd storage accept"
_PLAIN = " !#$&'()+,-.=@[]^_`{}~"
"""Characters that a name keeps, beside letters and digits, when it has to be made plain."""
LONGEST_BYTES = 200
"""Of a name; longer ones leave no room for the endings that are added to them; file systems end at 255."""


class CapturesFolder:
    """The locked folder.

    Args:
        path: Its path.
        remembered: Returns the id of the expected folder; None: any, if this program has held none yet.
        remember: Stores the id of the folder that was taken.
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
        """True if the folder that is held is the one at its path."""
        return self._lock.in_place

    def take(self) -> bool:
        """Takes the folder if it is there and the right one; returns True unless it was held already.

        Raises:
            StorageError: It is gone or another one is in its place (with a cause), another program uses it,
                or it cannot be written. Nothing has been written.
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
        """Gives a folder without an id one and has it remembered; if it cannot now, later calls may."""
        with suppress(StorageError):
            self._id = id_of(self.path) or self._new_id()
            if self._remembered() != self._id:
                self._remember(self._id)

    def release(self) -> None:
        """Lets other programs have the folder."""
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
    """True if nothing is in a folder, as in that of an unmounted disk, or there is none."""
    try:
        return not any(folder.iterdir())
    except OSError:
        return True


def id_of(folder: Path) -> str | None:
    """Id of a folder of captures; None if it has none."""
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
    """The file under a name that can be shown; it is renamed if its own cannot.

    Bytes that cannot be shown are written as in URLs, %FF. None if it cannot be renamed: it is left alone.
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
        os.rename(path, plain)
    except OSError as error:
        log.error("%r stays unlisted, since it cannot be renamed: %s", os.fsencode(path), error)
        return None
    log.warning("%r has a name that cannot be shown, and is now %s", os.fsencode(path), plain.name)
    return plain
