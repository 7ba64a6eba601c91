"""Documents of captures and their runs, with coverage and channels.

The description of a sealed capture is cached until its file changes; a slow one does not delay others.
"""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from grabberd import runtime
from grabberd.archive.capture.meta import LARGEST_FINDING, LARGEST_N, SEALED, CaptureMeta
from grabberd.archive.capture.reader import CaptureReader, Opened
from grabberd.archive.capture.recorded_channels import verdict_on
from grabberd.archive.capture.recorded_ledger import Line
from grabberd.archive.capture.rows import RunInfo
from grabberd.archive.capture.schema import reading_errors
from grabberd.archive.state.index_entries import IndexEntry
from grabberd.core.channels.account import Account
from grabberd.core.field import PAL_HZ
from grabberd.core.ledger import Ledger, LedgerEntry, LedgerEvent, cause_of_loss
from grabberd.core.reconstruction.coverage import finding_in_words, miss_in_words
from grabberd.documents.captures import (
    MOST_LISTED,
    CaptureDocument,
    CoverageDocument,
    CoverageSummary,
    GroupDocument,
    LedgerDocument,
    LedgerEntryDocument,
    LedgerEventDocument,
    LedgerPage,
    MadeWith,
    RunDocument,
    TargetCoverage,
    WholeRunDocument,
)
from grabberd.documents.channels import ChannelsSummary
from grabberd.documents.document import assembled
from grabberd.errors import CaptureFileError, InputError, ReadingGivenUp, StorageError
from grabberd.files.disk import storage_errors
from grabberd.files.reading import CURRENT, Patience, check_patience, within

AXES = ("x", "y", "z")
LONGEST_REASON, LONGEST_WORDS = 500, 5000
"""Characters of a reason, and of a sentence with several, in a document; the file has them unabridged."""
KEPT_BYTES = 6 << 20
"""Descriptions that are cached, in bytes as JSON: some two thousand captures."""
MOST_REFUSED = 4096
_MOMENT_S = 0.05
T = TypeVar("T", CaptureFileError, StorageError)
Key = tuple[Path, int]
"""A file, and when it was changed."""
LONGEST_S = 25.0
"""Time limit for describing one capture, less than that for a list, so that no file uses up all of it."""
REFUSED_FOR_S = 600.0
"""Time for which a file that is damaged, or exceeded the limit, is not tried again until it changes."""


def ledger_document(ledger: Ledger, rate_hz: float) -> LedgerDocument:
    """A ledger as a document, with its first entries and events; times in its text are by the rate."""
    listed, events = ledger.entries[:MOST_LISTED], ledger.events[:MOST_LISTED]
    return LedgerDocument(
        complete=ledger.complete,
        in_words=_short(ledger.in_words(rate_hz), LONGEST_WORDS),
        counts=ledger.counts(),
        entries=[_entry(entry) for entry in listed],
        events=[_event(event) for event in events],
        entries_not_listed=ledger.unlisted + len(ledger.entries) - len(listed),
        events_not_listed=len(ledger.events) - len(events),
    )


def _entry(entry: LedgerEntry) -> LedgerEntryDocument:
    cause = cause_of_loss(entry.outcome, entry.reason)
    known = {**entry._asdict(), "reason": _short(entry.reason), "cause": cause}
    return LedgerEntryDocument.model_validate(known)


def _event(event: LedgerEvent) -> LedgerEventDocument:
    return LedgerEventDocument.model_validate({**event._asdict(), "reason": _short(event.reason)})


def _short(text: str, longest: int = LONGEST_REASON) -> str:
    return text if len(text) <= longest else f"{text[:longest]} …"


def ledger_json(path: Path, cursor: str | None, limit: int, opened: Opened = CaptureReader) -> bytes:
    """The JSON of a page of a capture's ledger.

    Args:
        path: The capture.
        cursor: `next` of the page before: the field of the next line, and the number of its lines listed.
        limit: Largest number of entries and events together.
        opened: Opens the capture.

    Raises:
        CaptureFileError: The file cannot be read.
        InputError: The cursor is not one of a ledger.
    """
    first_n, passed = _position(cursor)
    with opened(path) as reader, reading_errors(path):
        lines = reader.ledger_lines(first_n, passed, limit + 1)
        page = LedgerPage(
            capture=reader.meta.id,
            entries=[_entry(one) for one in lines[:limit] if isinstance(one, LedgerEntry)],
            events=[_event(one) for one in lines[:limit] if isinstance(one, LedgerEvent)],
            next=_cursor_at(lines, (first_n, passed)) if len(lines) > limit else None,
        )
        return page.model_dump_json().encode()


def _position(cursor: str | None) -> tuple[int, int]:
    given = (cursor or "0~0").split("~")
    n, *passed = (int(one) if one.isdecimal() and len(one) <= 10 else -1 for one in given)
    if len(passed) != 1 or not (0 <= n < LARGEST_N and 0 <= passed[0] < LARGEST_N):
        raise InputError(f"{cursor!r} is no cursor of a ledger", "take `next` of the page before")
    return n, passed[0]


def _cursor_at(lines: Sequence[Line], begin: tuple[int, int]) -> str:
    """The cursor of the last of some lines: its field, and the number of lines of this field before it."""
    n = lines[-1][0]
    before = sum(one[0] == n for one in lines[:-1])
    return f"{n}~{before + (begin[1] if n == begin[0] else 0)}"


def whole_run(path: Path, run: int, opened: Opened = CaptureReader) -> WholeRunDocument:
    """A run with the documents that its points were measured with.

    Raises:
        CaptureFileError: The file cannot be read.
        NotFound: The run does not exist.
    """
    with opened(path) as reader, reading_errors(path):
        found = reader.run(run)
        made_with = {key: found.made_with.get(key) for key in MadeWith.model_fields}
        covered = whole_coverage(found.coverage)
        return WholeRunDocument.model_validate({**_run(found), "coverage": covered, "made_with": made_with})


def run_json(path: Path, run: int, opened: Opened = CaptureReader) -> bytes:
    """The same as JSON; it may be large."""
    return whole_run(path, run, opened).model_dump_json(by_alias=True).encode()


def describe(path: Path) -> CaptureDocument:
    """The document of the capture in a file.

    Raises:
        CaptureFileError: The file cannot be read.
    """
    with CaptureReader(path) as reader, reading_errors(path):
        document = document_of(
            reader.meta,
            reader.short_ledger(MOST_LISTED),
            reader.newest_runs(MOST_LISTED),
            fields=reader.field_count,
            first_time_ns=reader.first_time_ns,
            size_bytes=_size_bytes(path),
            account=reader.channels.account,
            run_count=reader.run_count,
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
    run_count: int | None = None,
) -> CaptureDocument:
    """A capture from its metadata, ledger and newest runs, by default all; in memory or from its file."""
    described = [RunDocument.model_validate(_run(run)) for run in runs]
    trigger, group = meta.extra.get("trigger", {}), meta.extra.get("group")
    return assembled(  # validated, because the values may come from a file and have any type
        CaptureDocument,
        meta,
        device=meta.device["name"],
        verdict={True: "complete", False: "incomplete", None: None}[meta.complete],
        ended_because=meta.ended_because and _short(meta.ended_because),
        trigger_utc=trigger.get("utc"),
        pre_trigger_fields=trigger.get("n", 0),
        group=None if group is None else GroupDocument.model_validate(group),
        first_field_s=_first_field_s(meta, first_time_ns),
        lines=meta.lines if meta.is_interlaced else None,
        fields=fields,
        ledger=ledger_document(ledger, meta.rate_hz),
        runs=described,
        runs_not_listed=max((run_count or 0) - len(described), 0),
        coverage=described[-1].coverage if described else None,
        channels=channels_summary(account, sealed=meta.state == SEALED),
        pinned=False,
        size_bytes=size_bytes,
        rig=meta.extra.get("rig"),
        field_order=meta.extra.get("field_order"),
    )


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
    known |= {key: stored[key] for key in ("corrections", "corrections_not_listed") if key in stored}
    return CoverageDocument.model_validate(known)


def _summary(stored: Mapping[str, Any]) -> dict[str, Any]:
    names = ("verdict", "share", "fields", "missing_fields", "residual_px", "residual_sigma")
    if len(json.dumps(stored["findings"])) > LARGEST_FINDING:
        raise ValueError(f"the findings on a run have more than {LARGEST_FINDING} characters")
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
            "unexpected": {why: n[i] for why, n in columns.get("unexpected", {}).items() if n[i]},
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
    found = verdict_on(account, sealed=sealed)
    words = _short(found["in_words"] or "", LONGEST_WORDS)
    return ChannelsSummary.model_validate({"names": names, **found, "in_words": words})


class Descriptions:
    """A cache of descriptions, each valid until its file changes: reading a long ledger takes a while.

    Args:
        describe: Describes a file.
    """

    def __init__(self, describe: Callable[[Path], CaptureDocument]) -> None:
        self._describe = describe
        self._kept: dict[Key, tuple[CaptureDocument, int]] = {}
        self._size = 0
        self._described = runtime.condition()
        self._describing: set[Key] = set()
        self._refused: dict[Key, tuple[float, CaptureFileError | StorageError]] = {}

    def of(self, path: Path) -> CaptureDocument:
        """The description of a file; several who want it wait for one of them.

        Raises:
            CaptureFileError: The file is damaged.
            StorageError: Reading takes longer than `LONGEST_S`.
            ReadingGivenUp: The reading was cancelled.
        """
        key = (path, _changed_ns(path))
        while (known := self._known(key)) is None:
            check_patience(path.name)
            until_s, error = self._refused.get(key, (0.0, None))
            if error is not None and until_s > runtime.monotonic():
                raise error.with_traceback(None)
            if not self._begins(key):
                continue
            try:
                return self._made(key)
            finally:
                with self._described:
                    self._describing.discard(key)
                    self._described.notify_all()
        return known

    def _known(self, key: Key) -> CaptureDocument | None:
        with self._described:
            if (found := self._kept.pop(key, None)) is not None:
                self._kept[key] = found  # now the last to be dropped
            return found and found[0]

    def _begins(self, key: Key) -> bool:
        """True if nobody describes it; otherwise after a moment."""
        with self._described:
            if key in self._describing:
                self._described.wait(_MOMENT_S)
                return False
            self._describing.add(key)
            return True

    def _made(self, key: Key) -> CaptureDocument:
        try:
            with within(Patience(runtime.monotonic() + LONGEST_S, outer=CURRENT.get())):
                document = self._describe(key[0])
        except ReadingGivenUp as error:
            check_patience(key[0].name)
            raise self._refuse(key, _too_slow(key[0])) from error
        except CaptureFileError as error:
            self._refuse(key, error)
            raise
        self._keep(key, document)
        return document

    def _refuse(self, key: Key, error: T) -> T:
        """The same error, which is not looked for again for a while."""
        if len(self._refused) >= MOST_REFUSED:
            self._refused.clear()
        if key[1]:  # the file is there
            self._refused[key] = runtime.monotonic() + REFUSED_FOR_S, error
        return error

    def _keep(self, key: Key, document: CaptureDocument) -> None:
        size = len(document.model_dump_json())
        with self._described:
            self._kept[key] = document, size
            self._size += size
            while self._size > KEPT_BYTES:
                self._size -= self._kept.pop(next(iter(self._kept)))[1]


def _too_slow(path: Path) -> StorageError:
    return StorageError(
        f"describing {path.name} takes longer than {LONGEST_S:g} s",
        "it is tried again after ten minutes; to see the others sooner, move it elsewhere",
    )


def _changed_ns(path: Path) -> int:
    with storage_errors(path), suppress(FileNotFoundError):
        return path.lstat().st_mtime_ns
    return 0
