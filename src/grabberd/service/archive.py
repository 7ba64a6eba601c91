"""The captures on disk, and how each is described."""

import shutil
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from grabberd.acquisition import Ledger, Outcome
from grabberd.errors import CaptureFileError, Conflict, NotFound
from grabberd.service.session import CaptureSession
from grabberd.storage import CaptureIndex, CaptureReader, RunInfo, recover
from grabberd.storage.index import IndexEntry
from grabberd.storage.lock import DirectoryLock

SUFFIX = ".grab"
PART = ".grab.part"
DESCRIBED = 4096
"""So many captures' descriptions are remembered."""
IN_THE_FILE = (Outcome.RECEIVED, Outcome.DAMAGED)


class Archive:
    """One folder of captures; running ones are described from their sessions.

    Args:
        directory: where the files are; made if it is not there.
        sessions: gives the captures that are being recorded or sealed.
    """

    def __init__(self, directory: Path, sessions: Callable[[], Sequence[CaptureSession]]) -> None:
        self.directory = directory
        self.index = CaptureIndex(directory)
        self._lock = DirectoryLock(directory)
        self._sessions = sessions
        # Remembered as long as a file does not change: the ledger of a long capture takes its time to read.
        self._describe = lru_cache(DESCRIBED)(lambda path, mtime_ns: describe(path))

    def open(self) -> None:
        """Takes the folder for this program alone, seals what a crash left, brings the index up to date.

        Raises:
            StorageError: another program uses the folder, or it cannot be written.
        """
        self._lock.acquire()
        for part in sorted(self.directory.glob(f"*{PART}")):
            recover(part)
        self.index.rebuild()

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
        """
        if self._running(capture_id):
            return self.part_of(capture_id)
        return self.index.file_of(capture_id)

    def sealed_path(self, capture_id: str) -> Path:
        """A sealed capture's file.

        Raises:
            NotFound: there is none of that id.
            Conflict: it is still running.
        """
        if self._running(capture_id):
            raise Conflict(f"capture {capture_id} is still running", "stop it, or wait for its end")
        return self.index.file_of(capture_id)

    def document(self, capture_id: str) -> dict[str, Any]:
        """A capture as it is shown.

        Raises:
            NotFound: there is none of that id.
        """
        session = self._running(capture_id)
        if session is not None:
            try:
                return _running_document(self.part_of(capture_id), session)
            except (CaptureFileError, FileNotFoundError):  # it is being renamed at this moment
                session.sealed.wait(10)
        return self._sealed_document(self.index.get(capture_id))

    def documents(self) -> list[dict[str, Any]]:
        """All captures, the newest first."""
        running = {session.id for session in self._sessions()}
        shown = [self.document(capture_id) for capture_id in running]
        sealed = [self._sealed_document(entry) for entry in self.index.list() if entry.id not in running]
        return sorted(shown + sealed, key=lambda document: str(document["created_utc"]), reverse=True)

    @property
    def free_bytes(self) -> int:
        """Room on the disk."""
        return shutil.disk_usage(self.directory).free

    def _running(self, capture_id: str) -> CaptureSession | None:
        return next((session for session in self._sessions() if session.id == capture_id), None)

    def _sealed_document(self, entry: IndexEntry) -> dict[str, Any]:
        path = self.directory / entry.file
        try:
            return self._describe(path, path.stat().st_mtime_ns if path.exists() else 0)
        except CaptureFileError as error:
            return _damaged_document(entry, path, error.message)


def ledger_document(ledger: Ledger, rate_hz: float) -> dict[str, Any]:
    """A ledger as it is shown."""
    return {
        "complete": ledger.complete,
        "in_words": ledger.in_words(rate_hz),
        "counts": ledger.counts(),
        "entries": [entry._asdict() for entry in ledger.entries],
    }


def _running_document(part: Path, session: CaptureSession) -> dict[str, Any]:
    with CaptureReader(part) as reader:
        document = _document(reader, session.recorder.ledger)
    state = "recording" if session.recorder.recording else "sealing"
    return document | {"state": state, "ended_because": session.recorder.ended_because}


def describe(path: Path) -> dict[str, Any]:
    """A capture file as it is shown.

    Raises:
        CaptureFileError: it cannot be read.
    """
    with CaptureReader(path) as reader:
        document = _document(reader, reader.ledger)
    unsealed = {"state": "unsealed", "verdict": "incomplete"} if document["verdict"] is None else {}
    return document | unsealed


def _document(reader: CaptureReader, ledger: Ledger) -> dict[str, Any]:
    meta = reader.meta
    counts = ledger.counts()
    verdict = {True: "complete", False: "incomplete", None: None}[meta.complete]
    return {
        "id": meta.id,
        "device": meta.device["name"],
        "state": meta.state,
        "verdict": verdict,
        "ended_because": meta.ended_because,
        "created_utc": meta.created_utc,
        "bits": meta.bits,
        "lines": meta.lines,
        "fields": sum(counts[outcome] for outcome in IN_THE_FILE),
        "ledger": ledger_document(ledger, meta.rate_hz),
        "runs": [_run_document(run) for run in reader.runs],
        "labels": meta.labels,
        "note": meta.note,
        "size_bytes": reader.path.stat().st_size,
    }


def _run_document(run: RunInfo) -> dict[str, Any]:
    return {
        "run": run.run,
        "kind": run.kind,
        "created_utc": run.created_utc,
        "version": run.version,
        "state": run.state,
    }


def _damaged_document(entry: IndexEntry, path: Path, reason: str) -> dict[str, Any]:
    if not path.exists():
        raise NotFound(
            f"the file of capture {entry.id} is gone", "it was removed by hand; restart to forget it"
        )
    return {
        "id": entry.id,
        "device": entry.device,
        "state": "damaged",
        "verdict": "incomplete",
        "ended_because": reason,
        "created_utc": entry.created_utc,
        "bits": 0,
        "lines": "",
        "fields": 0,
        "ledger": ledger_document(Ledger(), 50.0),
        "runs": [],
        "labels": {},
        "note": "",
        "size_bytes": path.stat().st_size,
    }
