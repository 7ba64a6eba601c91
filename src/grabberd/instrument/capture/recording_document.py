"""The document of a capture while it is recorded, measured or sealed."""

import threading
from collections.abc import Sequence
from typing import Protocol

from grabberd.archive import CaptureMeta, RunInfo
from grabberd.archive.catalogue.capture_documents import document_of
from grabberd.core.channels.account import Account
from grabberd.documents.captures import CaptureDocument
from grabberd.instrument.capture.recorder import Recorder


class ShownRecording(Protocol):
    """Facts of a `Recording` that its document shows."""

    recorder: Recorder
    sealed: threading.Event
    first_time_ns: int | None

    @property
    def meta(self) -> CaptureMeta:
        """Metadata of the capture."""

    @property
    def runs(self) -> Sequence[RunInfo]:
        """Runs of the capture."""

    @property
    def size_bytes(self) -> int:
        """Size of its file."""

    @property
    def channels(self) -> Account | None:
        """Account of its channels."""

    @property
    def is_sealed(self) -> bool:
        """True if its file has its final name."""


def recording_document(recording: ShownRecording) -> CaptureDocument:
    """The capture as it is shown while it is recorded, measured or sealed; its file is not read."""
    recorder = recording.recorder
    document = document_of(
        recording.meta,
        recorder.ledger,
        recording.runs,
        fields=recorder.fields,
        first_time_ns=recording.first_time_ns,
        size_bytes=recording.size_bytes,
        account=recording.channels,
    )
    ended = "unsealed" if recording.sealed.is_set() and not recording.is_sealed else "sealing"
    state = "recording" if recorder.recording else ended
    length = recorder.length_fields if state == "recording" else None
    changes = {"state": state, "length_fields": length, "ended_because": recorder.ended_because}
    return document.model_copy(update=changes)
