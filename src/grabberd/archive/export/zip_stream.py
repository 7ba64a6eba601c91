"""Several files as one ZIP file that is made while it is sent: without compression, in little memory.

What cannot be sent whole is named in a text inside, so that nobody takes the archive for complete.
"""

import os
import zipfile
from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import IO, NamedTuple, cast

from grabberd.errors import GrabberdError
from grabberd.files.held_files import hold

MISSING = "MISSING.txt"
"""Name of the text that names what is not whole."""
_PIECE = 1 << 18
"""Bytes that are read at once."""
_CHANGED = "it was changed while being sent, so its copy in this archive is unusable; download it again"


class Member(NamedTuple):
    """A file to be sent.

    Attributes:
        name: Its name in the archive.
        moment: Its time there.
        find: Returns its path when its turn comes.
        about: Name by which a text speaks of it.
    """

    name: str
    moment: datetime
    find: Callable[[], Path]
    about: str


class _Sink:
    """Takes what the archive is written to; nobody can go back in it."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def write(self, data: bytes) -> int:
        """Takes some bytes."""
        self._pieces.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Does nothing: all is taken at once."""

    def tell(self) -> int:
        """Refuses, as a pipe does: the archive then counts for itself.

        Raises:
            OSError: Always.
        """
        raise OSError("nobody can go back in it")

    def take(self) -> bytes:
        """Bytes that have come since the last time."""
        taken, self._pieces = b"".join(self._pieces), []
        return taken


def zip_stream(texts: Iterable[tuple[str, str]], members: Iterable[Member]) -> Iterator[bytes]:
    """The pieces of an archive.

    Args:
        texts: Names and contents of small files, which come first.
        members: The files.
    """
    sink = _Sink()
    missing: list[str] = []
    with zipfile.ZipFile(cast("IO[bytes]", sink), "w", zipfile.ZIP_STORED) as archive:
        for name, text in texts:
            archive.writestr(name, text)
        for member in members:
            yield from _sent(archive, sink, member, missing)
        if missing:
            archive.writestr(MISSING, "\n".join(missing) + "\n")
        yield sink.take()
    yield sink.take()


def _sent(archive: zipfile.ZipFile, sink: _Sink, member: Member, missing: list[str]) -> Iterator[bytes]:
    """Sends a file, and notes in `missing` why it is not whole."""
    try:
        with hold(member.find()) as held:
            before = _version(held.descriptor)
            with archive.open(_info(member), "w", force_zip64=True) as entry:
                place = 0
                while piece := os.pread(held.descriptor, min(_PIECE, before[1] - place), place):
                    entry.write(piece)
                    place += len(piece)
                    yield sink.take()
            if place != before[1] or _version(held.descriptor) != before:
                missing.append(f"{member.about}: {_CHANGED}")
    except GrabberdError as error:
        missing.append(f"{member.about}: {error.message}")
    except OSError as error:
        missing.append(f"{member.about}: it cannot be read: {error.strerror}")


def _version(descriptor: int) -> tuple[int, int]:
    found = os.fstat(descriptor)
    return found.st_mtime_ns, found.st_size


def _info(member: Member) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(member.name, member.moment.timetuple()[:6])
    info.external_attr = 0o644 << 16
    return info
