"""Several captures at once: pages of a list with curves of width, tables for spreadsheets, and batches.

Captures that are added or deleted meanwhile do not shift pages; a batch continues after a failure.
"""

import csv
import io
import json
import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import tzinfo
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

from grabberd import runtime
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.catalogue.capture_catalogue import Count, Facets, Found
from grabberd.archive.catalogue.capture_query import CaptureQuery, Position
from grabberd.archive.export.point_grid import known_model
from grabberd.archive.export.table_files import cells
from grabberd.archive.state.index_entries import IndexEntry, check_widths
from grabberd.core.ledger import Outcome
from grabberd.core.reconstruction.section_width import SectionWidth, section_widths
from grabberd.documents.captures import (
    BatchDocument,
    BatchFailure,
    CaptureDocument,
    CaptureList,
    FacetsDocument,
    FacetValue,
)
from grabberd.errors import GrabberdError, NotFound, ReadingGivenUp
from grabberd.extension import extensions, load
from grabberd.files.reading import CURRENT, Patience, check_patience, within

_ATTEMPTS = 3
"""Attempts to get a page without captures whose files were removed by hand, which reading them reveals."""
LARGEST_PAGE = 4 << 20
"""Bytes of a page as JSON; with more it ends early, and the next page goes on from there."""
LONGEST_S = 10.0
"""Time after which a page ends early: what is described by then stays so for the next request."""
_ROWS_AT_ONCE = 100


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
        shown, passed = _shown(archive, current, entries, found.ids)
        if len(shown) == passed:
            break
    fit = max(min(passed, _fit(shown)), 1)
    if passed < len(found.ids) or fit < len(shown):
        return list_captures(archive, replace(query, limit=fit), days_in)
    widths = {one: check_widths(entry.widths) for one, entry in entries.items() if entry.widths}
    return CapturePage(shown, found, widths)


def _shown(
    archive: Archive,
    current: Mapping[str, CaptureDocument],
    entries: Mapping[str, IndexEntry],
    ids: Sequence[str],
) -> tuple[list[CaptureDocument], int]:
    """Documents, as many as are made in time, at least the first; and the number of ids that they are of."""
    shown: list[CaptureDocument] = []
    until_s = runtime.monotonic() + LONGEST_S
    for passed, one in enumerate(ids):
        try:
            with within(Patience(until_s if passed else None, outer=CURRENT.get())):
                document = _document(archive, current, entries, one)
        except ReadingGivenUp:
            check_patience("the list")
            if not passed:
                raise
            return shown, passed
        shown += [] if document is None else [document]
    return shown, len(ids)


def _fit(shown: Sequence[CaptureDocument]) -> int:
    """Number of documents that fit on a page, at least one."""
    sizes = accumulate(len(document.model_dump_json()) for document in shown)
    return max(sum(size <= LARGEST_PAGE for size in sizes), 1)


def _document(
    archive: Archive,
    current: Mapping[str, CaptureDocument],
    entries: Mapping[str, IndexEntry],
    capture_id: str,
) -> CaptureDocument | None:
    """Returns the document of a capture; None if it was deleted after the query."""
    if capture_id in current:
        return current[capture_id].in_list
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


def captures_csv(captures: Iterable[CaptureDocument]) -> str:
    """The captures as CSV, with a column for each label that any of them has, and those of extensions."""
    added: list[Columns] = [load(one.columns) for one in extensions() if one.columns]
    rows = [
        (_row(one), one.labels, [value for columns in added for value in columns(one).values()])
        for one in captures
    ]
    labels = sorted({name for _, own, _ in rows for name in own})
    text = io.StringIO()
    writer = csv.writer(text)
    head = [*_BEFORE_LABELS, *(f"label_{name}" for name in labels), *_AFTER_LABELS]
    writer.writerow(cells([*head, *(name for columns in added for name in columns(None))]))
    for (before, after), own, more in rows:
        writer.writerow(cells([*before, *(own.get(name, "") for name in labels), *after, *more]))
    return text.getvalue()


def each_capture(archive: Archive, query: CaptureQuery) -> Iterator[CaptureDocument]:
    """The captures of a query, read page by page.

    Raises:
        StorageError: The captures cannot be read.
    """
    left, after = query.limit, query.after
    while left:
        page = list_captures(archive, replace(query, limit=min(left, _ROWS_AT_ONCE), after=after))
        yield from page.captures
        left, after = left - len(page.found.ids), page.found.after
        if after is None:
            return


_BEFORE_LABELS = (
    *("id", "device", "created_utc", "state", "verdict", "fields", "received"),
    *("coverage_verdict", "share_found", "bits", "lines"),
)
_AFTER_LABELS = ("note", "pinned", "size_bytes")


def _row(capture: CaptureDocument) -> tuple[list[object], list[object]]:
    """A capture's cells before and after its labels."""
    covered = capture.coverage
    received = capture.ledger.counts.get(Outcome.RECEIVED, 0)
    before = [
        *(capture.id, capture.device, capture.created_utc, capture.state, capture.verdict or ""),
        *(capture.fields, received),
        *((covered.verdict, covered.share) if covered else ("", None)),
        *(capture.bits, capture.lines or ""),
    ]
    return before, [capture.note, str(capture.pinned).lower(), capture.size_bytes]


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


log = logging.getLogger(__name__)
SPAN_S = 6.0
"""Length of the curve, taken from the middle of the capture: several pulsations."""
MOST = 60
"""Maximum number of widths."""
_EVERY = 5
"""Fields per width; odd, so that both parities are used."""


class WidthCourses:
    """Computes the curves and stores them in the index.

    Args:
        archive: The captures.
    """

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self._sealed: deque[str] = deque()

    def of(self, capture_id: str) -> list[float | None]:
        """Widths of a sealed capture in mm, ten a second, from its middle; empty without points.

        Raises:
            NotFound: No capture has that id.
            Conflict: The capture is not sealed.
            CaptureFileError: The file is damaged.
            StorageError: The file cannot be read now.
        """
        path = self._archive.sealed_path(capture_id)
        entry = self._archive.index.get(capture_id)
        if not entry.widths:
            entry = entry._replace(widths=json.dumps(width_course(path)))
            self._keep(entry)
        return check_widths(entry.widths)

    def sealed(self, capture_id: str) -> None:
        """Queues a sealed capture: the next `look` computes its curve."""
        self._sealed.append(capture_id)

    def look(self) -> None:
        """Computes the curves of queued captures; called once a second."""
        while self._sealed:
            try:
                self.of(self._sealed.popleft())
            except GrabberdError as error:  # deleted or damaged: a request for the capture will report it
                log.info("a capture has no course of its width: %s", error.message)

    def _keep(self, entry: IndexEntry) -> None:
        try:
            self._archive.index.keep_widths(entry, entry.widths)
        except GrabberdError as error:  # a full disk: the curve is computed again for the next request
            log.info("the widths of capture %s are not kept: %s", entry.id, error.message)


def width_course(path: Path) -> list[float | None]:
    """Widths in mm between the outermost visible facing targets, ten a second; empty without points.

    Raises:
        CaptureFileError: The file cannot be read.
    """
    with CaptureReader(path) as reader:
        try:
            run = reader.run(None)
        except NotFound:
            return []
        model = known_model(run)
        if model is None:
            return []
        first_n = reader.first_n or 0
        fields = round(SPAN_S * reader.meta.rate_hz)
        middle = first_n + max(0, reader.field_span - fields) // 2
        begin = middle - middle % _EVERY
        timed = reader.timed_points(run.run, begin, begin + fields, _EVERY)
        found = {n: section_widths(points, model) for n, _, points in timed}
    numbers = range(begin, begin + fields, _EVERY)
    return _best([found.get(n, []) for n in numbers if n <= max(found, default=-1)][:MOST])


def _best(fields: list[list[SectionWidth]]) -> list[float | None]:
    """Widths of the pair that is visible in most fields, the outermost if there are several."""
    pairs = list(dict.fromkeys(one.targets for widths in fields for one in widths))
    courses = [[_of(widths, pair) for widths in fields] for pair in pairs]
    seen = [sum(width is not None for width in course) for course in courses]
    return courses[seen.index(max(seen))] if any(seen) else []


def _of(widths: list[SectionWidth], pair: tuple[int, int]) -> float | None:
    return next((round(one.width_mm, 2) for one in widths if one.targets == pair and one.width_mm), None)
