"""The library: all captures as lists search them, kept up with file, annotations and analyses."""

import threading
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from datetime import tzinfo
from typing import Protocol

from grabberd.archive.state.annotation_store import Annotation
from grabberd.archive.state.capture_catalogue import CaptureCatalogue, Found, Row
from grabberd.archive.state.capture_index import CaptureIndex
from grabberd.archive.state.capture_query import CaptureQuery
from grabberd.archive.state.index_entries import DAMAGED_ENTRY, IndexEntry
from grabberd.documents.captures import CaptureDocument
from grabberd.files.json_value import read_json

_UNKNOWN = -1


class Results(Protocol):
    """Results that others make of captures, such as analyses."""

    def fields(self, capture_id: str) -> Mapping[str, object]:
        """Fields that they add to a capture's document."""
        ...

    def analysed(self, captures: Collection[str] | None) -> Collection[str]:
        """The captures that they have results of, among these or among all."""
        ...


class Library:
    """Answers questions about captures from memory; what has changed since is read before it answers.

    Args:
        index: The captures on disk.
        annotation: Returns the annotation of a capture by its id.
        annotations: Returns all annotations by their captures' ids.
        results: What others make of captures.
    """

    def __init__(
        self,
        index: CaptureIndex,
        annotation: Callable[[str], Annotation],
        annotations: Callable[[], Mapping[str, Annotation]],
        results: Results | None = None,
    ) -> None:
        self._analysed = results.analysed if results else lambda _: set[str]()
        self._index = index
        self._annotation = annotation
        self._annotations = annotations
        self._catalogue = CaptureCatalogue()
        self._stale: set[str] | None = None
        self._noting = threading.Lock()
        self._reading = threading.Lock()
        index.changed = self.note

    def note(self, capture_id: str | None = None) -> None:
        """Takes note that something about a capture, or about all, has changed; reads nothing."""
        with self._noting:
            if capture_id is None or self._stale is None:
                self._stale = None
            else:
                self._stale.add(capture_id)

    def ask(
        self, query: CaptureQuery, current: Iterable[CaptureDocument] = (), days_in: tzinfo | None = None
    ) -> Found:
        """Answers a question.

        Args:
            query: The question.
            current: Captures that are armed, being recorded or sealed.
            days_in: Time zone of days, to count values; None to count none.

        Raises:
            StorageError: The index or the annotations cannot be read.
        """
        with self._reading:
            self._read_what_changed()
        analysed = self._analysed({one.id for one in current})
        return self._catalogue.ask(query, [_current_row(one, one.id in analysed) for one in current], days_in)

    def _read_what_changed(self) -> None:
        known: Mapping[str, Annotation]
        with self._noting:
            stale, self._stale = self._stale, set()
        try:
            if stale is None:
                self._catalogue.replace(
                    self._rows(self._index.list(), self._annotations(), self._analysed(None))
                )
            elif stale:
                entries = self._index.some(sorted(stale))
                known, analysed = {one.id: self._annotation(one.id) for one in entries}, self._analysed(stale)
                self._catalogue.change(stale, self._rows(entries, known, analysed))
        except BaseException:
            self._put_back(stale)
            raise

    def _put_back(self, stale: set[str] | None) -> None:
        with self._noting:
            self._stale = None if stale is None or self._stale is None else self._stale | stale

    def _rows(
        self, entries: Sequence[IndexEntry], annotations: Mapping[str, Annotation], analysed: Collection[str]
    ) -> list[Row]:
        nothing = Annotation()
        return [_row(one, annotations.get(one.id, nothing), one.id in analysed) for one in entries]


def _row(entry: IndexEntry, annotation: Annotation, analysed: bool) -> Row:
    return Row(
        entry.id,
        entry.created_utc,
        entry.device,
        "damaged" if entry.state == DAMAGED_ENTRY else entry.verdict,
        annotation.pinned,
        analysed,
        entry.calibration,
        entry.runs > 0,
        entry.length,
        entry.losses,
        entry.size_bytes,
        entry.note if annotation.note is None else annotation.note,
        read_json(entry.labels) if annotation.labels is None else annotation.labels,
    )


def _current_row(document: CaptureDocument, analysed: bool) -> Row:
    """A capture in the making: what only its end decides is unknown."""
    return Row(
        document.id,
        document.created_utc,
        document.device,
        "",
        document.pinned,
        analysed,
        "",
        bool(document.runs),
        sum(document.ledger.counts.values()) if document.state != "armed" else _UNKNOWN,
        _UNKNOWN,
        document.size_bytes,
        document.note,
        document.labels,
    )
