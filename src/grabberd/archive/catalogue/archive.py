"""The archive: finds, describes, annotates and removes captures in their folder."""

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from grabberd import runtime
from grabberd.archive.capture.captures_folder import CapturesFolder, plainly_named
from grabberd.archive.capture.crash_recovery import reason_of, recover
from grabberd.archive.capture.schema import DAMAGED, PART, SUFFIX, part_path
from grabberd.archive.catalogue.capture_catalogue import Library, Results
from grabberd.archive.catalogue.capture_documents import Descriptions, damaged_document, describe
from grabberd.archive.state.capture_index import CaptureIndex, IndexKeeper, Unusable
from grabberd.archive.state.index_entries import SEALED_ENTRY, IndexEntry
from grabberd.archive.state.state_database import Annotation, AnnotationStore
from grabberd.documents.captures import CaptureDocument, MarkDocument
from grabberd.documents.document import MOST_LABELS, MOST_MARKS
from grabberd.errors import (
    CaptureFileError,
    Cause,
    Conflict,
    InputError,
    LaterVersion,
    NotFound,
    ReadingGivenUp,
    StorageError,
)
from grabberd.fault_board import FaultBoard
from grabberd.files.disk import storage_errors
from grabberd.files.reading import Patience, within

if TYPE_CHECKING:
    from grabberd.work.job_queue import JobQueue


log = logging.getLogger(__name__)
AWAY = (Cause.CAPTURES_MISSING, Cause.CAPTURES_REPLACED)
RECOVERED_S = 600.0
"""Time limit for sealing captures after a crash, which delays the start: long ledgers have to be read."""
RENAMED_S = 10.0
"""Longest wait for a renamed capture to be added to the index."""


class ArmedCapture(Protocol):
    """A capture that waits for its trigger."""

    @property
    def id(self) -> str:
        """Id of the capture."""
        ...

    @property
    def document(self) -> CaptureDocument:
        """The capture's document."""
        ...


class Recording(ArmedCapture, Protocol):
    """A running capture, as seen by the archive."""

    @property
    def path(self) -> Path:
        """Present path of the file."""
        ...

    @property
    def sealed(self) -> runtime.Event:
        """Set when the file has been sealed or given up."""
        ...


class Archive:
    """One folder of captures; a running capture is described by its recording.

    Args:
        directory: Folder of the files.
        recordings: Returns the captures that are being recorded or sealed.
        armed: Returns the armed captures.
        annotation: Returns the annotation of a capture by its id.
        annotations: Returns all annotations by capture id.
        results: Results of captures, such as analyses.
        folder: The identified folder; created if it does not exist and no other is expected.
        faults: Board for reporting a missing folder and a damaged index.

    Attributes:
        folder: See above.
        index: Index of the captures that have ended.
        keeper: Rebuilds the index.
        library: The captures for searching and listing.
    """

    def __init__(
        self,
        directory: Path,
        recordings: Callable[[], Sequence[Recording]],
        armed: Callable[[], Sequence[ArmedCapture]] = list,
        annotation: Callable[[str], Annotation] = lambda _: Annotation(),
        annotations: Callable[[], Mapping[str, Annotation]] = dict,
        results: Results | None = None,
        *,
        folder: CapturesFolder | None = None,
        faults: FaultBoard | None = None,
    ) -> None:
        self.directory = directory
        self.folder = folder or CapturesFolder(directory)
        self.index = CaptureIndex(directory, self.check, self._heal, changed=self._entry_changed)
        self._faults = faults or FaultBoard()
        self.keeper = IndexKeeper(self.index, lambda: self._left, self._faults)
        self._left: list[Path] = []
        self._opened = False
        self._taking = runtime.rlock()
        self._recordings = recordings
        self._armed = armed
        self._annotation = annotation
        self._results = results
        self.annotations = annotations
        self.library = Library(self.index, annotation, annotations, results)
        self._descriptions = Descriptions(describe)

    def open(self) -> None:
        """Locks the folder, seals captures left by a crash, and updates the index.

        If the folder is missing, it is waited for while everything else works.

        Raises:
            StorageError: Another program uses the folder, or it cannot be written.
        """
        self._opened = True
        try:
            self.check()
        except StorageError as error:
            if error.cause not in AWAY:
                raise

    def check(self) -> None:
        """Checks that the right folder is in place; locks it again if it has come back.

        Raises:
            StorageError: The folder is missing or a different one; nothing has been written.
        """
        if not self._opened:
            return
        if not self.folder.in_place:
            with self._taking:
                self._take()
        self._faults.resolve(*AWAY)

    def _take(self) -> None:
        try:
            taken = self.folder.take()
        except StorageError as error:
            if error.cause is not None:
                self._faults.resolve(*(one for one in AWAY if one is not error.cause))
                self._faults.report(error.cause, error.message, error.hint)
            raise
        if not taken:
            return
        written = {recording.path for recording in self._recordings()}
        found = [part for part in self.directory.glob(f"*{SUFFIX}{PART}") if part not in written]
        parts = sorted(plain for part in found if (plain := plainly_named(part)) is not None)
        with within(Patience(runtime.monotonic() + RECOVERED_S)):
            self._left = [part for part in parts if not _recovered(part)]
        self.index.rebuild(self._left)
        for entry in self.index.damaged():
            log.warning("capture %s is damaged: %s: %s", entry.id, entry.file, entry.reason)

    def _heal(self, reason: Unusable) -> None:
        self.keeper.heal(reason)

    def _entry_changed(self, capture_id: str | None) -> None:
        self.library.note(capture_id)

    def close(self) -> None:
        """Unlocks the folder."""
        self._opened = False
        self.folder.release()

    def path(self, capture_id: str) -> Path:
        """Returns the path of a capture, sealed or being written.

        Raises:
            NotFound: No capture has that id.
            Conflict: The capture is armed.
            StorageError: The folder is missing.
        """
        self.check()
        self._check_triggered(capture_id)
        if self._running(capture_id):
            return part_path(self.directory, capture_id)
        return self._file_of(capture_id)

    def sealed_path(self, capture_id: str) -> Path:
        """Returns the path of a sealed capture.

        Raises:
            NotFound: No capture has that id.
            Conflict: The capture is still running, or armed.
        """
        self._check_triggered(capture_id)
        if self._running(capture_id):
            raise Conflict(f"capture {capture_id} is still running", "stop it, or wait for it to end")
        return self._file_of(capture_id)

    def remove(self, capture_id: str) -> None:
        """Deletes a sealed capture permanently.

        Raises:
            NotFound: No capture has that id.
            Conflict: The capture is still running, or armed.
            StorageError: The file cannot be deleted.
        """
        path = self.sealed_path(capture_id)
        with storage_errors(path):
            path.unlink(missing_ok=True)
            reason_of(path).unlink(missing_ok=True)
        self.index.remove(capture_id)

    def ended(self, subject: str, captures: Iterable[str]) -> None:
        """Handles the end of a job: its subject may have a new run, other captures may be analysed now."""
        with suppress(NotFound, StorageError):
            entry = self.index.get(subject)
            path = self.directory / entry.file
            if entry.state == SEALED_ENTRY and not entry.still_holds(path):
                self.index.add(path)
        for capture_id in captures:
            self.library.note(capture_id)

    def document(self, capture_id: str) -> CaptureDocument:
        """Returns the document of a capture.

        Raises:
            NotFound: No capture has that id.
        """
        return self._annotated(self._document(capture_id), self._annotation(capture_id))

    def listed(self, entry: IndexEntry) -> CaptureDocument:
        """Returns the document of a capture that has ended, as one of many.

        Raises:
            NotFound: The capture was deleted after its entry was read.
        """
        return self._annotated(self._sealed_document(entry).in_list, self._annotation(entry.id))

    def current(self) -> list[CaptureDocument]:
        """Returns the documents of the captures that are armed or running."""
        ids = {one.id for one in self._armed()} | {one.id for one in self._recordings()}
        return [document for capture_id in ids if (document := self._if_there(capture_id)) is not None]

    def _if_there(self, capture_id: str) -> CaptureDocument | None:
        try:
            return self.document(capture_id)
        except NotFound:  # disarmed after its id was read
            return None

    def _document(self, capture_id: str) -> CaptureDocument:
        recording, armed = self._running(capture_id), self._waiting(capture_id)
        if recording is None and armed is not None:
            return armed.document
        if recording is not None:
            if recording.path.suffix == PART:
                return recording.document
            recording.sealed.wait(RENAMED_S)  # the file is renamed, but not in the index yet
        return self._sealed_document(self.index.get(capture_id))

    def documents(self, most: int = 1000) -> list[CaptureDocument]:
        """Returns the documents of the newest captures, newest first, each as one of many."""
        # Read before the index, so that a capture sealed in between is not listed twice.
        running = {recording.id for recording in self._recordings()}
        shown = [self.document(capture_id) for capture_id in running]
        entries = [entry for entry in self.index.page(None, most) if entry.id not in running]
        shown += [self._sealed_document(entry) for entry in entries]
        newest = sorted(shown, key=lambda document: document.created_utc, reverse=True)
        return [document.in_list for document in newest]

    def _annotated(self, document: CaptureDocument, annotation: Annotation) -> CaptureDocument:
        """A document with the annotation and results of its capture added."""
        changes = {
            "pinned": annotation.pinned,
            "note": document.note if annotation.note is None else annotation.note,
            "labels": document.labels if annotation.labels is None else dict(annotation.labels),
            "marks": [MarkDocument(n=n, name=name) for n, name in sorted(annotation.marks.items())],
            **(self._results.fields(document.id) if self._results else {}),
        }
        return document.model_copy(update=changes)

    def _waiting(self, capture_id: str) -> ArmedCapture | None:
        return next((one for one in self._armed() if one.id == capture_id), None)

    def _check_triggered(self, capture_id: str) -> None:
        if self._waiting(capture_id) and not self._running(capture_id):
            raise Conflict(
                f"capture {capture_id} is armed and has no fields yet",
                f"trigger it: POST /api/v1/captures/{capture_id}/trigger, or stop it",
            )

    def _running(self, capture_id: str) -> Recording | None:
        return next((one for one in self._recordings() if one.id == capture_id), None)

    def _sealed_document(self, entry: IndexEntry) -> CaptureDocument:
        path = self.directory / entry.file
        if path.parent.name == DAMAGED:
            self._check_there(entry)
            return damaged_document(entry, path, entry.reason)
        try:
            described = self._descriptions.of(path)
        except (CaptureFileError, StorageError) as error:
            self._check_there(entry)
            return damaged_document(entry, path, error.message)
        return described.model_copy(update={"id": entry.id})

    def _file_of(self, capture_id: str) -> Path:
        entry = self.index.get(capture_id)
        self._check_there(entry)
        return self.directory / entry.file

    def _check_there(self, entry: IndexEntry) -> None:
        """Checks that a capture's file exists; removes the capture from the index if it does not.

        Raises:
            NotFound: The file is missing.
            StorageError: The whole folder is missing.
        """
        path = self.directory / entry.file
        with storage_errors(path), suppress(FileNotFoundError):
            path.lstat()
            return
        self.check()
        self.index.remove(entry.id)
        raise NotFound(
            f"the file of capture {entry.id} is gone", "it was removed by hand, and is no longer listed"
        )


def _recovered(part: Path) -> bool:
    """Seals or sets aside a file left by a crash; logs the reason and returns False if that fails."""
    try:
        recover(part)
    except (StorageError, LaterVersion, ReadingGivenUp) as error:
        log.error("%s stays unsealed: %s; %s", part.name, error.message, error.hint)
        return False
    return True


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
