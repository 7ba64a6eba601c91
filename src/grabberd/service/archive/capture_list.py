"""The list of captures, page by page: captures that come or go do not shift the pages."""

import heapq
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

from grabberd.documents.captures import CaptureDocument
from grabberd.errors import NotFound
from grabberd.service.archive.archive import Archive
from grabberd.storage.state.annotation_store import Annotation
from grabberd.storage.state.capture_index import IndexEntry

AT_ONCE = 200
NOTHING = Annotation()


class Place(NamedTuple):
    """Position of a capture in the list, which starts with the greatest."""

    created_utc: str
    id: str


@dataclass(frozen=True, slots=True)
class CaptureQuery:
    """Conditions and limits of a page of captures.

    Attributes:
        limit: maximum number of captures.
        after: position of the previous page's last capture; None: from the newest.
        device: only those of this device.
        since_utc: only those that began then or later; ISO 8601 with milliseconds and Z.
        until_utc: only those that began before.
        search: only those with this text in id, note or labels, in capitals or not.
        pinned: only pinned ones, or only others.
    """

    limit: int = 100
    after: Place | None = None
    device: str | None = None
    since_utc: str | None = None
    until_utc: str | None = None
    search: str | None = None
    pinned: bool | None = None

    @property
    def begin(self) -> Place | None:
        """Position after which the page begins; None: from the newest."""
        given = (self.after, Place(self.until_utc, "") if self.until_utc else None)
        return min((place for place in given if place), default=None)

    def wants(self, document: CaptureDocument) -> bool:
        """True if a capture satisfies the conditions."""
        return (
            (self.after is None or place_of(document) < self.after)
            and self.device in (None, document.device)
            and (self.since_utc is None or document.created_utc >= self.since_utc)
            and (self.until_utc is None or document.created_utc < self.until_utc)
            and self._says(document.id, document.note, document.labels)
            and self.pinned in (None, document.pinned)
        )

    def may_want(self, entry: IndexEntry, said: Annotation) -> bool:
        """True if a finished capture may satisfy them, as far as is known without opening its file."""
        note = entry.note if said.note is None else said.note
        labels = json.loads(entry.labels) if said.labels is None else said.labels
        return (
            self.device in (None, entry.device)
            and self.pinned in (None, said.pinned)
            and self._says(entry.id, note, labels)
        )

    def _says(self, capture_id: str, note: str, labels: Mapping[str, str]) -> bool:
        """True if the text that is searched for occurs."""
        text = " ".join([capture_id, note, *labels, *labels.values()])
        return self.search is None or self.search.casefold() in text.casefold()


def list_captures(archive: Archive, query: CaptureQuery) -> tuple[list[CaptureDocument], Place | None]:
    """A page of captures, newest first, and the position of the next page; None after the last."""
    found = list(islice(filter(query.wants, _newest(archive, query)), query.limit + 1))
    shown = found[: query.limit]
    return shown, place_of(shown[-1]) if len(found) > query.limit else None


def place_of(document: CaptureDocument) -> Place:
    """Position of a capture in the list."""
    return Place(document.created_utc, document.id)


def _newest(archive: Archive, query: CaptureQuery) -> Iterator[CaptureDocument]:
    """Armed, running and indexed captures, merged, newest first."""
    current = {document.id: document for document in archive.current()}
    ended = (entry for entry in _indexed(archive, query) if entry.id not in current)
    documents = (document for entry in ended if (document := _document(archive, entry)) is not None)
    ordered = sorted(current.values(), key=place_of, reverse=True)
    yield from heapq.merge(ordered, documents, key=place_of, reverse=True)


def _indexed(archive: Archive, query: CaptureQuery) -> Iterator[IndexEntry]:
    after, said = query.begin, archive.annotations()
    while entries := archive.index.page(after, AT_ONCE):
        for entry in entries:
            if query.since_utc is not None and entry.created_utc < query.since_utc:
                return
            if query.may_want(entry, said.get(entry.id, NOTHING)):
                yield entry
        after = Place(entries[-1].created_utc, entries[-1].id)


def _document(archive: Archive, entry: IndexEntry) -> CaptureDocument | None:
    """A capture; None for one that has just been deleted, or whose file was removed by hand."""
    try:
        return archive.document(entry.id).model_copy(update={"created_utc": entry.created_utc})
    except NotFound:
        return None
