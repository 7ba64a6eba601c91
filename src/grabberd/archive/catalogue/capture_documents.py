"""The documents of captures and their runs, built from what is known of them."""

from collections.abc import Iterable
from pathlib import Path

from grabberd.archive import CaptureMeta, CaptureReader, RunInfo
from grabberd.archive.capture.meta import SEALED
from grabberd.archive.capture.schema import reading_errors
from grabberd.archive.catalogue.channel_documents import channels_summary
from grabberd.archive.catalogue.coverage_documents import coverage_summary, whole_coverage
from grabberd.archive.state.index_entries import IndexEntry
from grabberd.core.channels.account import Account
from grabberd.core.field import PAL_HZ
from grabberd.core.ledger import Ledger, LedgerEntry, cause_of_loss
from grabberd.documents.captures import (
    CaptureDocument,
    GroupDocument,
    LedgerDocument,
    LedgerEntryDocument,
    LedgerEventDocument,
    MadeWith,
    RunDocument,
    WholeRunDocument,
)
from grabberd.files.disk import storage_errors


def ledger_document(ledger: Ledger, rate_hz: float) -> LedgerDocument:
    """A ledger, with its gaps at the times that the rate gives them."""
    return LedgerDocument(
        complete=ledger.complete,
        in_words=ledger.in_words(rate_hz),
        counts=ledger.counts(),
        entries=[_entry(entry) for entry in ledger.entries],
        events=[LedgerEventDocument.model_validate(event._asdict()) for event in ledger.events],
    )


def _entry(entry: LedgerEntry) -> LedgerEntryDocument:
    cause = cause_of_loss(entry.outcome, entry.reason)
    return LedgerEntryDocument.model_validate({**entry._asdict(), "cause": cause})


def run_document(run: RunInfo) -> RunDocument:
    """A run in short."""
    return RunDocument.model_validate(_run(run))


def whole_run(path: Path, run: int) -> WholeRunDocument:
    """A run with the documents that its points were measured with.

    Raises:
        CaptureFileError: the file cannot be read.
        NotFound: there is no such run.
    """
    with CaptureReader(path) as reader, reading_errors(path):
        found = reader.run(run)
        made_with = {key: found.made_with.get(key) for key in MadeWith.model_fields}
        covered = whole_coverage(found.coverage)
        return WholeRunDocument.model_validate({**_run(found), "coverage": covered, "made_with": made_with})


def describe(path: Path) -> CaptureDocument:
    """The capture in a file.

    Raises:
        CaptureFileError: the file cannot be read.
    """
    with CaptureReader(path) as reader, reading_errors(path):
        document = document_of(
            reader.meta,
            reader.ledger,
            reader.runs,
            fields=reader.field_count,
            first_time_ns=reader.first_time_ns,
            size_bytes=_size_bytes(path),
            account=reader.channels.account,
        )
    if document.verdict is not None:
        return document
    return document.model_copy(update={"state": "unsealed", "verdict": "incomplete"})


def damaged_document(entry: IndexEntry, path: Path, reason: str) -> CaptureDocument:
    """A capture whose file cannot be read.

    Args:
        entry: the capture's entry in the index.
        path: its file.
        reason: why the file cannot be read.
    """
    return document_without_fields(
        id=entry.id,
        device=entry.device,
        state="damaged",
        verdict="incomplete",
        ended_because=reason,
        created_utc=entry.created_utc,
        size_bytes=_size_bytes(path),
    )


def _size_bytes(path: Path) -> int:
    with storage_errors(path):
        return path.lstat().st_size


def document_without_fields(**known: object) -> CaptureDocument:
    """A capture of which no field is known."""
    nothing = dict.fromkeys(("verdict", "ended_because", "trigger_utc"))
    none_of = dict.fromkeys(("pre_trigger_fields", "bits", "fields", "size_bytes"), 0)
    rest: dict[str, object] = {"lines": None, "note": "", "runs": [], "labels": {}, "pinned": False}
    ledger = ledger_document(Ledger(), PAL_HZ)  # of no field: any rate will do
    return CaptureDocument.model_validate({**nothing, **none_of, **rest, "ledger": ledger, **known})


def document_of(
    meta: CaptureMeta,
    ledger: Ledger,
    runs: Iterable[RunInfo],
    *,
    fields: int,
    first_time_ns: int | None,
    size_bytes: int,
    account: Account | None,
) -> CaptureDocument:
    """A capture by its metadata, ledger and runs, be they in memory or from its file."""
    described = [run_document(run) for run in runs]
    trigger, group = meta.extra.get("trigger", {}), meta.extra.get("group")
    known = {
        "id": meta.id,
        "device": meta.device["name"],
        "state": meta.state,
        "verdict": {True: "complete", False: "incomplete", None: None}[meta.complete],
        "ended_because": meta.ended_because,
        "created_utc": meta.created_utc,
        "trigger_utc": trigger.get("utc"),
        "pre_trigger_fields": trigger.get("n", 0),
        "group": None if group is None else GroupDocument.model_validate(group),
        "first_field_s": _first_field_s(meta, first_time_ns),
        "bits": meta.bits,
        "lines": meta.lines if meta.is_interlaced else None,
        "rate_hz": meta.rate_hz,
        "fields": fields,
        "ledger": ledger_document(ledger, meta.rate_hz),
        "runs": described,
        "coverage": described[-1].coverage if described else None,
        "channels": channels_summary(account, sealed=meta.state == SEALED),
        "labels": meta.labels,
        "note": meta.note,
        "pinned": False,
        "size_bytes": size_bytes,
        "rig": meta.extra.get("rig"),
        "field_order": meta.extra.get("field_order"),
    }
    # Validated: the strings may be a file's own, so nothing is known of their types.
    return CaptureDocument.model_validate(known)


def _run(run: RunInfo) -> dict[str, object]:
    known = {name: getattr(run, name) for name in RunDocument.model_fields}
    return {**known, "coverage": coverage_summary(run.coverage)}


def _first_field_s(meta: CaptureMeta, first_time_ns: int | None) -> float | None:
    """From its start to the middle of its first field's exposure; None for a recording played again."""
    if first_time_ns is None or not meta.device.get("stream", {}).get("live", True):
        return None
    return (first_time_ns - meta.start_ns) / 1e9
