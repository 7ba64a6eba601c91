"""The captures on disk, and their documents."""

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from grabberd.documents.captures import CaptureDocument
from grabberd.errors import CaptureFileError, Conflict, LaterVersion, NotFound, StorageError
from grabberd.service.archive.capture_documents import (
    armed_document,
    damaged_document,
    describe,
    running_document,
)
from grabberd.service.capture.armed_capture import ArmedCapture
from grabberd.service.capture.recording import Recording
from grabberd.storage import CaptureIndex, recover
from grabberd.storage.capture.crash_recovery import reason_of
from grabberd.storage.capture.directory_lock import DirectoryLock
from grabberd.storage.capture.schema import storage_errors
from grabberd.storage.state.annotation_store import Annotation
from grabberd.storage.state.capture_index import IndexEntry

log = logging.getLogger(__name__)
PART = ".grab.part"
DESCRIBED = 4096
"""Number of captures whose documents are cached."""


class Archive:
    """One folder of captures; the documents of running ones come from their recordings.

    Args:
        directory: Folder of the files; created if it does not exist.
        sessions: Returns the captures that are being recorded or sealed.
        waiting: Returns the armed captures.
        annotation: Returns the annotation of a capture, by its id.
        annotations: Returns the annotations of all captures that have one, by id.
    """

    def __init__(
        self,
        directory: Path,
        sessions: Callable[[], Sequence[Recording]],
        waiting: Callable[[], Sequence[ArmedCapture]] = list,
        annotation: Callable[[str], Annotation] = lambda _: Annotation(),
        annotations: Callable[[], Mapping[str, Annotation]] = dict,
    ) -> None:
        self.directory = directory
        self.index = CaptureIndex(directory)
        self._lock = DirectoryLock(directory)
        self._sessions = sessions
        self._waiting = waiting
        self._annotation = annotation
        self.annotations = annotations
        # Remembered as long as a file does not change: the ledger of a long capture takes its time to read.
        self._describe = lru_cache(DESCRIBED)(lambda path, mtime_ns: describe(path))

    def open(self) -> None:
        """Takes the folder for this program alone, seals what a crash left, brings the index up to date.

        Raises:
            StorageError: another program uses the folder, or it cannot be written.
        """
        self._lock.acquire()
        parts = sorted(self.directory.glob(f"*{PART}"))
        self.index.rebuild([part for part in parts if not _recovered(part)])
        for entry in self.index.list():
            if entry.state == "damaged":
                log.warning("capture %s is damaged: %s", entry.id, self.directory / entry.file)

    def close(self) -> None:
        """Lets another program have the folder."""
        self._lock.release()

    def part_of(self, capture_id: str) -> Path:
        """Where a new capture is written to."""
        return self.directory / f"{capture_id}{PART}"

    def path(self, capture_id: str) -> Path:
        """A capture's file, sealed or being written.

        Raises:
            NotFound: there is none of that id.
            Conflict: it is armed.
        """
        self._check_triggered(capture_id)
        if self._running(capture_id):
            return self.part_of(capture_id)
        return self.index.file_of(capture_id)

    def sealed_path(self, capture_id: str) -> Path:
        """A sealed capture's file.

        Raises:
            NotFound: there is none of that id.
            Conflict: it is still running, or armed.
        """
        self._check_triggered(capture_id)
        if self._running(capture_id):
            raise Conflict(f"capture {capture_id} is still running", "stop it, or wait for its end")
        return self.index.file_of(capture_id)

    def remove(self, capture_id: str) -> None:
        """Deletes a capture that is not running, for good.

        Raises:
            NotFound: there is none of that id.
            Conflict: it is still running.
            StorageError: the disk does not let it be deleted.
        """
        path = self.sealed_path(capture_id)
        with storage_errors(path):
            path.unlink(missing_ok=True)
            reason_of(path).unlink(missing_ok=True)
        self.index.remove(capture_id)

    def document(self, capture_id: str) -> CaptureDocument:
        """The document of a capture.

        Raises:
            NotFound: there is none of that id.
        """
        return _annotated(self._document(capture_id), self._annotation(capture_id))

    def current(self) -> list[CaptureDocument]:
        """The documents of the captures that are armed or running."""
        ids = {one.id for one in self._waiting()} | {one.id for one in self._sessions()}
        return [document for capture_id in ids if (document := self._if_there(capture_id)) is not None]

    def _if_there(self, capture_id: str) -> CaptureDocument | None:
        try:
            return self.document(capture_id)
        except NotFound:  # just disarmed
            return None

    def _document(self, capture_id: str) -> CaptureDocument:
        session, waiting = self._running(capture_id), self._armed(capture_id)
        if session is None and waiting is not None:
            return armed_document(waiting)
        if session is not None:
            try:
                return running_document(self.part_of(capture_id), session)
            except (CaptureFileError, FileNotFoundError):  # it is being renamed at this moment
                session.sealed.wait(10)
        return self._sealed_document(self.index.get(capture_id))

    def documents(self) -> list[CaptureDocument]:
        """All captures, the newest first."""
        running = {session.id for session in self._sessions()}
        shown = [self.document(capture_id) for capture_id in running]
        sealed = [self._sealed_document(entry) for entry in self.index.list() if entry.id not in running]
        return sorted(shown + sealed, key=lambda document: document.created_utc, reverse=True)

    def _armed(self, capture_id: str) -> ArmedCapture | None:
        return next((one for one in self._waiting() if one.id == capture_id), None)

    def _check_triggered(self, capture_id: str) -> None:
        if self._armed(capture_id) and not self._running(capture_id):
            raise Conflict(
                f"capture {capture_id} is armed: nothing is in it yet",
                f"trigger it: POST /api/v1/captures/{capture_id}/trigger, or stop it",
            )

    def _running(self, capture_id: str) -> Recording | None:
        return next((session for session in self._sessions() if session.id == capture_id), None)

    def _sealed_document(self, entry: IndexEntry) -> CaptureDocument:
        path = self.directory / entry.file
        try:
            described = self._describe(path, path.stat().st_mtime_ns if path.exists() else 0)
        except (CaptureFileError, StorageError) as error:
            return damaged_document(entry, path, error.message)
        return described.model_copy(update={"id": entry.id})


def _recovered(part: Path) -> bool:
    """True if a file that a crash left is now sealed or set aside; a failure is logged and stops no other."""
    try:
        recover(part)
    except (StorageError, LaterVersion) as error:
        log.error("%s stays unsealed: %s; %s", part.name, error.message, error.hint)
        return False
    return True


def _annotated(document: CaptureDocument, said: Annotation) -> CaptureDocument:
    changes = {
        "pinned": said.pinned,
        "note": document.note if said.note is None else said.note,
        "labels": document.labels if said.labels is None else dict(said.labels),
    }
    return document.model_copy(update=changes)
