"""A capture as it is shown, whatever has become of it."""

from pathlib import Path
from typing import Any

from grabberd.acquisition import Ledger, Outcome
from grabberd.errors import NotFound
from grabberd.service.archive.run_documents import run_document
from grabberd.service.capture.capture_request import ArmedCapture
from grabberd.service.capture.recording import Recording
from grabberd.storage import CaptureReader
from grabberd.storage.capture.schema import reading_errors
from grabberd.storage.state.capture_index import IndexEntry

IN_THE_FILE = (Outcome.RECEIVED, Outcome.DAMAGED)


def ledger_document(ledger: Ledger, rate_hz: float) -> dict[str, Any]:
    """A ledger as it is shown."""
    return {
        "complete": ledger.complete,
        "in_words": ledger.in_words(rate_hz),
        "counts": ledger.counts(),
        "entries": [entry._asdict() for entry in ledger.entries],
    }


def waiting_document(waiting: ArmedCapture) -> dict[str, Any]:
    """One that is armed: nothing is in it yet."""
    return {
        "id": waiting.id,
        "device": waiting.device,
        "state": "armed",
        "verdict": None,
        "ended_because": None,
        "created_utc": waiting.armed_utc,
        "trigger_utc": None,
        "pre_trigger_fields": 0,
        "group": waiting.group and waiting.group.document(None),
        "first_field_s": None,
        "bits": waiting.bits,
        "lines": waiting.lines,
        "fields": 0,
        "ledger": ledger_document(Ledger(), 50.0),
        "runs": [],
        "labels": dict(waiting.request.labels),
        "note": waiting.request.note,
        "size_bytes": 0,
    }


def running_document(part: Path, session: Recording) -> dict[str, Any]:
    """One that is being recorded, measured or sealed.

    Raises:
        CaptureFileError, FileNotFoundError: its file is not there under this name any more.
    """
    with CaptureReader(part) as reader:
        document = _document(reader, session.recorder.ledger)
    ended = "unsealed" if session.sealed.is_set() else "sealing"
    state = "recording" if session.recorder.recording else ended
    return document | {"state": state, "ended_because": session.recorder.ended_because}


def describe(path: Path) -> dict[str, Any]:
    """A capture file as it is shown.

    Raises:
        CaptureFileError: it cannot be read.
    """
    with CaptureReader(path) as reader, reading_errors(path):
        document = _document(reader, reader.ledger)
    unsealed = {"state": "unsealed", "verdict": "incomplete"} if document["verdict"] is None else {}
    return document | unsealed


def _document(reader: CaptureReader, ledger: Ledger) -> dict[str, Any]:
    meta = reader.meta
    counts, trigger = ledger.counts(), meta.extra.get("trigger", {})
    verdict = {True: "complete", False: "incomplete", None: None}[meta.complete]
    return {
        "id": meta.id,
        "device": meta.device["name"],
        "state": meta.state,
        "verdict": verdict,
        "ended_because": meta.ended_because,
        "created_utc": meta.created_utc,
        "trigger_utc": trigger.get("utc"),
        "pre_trigger_fields": trigger.get("n", 0),
        "group": meta.extra.get("group"),
        "first_field_s": _first_field_s(reader),
        "bits": meta.bits,
        "lines": meta.lines,
        "fields": sum(counts[outcome] for outcome in IN_THE_FILE),
        "ledger": ledger_document(ledger, meta.rate_hz),
        "runs": [run_document(run) for run in reader.runs],
        "labels": meta.labels,
        "note": meta.note,
        "size_bytes": reader.path.stat().st_size,
        "rig": meta.extra.get("rig"),
    }


def _first_field_s(reader: CaptureReader) -> float | None:
    """From its start to the middle of its first field's exposure; None for a recording played again."""
    first_ns = reader.first_time_ns
    if first_ns is None or not reader.meta.device.get("stream", {}).get("live", True):
        return None
    return (first_ns - reader.meta.start_ns) / 1e9


def damaged_document(entry: IndexEntry, path: Path, reason: str) -> dict[str, Any]:
    """One that cannot be read, for this reason.

    Raises:
        NotFound: its file is gone.
    """
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
        "trigger_utc": None,
        "pre_trigger_fields": 0,
        "group": None,
        "first_field_s": None,
        "bits": 0,
        "lines": "",
        "fields": 0,
        "ledger": ledger_document(Ledger(), 50.0),
        "runs": [],
        "labels": {},
        "note": "",
        "size_bytes": path.stat().st_size,
    }
