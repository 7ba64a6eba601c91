"""Lists captures page by page; captures that come or go meanwhile shift no page."""

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
from grabberd.storage.state.index_entries import IndexEntry

AT_ONCE = 200
"""Index entries read at once: one search over a large archive must not hold all of them in memory."""
NOTHING = Annotation()


class Position(NamedTuple):
    """Position of a capture in the list, which is sorted from the greatest down."""

    created_utc: str
    id: str


@dataclass(frozen=True, slots=True)
class CaptureQuery:
    """Filter of a list of captures; None filters nothing.

    Attributes:
        limit: Maximum number of results.
        after: Position of the last capture on the page before; None for the first page.
        device: Name of the device.
        since_utc: Earliest start; ISO 8601 with milliseconds and Z.
        until_utc: Time before which the captures started.
        search: Text in id, note or labels, ignoring case.
        pinned: True for pinned captures alone, False for the others alone.
    """

    limit: int = 100
    after: Position | None = None
    device: str | None = None
    since_utc: str | None = None
    until_utc: str | None = None
    search: str | None = None
    pinned: bool | None = None

    @property
    def start(self) -> Position | None:
        """Position after which the page starts; None for the newest capture."""
        # "" sorts before every id, so a capture that started at that very moment is left out.
        given = (self.after, Position(self.until_utc, "") if self.until_utc else None)
        return min((position for position in given if position), default=None)

    def matches(self, document: CaptureDocument) -> bool:
        """True if a capture belongs to the list."""
        return (
            (self.after is None or position_of(document) < self.after)
            and self.device in (None, document.device)
            and (self.since_utc is None or document.created_utc >= self.since_utc)
            and (self.until_utc is None or document.created_utc < self.until_utc)
            and self._contains(document.id, document.note, document.labels)
            and self.pinned in (None, document.pinned)
        )

    def may_match(self, entry: IndexEntry, annotation: Annotation) -> bool:
        """False if a capture certainly does not match, by what is known without opening its file."""
        note = entry.note if annotation.note is None else annotation.note
        labels = json.loads(entry.labels) if annotation.labels is None else annotation.labels
        return (
            self.device in (None, entry.device)
            and self.pinned in (None, annotation.pinned)
            and self._contains(entry.id, note, labels)
        )

    def _contains(self, capture_id: str, note: str, labels: Mapping[str, str]) -> bool:
        text = " ".join([capture_id, note, *labels, *labels.values()])
        return self.search is None or self.search.casefold() in text.casefold()


def list_captures(archive: Archive, query: CaptureQuery) -> tuple[list[CaptureDocument], Position | None]:
    """Returns a page of captures, newest first, and the position to go on from, or None for the last page."""
    found = list(islice(filter(query.matches, _newest(archive, query)), query.limit + 1))
    shown = found[: query.limit]
    return shown, position_of(shown[-1]) if len(found) > query.limit else None


def whole_list(archive: Archive, query: CaptureQuery) -> list[CaptureDocument]:
    """Returns the captures, newest first, up to the query's limit."""
    return list(islice(filter(query.matches, _newest(archive, query)), query.limit))


def position_of(document: CaptureDocument) -> Position:
    """Returns the position of a capture in the list."""
    return Position(document.created_utc, document.id)


def _newest(archive: Archive, query: CaptureQuery) -> Iterator[CaptureDocument]:
    """Yields armed, running and indexed captures in one order."""
    current = {document.id: document for document in archive.current()}
    ended = (listed for listed in _indexed(archive, query) if listed[0].id not in current)
    documents = (document for listed in ended if (document := _document(archive, *listed)) is not None)
    ordered = sorted(current.values(), key=position_of, reverse=True)
    yield from heapq.merge(ordered, documents, key=position_of, reverse=True)


def _indexed(archive: Archive, query: CaptureQuery) -> Iterator[tuple[IndexEntry, Annotation]]:
    after, annotations = query.start, archive.annotations()
    while True:
        entries = archive.index.page(after, AT_ONCE)
        for entry in entries:
            if query.since_utc is not None and entry.created_utc < query.since_utc:
                return
            annotation = annotations.get(entry.id, NOTHING)
            if query.may_match(entry, annotation):
                yield entry, annotation
        if len(entries) < AT_ONCE:  # the last page; to ask for one more would open the index again
            return
        after = Position(entries[-1].created_utc, entries[-1].id)


def _document(archive: Archive, entry: IndexEntry, annotation: Annotation) -> CaptureDocument | None:
    """Returns a capture's document; None if it was deleted since its entry was read."""
    try:
        # Pages are cut by the time in the index, so that is the time shown, whatever the file has.
        return archive.listed(entry, annotation).model_copy(update={"created_utc": entry.created_utc})
    except NotFound:
        return None
