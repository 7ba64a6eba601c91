"""Several captures as one ZIP file with readable names, generated while it is sent.

It is not compressed and takes little memory. Files that cannot be sent completely are listed in a text file
inside, so that nobody mistakes the archive for complete.
"""

import os
import re
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime, tzinfo
from functools import partial
from pathlib import Path
from typing import IO, NamedTuple, cast

from grabberd.archive.capture.schema import SUFFIX
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.catalogue.capture_list import captures_csv
from grabberd.documents.captures import CaptureDocument
from grabberd.errors import GrabberdError
from grabberd.files.disk import hold

_FIRST = ("name", "cow", "teat", "liner")
_LONGEST = 100
"""Longest name in characters; file systems allow 255 bytes."""
_UNFIT = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|]+')
"""Characters that are not allowed in file names on some system."""
MISSING = "MISSING.txt"
"""Name of the text file that lists incomplete files."""
_PIECE = 1 << 18
"""Number of bytes read at once."""
_CHANGED = "it was changed while being sent, so its copy in this archive is unusable; download it again"


def captures_zip(archive: Archive, captures: Sequence[str], zone: tzinfo) -> Iterator[bytes]:
    """The pieces of the ZIP file: a table of all captures, then the file of each.

    Args:
        archive: The captures.
        captures: Their ids; missing captures are listed in the ZIP file.
        zone: Time zone of the names.
    """
    documents = {one: document for one in dict.fromkeys(captures) if (document := _known(archive, one))}
    taken: set[str] = set()
    members = []
    for one in dict.fromkeys(captures):
        moment = _moment(documents.get(one), zone)
        name = _free(_name(documents[one], moment) if one in documents else one, taken)
        members.append(Member(f"{name}{SUFFIX}", moment, partial(archive.sealed_path, one), f"capture {one}"))
    yield from zip_stream([("captures.csv", captures_csv(list(documents.values())))], members)


def _known(archive: Archive, capture_id: str) -> CaptureDocument | None:
    try:
        return archive.document(capture_id).in_list
    except GrabberdError:  # it will be listed as missing
        return None


def _moment(document: CaptureDocument | None, zone: tzinfo) -> datetime:
    known = document is not None and document.created_utc
    return datetime.fromisoformat(known).astimezone(zone) if known else datetime(1980, 1, 1, tzinfo=zone)


def _name(document: CaptureDocument, moment: datetime) -> str:
    labels = document.labels
    others = [name for name in labels if name not in _FIRST]
    said = [
        labels[name] if name in ("name", "teat") else f"{name} {labels[name]}"
        for name in _ordered(labels, others)
    ]
    return _UNFIT.sub(" ", f"{moment:%Y-%m-%d %H.%M} {' '.join(said)}")[:_LONGEST].strip()


def _ordered(labels: dict[str, str], others: list[str]) -> list[str]:
    return [*(name for name in _FIRST if name in labels), *others]


def _free(name: str, taken: set[str]) -> str:
    """A unique name: the second of equal names gets a number."""
    numbers = (name if number == 1 else f"{name} ({number})" for number in range(1, len(taken) + 2))
    free = next(one for one in numbers if one.casefold() not in taken)
    taken.add(free.casefold())
    return free


class Member(NamedTuple):
    """A file to be sent.

    Attributes:
        name: Its name in the ZIP file.
        moment: Its time in the ZIP file.
        find: Returns its path; called when its turn comes.
        about: Name for messages.
    """

    name: str
    moment: datetime
    find: Callable[[], Path]
    about: str


class _Sink:
    """The unseekable file to which the ZIP file is written."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def write(self, data: bytes) -> int:
        """Appends bytes."""
        self._pieces.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Does nothing: there is no buffer."""

    def tell(self) -> int:
        """Fails as for a pipe, so that `zipfile` counts the bytes itself.

        Raises:
            OSError: Always.
        """
        raise OSError("nobody can go back in it")

    def take(self) -> bytes:
        """Bytes written since the last call."""
        taken, self._pieces = b"".join(self._pieces), []
        return taken


def zip_stream(texts: Iterable[tuple[str, str]], members: Iterable[Member]) -> Iterator[bytes]:
    """The pieces of a ZIP file.

    Args:
        texts: Names and contents of small text files, which come first.
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
    """Sends a file; adds the reason to `missing` if it is incomplete."""
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
