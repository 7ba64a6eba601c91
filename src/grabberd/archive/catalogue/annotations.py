"""Pins, notes, labels and marks of captures, and manual deletion."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.state_database import AnnotationStore
from grabberd.documents.captures import CaptureDocument
from grabberd.documents.document import MOST_LABELS, MOST_MARKS
from grabberd.errors import Conflict, InputError

if TYPE_CHECKING:
    from grabberd.work.job_queue import JobQueue


class CaptureAnnotations:
    """Annotates and deletes captures.

    Annotations are stored in the state database; they never change a sealed file.

    Args:
        archive: The captures.
        annotations: Their annotations.
        jobs: The jobs, some of which may need the captures.
        remove_results: Called with each deleted capture, to remove its results.
    """

    def __init__(
        self,
        archive: Archive,
        annotations: AnnotationStore,
        jobs: "JobQueue",
        remove_results: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._archive = archive
        self._annotations = annotations
        self._jobs = jobs
        self._remove_results = remove_results

    def annotate(
        self,
        capture_id: str,
        *,
        pinned: bool | None = None,
        note: str | None = None,
        labels: Mapping[str, str | None] | None = None,
        marks: Mapping[str, str | None] | None = None,
    ) -> None:
        """Changes what is given and leaves the rest unchanged.

        Args:
            capture_id: Id of the capture, which may be running.
            pinned: True to keep the capture until it is unpinned.
            note: New note.
            labels: Labels to add or replace by name; None removes one.
            marks: Names of fields to mark, by number; None removes a mark.

        Raises:
            NotFound: No capture has that id.
            InputError: The capture would have too many labels or marks, or a marked field does not exist.
            StorageError: The state cannot be written.
        """
        document = self._archive.document(capture_id)
        annotation = self._annotations.get(capture_id)
        if pinned is not None:
            annotation = replace(annotation, pinned=pinned)
        if note is not None:
            annotation = replace(annotation, note=note)
        if labels is not None:
            annotation = replace(annotation, labels=_merged(document, labels))
        if marks is not None:
            annotation = replace(annotation, marks=_marked(document, annotation.marks, marks))
        self._annotations.put(capture_id, annotation)
        self._archive.library.note(capture_id)

    def spared(self) -> set[str]:
        """Returns the ids of captures that retention must keep: pinned ones and those needed by a job.

        Raises:
            StorageError: The state cannot be read.
        """
        pinned = {capture_id for capture_id, one in self._annotations.all().items() if one.pinned}
        return pinned | self._jobs.busy_subjects()

    def delete(self, capture_id: str) -> None:
        """Deletes a capture permanently: its file, its results and its annotations.

        Raises:
            NotFound: No capture has that id.
            Conflict: The capture is running, pinned, or needed by a job.
            StorageError: The files cannot be deleted.
        """
        self._archive.sealed_path(capture_id)
        if self._annotations.get(capture_id).pinned:
            raise Conflict(f"capture {capture_id} is pinned", "unpin it first: PATCH it with pinned: false")
        self._jobs.check_idle(capture_id)
        # The file first: if it cannot be deleted, its results and annotations are kept, too.
        self._archive.remove(capture_id)
        self._remove_results(capture_id)
        self._annotations.remove(capture_id)
        self._jobs.forget_capture(capture_id)


def _merged(document: CaptureDocument, labels: Mapping[str, str | None]) -> dict[str, str]:
    merged = {**document.labels, **labels}
    kept = {name: value for name, value in merged.items() if value is not None}
    _check_few(document, "labels", len(kept), MOST_LABELS)
    return kept


def _marked(
    document: CaptureDocument, marks: Mapping[int, str], changes: Mapping[str, str | None]
) -> dict[int, str]:
    total = sum(document.ledger.counts.values())
    changed = {int(n): name for n, name in changes.items()}
    beyond = [n for n, name in changed.items() if name is not None and n >= total]
    if beyond:
        raise InputError(
            f"capture {document.id} has no field {beyond[0]}", f"its fields are numbered 0 to {total - 1}"
        )
    kept = {n: name for n, name in {**marks, **changed}.items() if name is not None}
    _check_few(document, "marks", len(kept), MOST_MARKS)
    return kept


def _check_few(document: CaptureDocument, what: str, count: int, most: int) -> None:
    if count > most:
        raise InputError(
            f"capture {document.id} would have {count} {what}; the limit is {most}",
            "remove some first, by setting them to null",
        )
