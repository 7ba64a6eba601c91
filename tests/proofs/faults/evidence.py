"""What a capture file proves: that its account adds up, and which fields of the camera it has."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from grabberd.archive.capture.reader import CaptureReader
from grabberd.core.field import NumberedField, unpack
from grabberd.core.ledger import Ledger, LedgerEntry
from grabberd_fake import read_stamp
from grabberd_fake.faults import PERIOD_NS


class Evidence(NamedTuple):
    """Of one capture.

    Attributes:
        ledger: its account.
        camera_n: the camera's own number of field 0, by which that was exposed at `camera_n` times 20 ms of
            CLOCK_MONOTONIC; None where no field came whole.
        problems: what does not add up, in sentences.
    """

    ledger: Ledger
    camera_n: int | None
    problems: tuple[str, ...]

    def entries_between(self, begin: float, end: float) -> list[LedgerEntry]:
        """What is missing or spoiled of the camera's fields from one number to another."""
        assert self.camera_n is not None
        return [
            entry
            for entry in self.ledger.entries
            if self.camera_n + entry.end_n > begin and self.camera_n + entry.first_n < end
        ]


def evidence_of(path: Path, told: dict[str, Any] | None = None) -> Evidence:
    """Reads a capture file; `told` is what HTTP says of it."""
    with CaptureReader(path) as reader:
        fields = list(reader.received())
        ledger, problems = reader.ledger, list(_of_points(reader, fields))
    offsets = [stamp - one.n for one in fields if (stamp := _stamp(one)) is not None]
    problems += [*_of_ledger(ledger, fields, told), *_of_numbers(fields, offsets)]
    return Evidence(ledger, offsets[0] if offsets else None, tuple(problems))


def _of_ledger(ledger: Ledger, fields: list[NumberedField], told: dict[str, Any] | None) -> Iterator[str]:
    counts = {str(outcome): count for outcome, count in ledger.counts().items()}
    if sum(counts.values()) != ledger.total:
        yield f"the ledger has {sum(counts.values())} fields of {ledger.total}"
    if len(fields) != ledger.received:
        yield f"{len(fields)} fields are in the file, {ledger.received} were received"
    if told is not None and told["ledger"]["counts"] != counts:
        yield f"HTTP says {told['ledger']['counts']}, the file {counts}"


def _of_numbers(fields: list[NumberedField], offsets: list[int]) -> Iterator[str]:
    """Every field is where the number in its picture says, and was exposed when it says."""
    if len(offsets) < len(fields):
        yield f"{len(fields) - len(offsets)} fields that came whole have no number in their picture"
    if len(set(offsets)) > 1:
        yield f"fields are by {np.ptp(offsets)} places from where the camera has them"
    times = np.diff([one.time_ns for one in fields])
    off = np.abs(times - np.diff([one.n for one in fields]) * PERIOD_NS)
    if len(off) and off.max() > PERIOD_NS / 2:
        yield f"times and numbers part by {off.max() / 1e6:.1f} ms"


def _of_points(reader: CaptureReader, fields: list[NumberedField]) -> Iterator[str]:
    """Of every run that is done, each field that came whole has its points, be they none."""
    for run in reader.runs:
        measured = {n for n, _ in reader.points(run.run)}
        if run.state == "done" and measured != {one.n for one in fields}:
            yield f"run {run.run} has points of {len(measured)} fields, {len(fields)} came whole"
        if run.state == "failed" and not run.reason:
            yield f"run {run.run} failed, and does not say why"


def _stamp(numbered: NumberedField) -> int | None:
    stamp = read_stamp(unpack(numbered.packed).luma)
    return None if stamp is None else stamp.number
