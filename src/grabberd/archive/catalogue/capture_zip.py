"""Several captures as one ZIP file, under names that people recognise."""

import re
from collections.abc import Iterator, Sequence
from datetime import datetime, tzinfo
from functools import partial

from grabberd.archive.capture.schema import SUFFIX
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.catalogue.capture_table import captures_csv
from grabberd.archive.export.zip_stream import Member, zip_stream
from grabberd.documents.captures import CaptureDocument
from grabberd.errors import GrabberdError

_FIRST = ("name", "cow", "teat", "liner")
_LONGEST = 100
"""Characters of a name, of which file systems allow 255 bytes."""
_UNFIT = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|]+')
"""Characters that no file name may have somewhere."""


def captures_zip(archive: Archive, captures: Sequence[str], zone: tzinfo) -> Iterator[bytes]:
    """The pieces of the archive: each capture's file, and a table of all.

    Args:
        archive: The captures.
        captures: Their ids; one that is gone is named in the archive.
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
        return archive.document(capture_id)
    except GrabberdError:  # it is named when its turn comes
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
    """A name that no other capture has: the second of a name gets a number."""
    numbers = (name if number == 1 else f"{name} ({number})" for number in range(1, len(taken) + 2))
    free = next(one for one in numbers if one.casefold() not in taken)
    taken.add(free.casefold())
    return free
