"""Audit of a capture: its account of fields, compared with the numbers in the pictures.

Every picture of the simulated grabber has the camera's own number in its corner, and camera field n is
exposed at n periods of the clock. So each number and time in a capture file can be checked, and a wrong
one is a lie, unless the file says of this very field that its number is uncertain by as much, or of one
before it that the numbers from there on are off by as many.
"""

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from grabberd.archive.capture.reader import CaptureReader
from grabberd.core.field import unpack
from grabberd_fake.faults import PERIOD_NS
from grabberd_fake.stamp import read_stamp
from grabberd_fake.truth import check_driver

_UNCERTAIN = re.compile(r"number uncertain by up to (\d+)")
_OFF = re.compile(r"numbers from here on are (\d+) too (high|low)")
_AT_THE_BEGIN = 1
"""Fields by which the begin may be off: where it lies between two of them, times decide, and they jitter."""


class Judged(NamedTuple):
    """A recorded field whose picture has a legible number.

    Attributes:
        n: Its number in the file.
        camera_n: Its number in the picture.
        time_ns: Its time in the file.
        reason: Its reason in the file, or None.
    """

    n: int
    camera_n: int
    time_ns: int
    reason: str | None


class Audit(NamedTuple):
    """Result of an audit.

    Attributes:
        fields: Number of fields in the account.
        judged: Number of those whose picture tells their number.
        uncertain: Number of those that the file says are uncertain.
        lies: What is wrong, in sentences.
    """

    fields: int
    judged: int
    uncertain: int
    lies: tuple[str, ...]


def audit(path: Path) -> Audit:
    """Audits a capture file.

    Raises:
        CaptureFileError: It cannot be read, or was not made by the simulated grabber.
    """
    with CaptureReader(path) as reader:
        meta, ledger = reader.meta, reader.ledger
        period_ns = round(1e9 / meta.rate_hz)
        check_driver(path, meta.device, "only the simulated grabber's pictures tell their number")
        judged = [
            Judged(recorded.numbered.n, stamp.number, recorded.numbered.time_ns, recorded.reason)
            for recorded in reader.fields()
            if (stamp := read_stamp(unpack(recorded.numbered.packed).luma)) is not None
        ]
    begin_n = None
    if meta.device.get("stream", {}).get("live"):
        begin_ns = meta.start_ns - meta.extra.get("trigger", {}).get("n", 0) * period_ns
        begin_n = math.ceil(begin_ns / period_ns)
    uncertain = sum(_stated(one.reason) > 0 for one in judged)
    too_high = [(event.n, _too_high_by(event.reason)) for event in ledger.events]
    return Audit(ledger.total, len(judged), uncertain, tuple(lies_of(judged, begin_n, too_high, period_ns)))


def lies_of(
    fields: Iterable[Judged],
    begin_n: int | None,
    too_high: Sequence[tuple[int, int]] = (),
    period_ns: int = PERIOD_NS,
) -> Iterator[str]:
    """Sentences about fields whose number or time is another one than the camera's.

    Args:
        fields: In the order of the file.
        begin_n: Camera field that the capture was to begin with; None where nobody knows.
        too_high: Fields from which on the file says that numbers are too high, and by how many.
        period_ns: Time from field to field of the camera.
    """
    fields = list(fields)

    def places(one: Judged) -> int:
        return one.n - one.camera_n - sum(by for n, by in too_high if n <= one.n)

    certain = next((one for one in fields if not _stated(one.reason)), fields[0] if fields else None)
    known = 0 if certain is None else -places(certain)
    if begin_n is not None and abs(known - begin_n) > _AT_THE_BEGIN:
        known = begin_n
    for one in fields:
        stated = _stated(one.reason)
        off = places(one) + known
        if abs(off) > stated:
            yield f"field {one.n} is the camera's {one.camera_n}, {abs(off)} places from where it is entered"
        late_ns = one.time_ns - one.camera_n * period_ns
        if begin_n is not None and abs(late_ns) > period_ns * (1 + stated):
            yield f"field {one.n} was exposed {-late_ns / 1e6:+.0f} ms from the time that is entered"


def _too_high_by(reason: str) -> int:
    found = _OFF.search(reason)
    return 0 if found is None else int(found[1]) * (1 if found[2] == "high" else -1)


def _stated(reason: str | None) -> int:
    found = _UNCERTAIN.search(reason or "")
    return int(found[1]) if found else 0
