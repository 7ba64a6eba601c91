"""Documents of captures and their runs, with coverage and channels.

The description of a sealed capture is cached until its file changes; a slow one does not delay others.
"""

import math
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from grabberd.archive.capture.meta import SEALED, CaptureMeta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.recorded_channels import verdict_on
from grabberd.archive.capture.rows import RunInfo
from grabberd.archive.capture.schema import reading_errors
from grabberd.archive.state.index_entries import IndexEntry
from grabberd.core.channels.account import Account
from grabberd.core.field import PAL_HZ
from grabberd.core.ledger import Ledger, LedgerEntry, cause_of_loss
from grabberd.core.reconstruction.coverage import finding_in_words, miss_in_words
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
from grabberd.documents.channels import ChannelsSummary
from grabberd.documents.coverage import CoverageDocument, CoverageSummary, TargetCoverage
from grabberd.errors import ReadingGivenUp, StorageError
from grabberd.files.disk import storage_errors
from grabberd.files.patience import CURRENT, Patience, check_patience, within

AXES = ("x", "y", "z")
KEPT = 4096
"""Number of captures whose descriptions are cached."""
LONGEST_S = 25.0
"""Time limit for describing one capture, less than that for a list, so that no file uses up all of it."""
TOO_SLOW_FOR_S = 600.0
"""Time for which a file that exceeded the limit is not tried again."""


def ledger_document(ledger: Ledger, rate_hz: float) -> LedgerDocument:
    """A ledger as a document; its text has the times of gaps by the rate."""
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


def whole_run(path: Path, run: int) -> WholeRunDocument:
    """A run with the documents that its points were measured with.

    Raises:
        CaptureFileError: The file cannot be read.
        NotFound: The run does not exist.
    """
    with CaptureReader(path) as reader, reading_errors(path):
        found = reader.run(run)
        made_with = {key: found.made_with.get(key) for key in MadeWith.model_fields}
        covered = whole_coverage(found.coverage)
        return WholeRunDocument.model_validate({**_run(found), "coverage": covered, "made_with": made_with})


def describe(path: Path) -> CaptureDocument:
    """The document of the capture in a file.

    Raises:
        CaptureFileError: The file cannot be read.
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
        entry: The capture's entry in the index.
        path: Its file.
        reason: Why the file cannot be read.
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
    """A capture without known fields."""
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
    """A capture from its metadata, ledger and runs, in memory or from its file."""
    described = [RunDocument.model_validate(_run(run)) for run in runs]
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
    # Validated, because the values may come from a file and have any type.
    return CaptureDocument.model_validate(known)


def _run(run: RunInfo) -> dict[str, object]:
    known = {name: getattr(run, name) for name in RunDocument.model_fields}
    return {**known, "coverage": coverage_summary(run.coverage)}


def _first_field_s(meta: CaptureMeta, first_time_ns: int | None) -> float | None:
    """Time from the start to the middle of the first field's exposure; None for a replayed recording."""
    if first_time_ns is None or not meta.device.get("stream", {}).get("live", True):
        return None
    return (first_time_ns - meta.start_ns) / 1e9


def coverage_summary(stored: Mapping[str, Any] | None) -> CoverageSummary | None:
    """The coverage in short; None if the run has none.

    Raises:
        ValueError: The stored document is invalid.
    """
    return None if stored is None else CoverageSummary.model_validate(_summary(stored))


def whole_coverage(stored: Mapping[str, Any] | None) -> CoverageDocument | None:
    """The coverage with its targets; None if the run has none.

    Raises:
        KeyError, ValueError: The stored document is invalid.
    """
    if stored is None:
        return None
    targets = [_target(stored["targets"], i) for i in range(len(stored["targets"]["target"]))]
    known = {**_summary(stored), "targets": targets, "worst_fields": stored["worst_fields"]}
    return CoverageDocument.model_validate(known)


def _summary(stored: Mapping[str, Any]) -> dict[str, Any]:
    names = ("verdict", "share", "fields", "missing_fields", "residual_px", "residual_sigma")
    findings = [
        {**one, "in_words": finding_in_words(one["code"], one["values"], one["miss"])}
        for one in stored["findings"]
    ]
    return {name: stored[name] for name in names} | {
        "findings": findings,
        "in_words": findings[0]["in_words"],
    }


def _target(columns: Mapping[str, Any], i: int) -> TargetCoverage:
    misses = {reason: counts[i] for reason, counts in columns["misses"].items() if counts[i]}
    reason = max(misses, key=misses.__getitem__) if misses else None
    offset_mm = [axis[i] for axis in columns["offset_mm"]]
    displaced_mm = math.hypot(*offset_mm) if columns["displaced"][i] else None
    return TargetCoverage.model_validate(
        {
            "target": columns["target"][i],
            "expected": columns["expected"][i],
            "found": columns["found"][i],
            "misses": misses,
            "reason": reason,
            "in_words": miss_in_words(reason, displaced_mm) if reason else "",
            **{f"offset_{axis}_mm": value for axis, value in zip(AXES, offset_mm, strict=True)},
            "offset_sigma_mm": columns["offset_sigma_mm"][i],
            "offset_fields": columns["offset_fields"][i],
        }
    )


def channels_summary(account: Account | None, *, sealed: bool) -> ChannelsSummary | None:
    """Verdict on the channels of a capture; None without channels."""
    if account is None:
        return None
    names = [one.name for one in account.channels]
    return ChannelsSummary.model_validate({"names": names, **verdict_on(account, sealed=sealed)})


class Descriptions:
    """A cache of descriptions, each valid until its file changes: reading a long ledger takes a while.

    Args:
        describe: Describes a file.
    """

    def __init__(self, describe: Callable[[Path], CaptureDocument]) -> None:
        self._describe = lru_cache(KEPT)(lambda path, changed_ns: describe(path))
        self._too_slow: dict[tuple[Path, int], float] = {}

    def of(self, path: Path) -> CaptureDocument:
        """The description of a file.

        Raises:
            CaptureFileError: The file is damaged.
            StorageError: Reading takes longer than `LONGEST_S`.
            ReadingGivenUp: The reading was cancelled.
        """
        changed_ns = _changed_ns(path)
        key = (path, changed_ns)
        if self._too_slow.get(key, 0.0) > time.monotonic():
            raise _too_slow(path)
        try:
            with within(Patience(time.monotonic() + LONGEST_S, outer=CURRENT.get())):
                return self._describe(path, changed_ns)
        except ReadingGivenUp as error:
            check_patience(path.name)
            if len(self._too_slow) >= KEPT:
                self._too_slow.clear()
            self._too_slow[key] = time.monotonic() + TOO_SLOW_FOR_S
            raise _too_slow(path) from error


def _too_slow(path: Path) -> StorageError:
    return StorageError(
        f"describing {path.name} takes longer than {LONGEST_S:g} s",
        "it is tried again after ten minutes; to see the others sooner, move it elsewhere",
    )


def _changed_ns(path: Path) -> int:
    with storage_errors(path), suppress(FileNotFoundError):
        return path.lstat().st_mtime_ns
    return 0
