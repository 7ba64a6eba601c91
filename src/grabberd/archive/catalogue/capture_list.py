"""Several captures at once: paginated lists, tables for spreadsheets, and batch operations.

Captures that are added or deleted meanwhile do not shift pages; a batch continues after a failure.
"""

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import tzinfo
from typing import NamedTuple

from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.catalogue.capture_catalogue import Count, Facets, Found
from grabberd.archive.catalogue.capture_query import CaptureQuery, Position
from grabberd.archive.export.table_files import cells
from grabberd.archive.state.index_entries import IndexEntry, check_widths
from grabberd.core.ledger import Outcome
from grabberd.documents.captures import (
    BatchDocument,
    BatchFailure,
    CaptureDocument,
    CaptureList,
    FacetsDocument,
    FacetValue,
)
from grabberd.errors import GrabberdError, NotFound
from grabberd.extension import extensions, load

_ATTEMPTS = 3
"""Attempts to get a page without captures whose files were removed by hand, which reading them reveals."""


class CapturePage(NamedTuple):
    """A page of captures.

    Attributes:
        captures: Their documents, in order.
        found: Result of the library.
        widths_mm: Curve of the wall's width by capture, where it is known.
    """

    captures: list[CaptureDocument]
    found: Found
    widths_mm: dict[str, list[float | None]]


def list_captures(archive: Archive, query: CaptureQuery, days_in: tzinfo | None = None) -> CapturePage:
    """Returns a page of armed, running and ended captures.

    Args:
        archive: The captures.
        query: Filter and order.
        days_in: Time zone of days, for counting values; None to count none.

    Raises:
        StorageError: The captures cannot be read.
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
    return CapturePage(shown, found, widths)


def _document(
    archive: Archive,
    current: Mapping[str, CaptureDocument],
    entries: Mapping[str, IndexEntry],
    capture_id: str,
) -> CaptureDocument | None:
    """Returns the document of a capture; None if it was deleted after the query."""
    if capture_id in current:
        return current[capture_id]
    if (entry := entries.get(capture_id)) is None:
        return None
    try:
        # The time in the index determines the page, so it is also the time shown.
        return archive.listed(entry).model_copy(update={"created_utc": entry.created_utc})
    except NotFound:
        return None


def list_document(page: CapturePage, cursor: Callable[[Position | None], str | None]) -> CaptureList:
    """A page as a document.

    Args:
        page: The page.
        cursor: Returns the cursor of a position.
    """
    found = page.found
    return CaptureList(
        captures=page.captures,
        next=cursor(found.after),
        total=found.total,
        in_all=found.in_all,
        facets=None if found.facets is None else _facets(found.facets),
        widths_mm=page.widths_mm,
    )


def _facets(found: Facets) -> FacetsDocument:
    return FacetsDocument(
        **{name: _values(counts) for name, counts in found.of.items()},
        days=_values(found.days),
        labels={name: _values(counts) for name, counts in found.labels.items()},
    )


def _values(counts: Iterable[Count]) -> list[FacetValue]:
    return [FacetValue(value=value, count=count) for value, count in counts]


Columns = Callable[[CaptureDocument | None], Mapping[str, object]]
"""Returns an extension's columns with the values of a capture; for None, only the names are used."""


def captures_csv(captures: Sequence[CaptureDocument]) -> str:
    """The captures as CSV, with a column for each label that any of them has, and those of extensions."""
    labels = sorted({name for capture in captures for name in capture.labels})
    added: list[Columns] = [load(one.columns) for one in extensions() if one.columns]
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(cells([*_head(labels), *(name for columns in added for name in columns(None))]))
    for capture in captures:
        more = (value for columns in added for value in columns(capture).values())
        writer.writerow(cells([*_row(capture, labels), *more]))
    return text.getvalue()


def _head(labels: Iterable[str]) -> list[object]:
    return [
        *("id", "device", "created_utc", "state", "verdict", "fields", "received"),
        *("coverage_verdict", "share_found", "bits", "lines"),
        *(f"label_{name}" for name in labels),
        *("note", "pinned", "size_bytes"),
    ]


def _row(capture: CaptureDocument, labels: Iterable[str]) -> list[object]:
    covered = capture.coverage
    received = capture.ledger.counts.get(Outcome.RECEIVED, 0)
    return [
        *(capture.id, capture.device, capture.created_utc, capture.state, capture.verdict or ""),
        *(capture.fields, received),
        *((covered.verdict, covered.share) if covered else ("", None)),
        *(capture.bits, capture.lines or ""),
        *(capture.labels.get(name, "") for name in labels),
        *(capture.note, str(capture.pinned).lower(), capture.size_bytes),
    ]


def for_each(captures: Iterable[str], act: Callable[[str], str | None]) -> BatchDocument:
    """Applies an operation to each capture, in order.

    Args:
        captures: Their ids, without regard to duplicates.
        act: Called with each id; returns the id of the job that it has queued, if any.
    """
    done: list[str] = []
    failed: list[BatchFailure] = []
    jobs: list[str] = []
    for one in dict.fromkeys(captures):
        try:
            job = act(one)
        except GrabberdError as error:
            failed.append(BatchFailure(capture=one, detail=error.message, hint=error.hint))
            continue
        done.append(one)
        jobs += [] if job is None else [job]
    return BatchDocument(done=done, failed=failed, jobs=jobs)
