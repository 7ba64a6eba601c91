"""Lists captures page by page; captures that come or go meanwhile shift no page."""

from collections.abc import Mapping
from datetime import tzinfo
from typing import NamedTuple

from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.capture_catalogue import Facets
from grabberd.archive.state.capture_query import CaptureQuery, Position
from grabberd.archive.state.index_entries import IndexEntry, check_widths
from grabberd.documents.captures import CaptureDocument
from grabberd.errors import NotFound

_ATTEMPTS = 3
"""Times that a page is asked for whose captures were removed by hand, which is noticed as they are shown."""


class CapturePage(NamedTuple):
    """A page of captures.

    Attributes:
        captures: Their documents, in order.
        after: Position to go on from; None on the last page.
        total: Number of captures that match.
        in_all: Number of captures.
        facets: What those that match have in common; None where nobody asked.
        widths_mm: Course of the wall's width by capture, as far as it is known.
    """

    captures: list[CaptureDocument]
    after: Position | None
    total: int
    in_all: int
    facets: Facets | None
    widths_mm: dict[str, list[float | None]]


def list_captures(archive: Archive, query: CaptureQuery, days_in: tzinfo | None = None) -> CapturePage:
    """Returns a page of armed, running and ended captures.

    Args:
        archive: The captures.
        query: Which of them.
        days_in: Time zone of days, to count values; None to count none.

    Raises:
        StorageError: They cannot be read.
    """
    for _ in range(_ATTEMPTS):
        current = {document.id: document for document in archive.current()}
        found = archive.library.ask(query, current.values(), days_in)
        entries = {
            entry.id: entry for entry in archive.index.some([i for i in found.ids if i not in current])
        }
        shown = [document for one in found.ids if (document := _document(archive, current, entries, one))]
        if len(shown) == len(found.ids):
            break
    widths = {one: check_widths(entry.widths) for one, entry in entries.items() if entry.widths}
    return CapturePage(shown, found.after, found.total, found.in_all, found.facets, widths)


def _document(
    archive: Archive,
    current: Mapping[str, CaptureDocument],
    entries: Mapping[str, IndexEntry],
    capture_id: str,
) -> CaptureDocument | None:
    """Returns the document of a capture; None if it was deleted since it was found."""
    if capture_id in current:
        return current[capture_id]
    if (entry := entries.get(capture_id)) is None:
        return None
    try:
        # Pages are cut by the time in the index, so that is the time shown, whatever the file has.
        return archive.listed(entry).model_copy(update={"created_utc": entry.created_utc})
    except NotFound:
        return None
