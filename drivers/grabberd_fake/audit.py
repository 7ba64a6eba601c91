"""Audit of a capture: its account of fields, compared with the numbers in the pictures.

Every picture of the simulated grabber has the camera's own number in its corner, and camera field n is
exposed at n times 20 ms of the clock. So each number and time in a capture file can be checked, and a wrong
one is a lie, unless the file says that the number is uncertain by as much.
"""

import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from grabberd.errors import CaptureFileError
from grabberd.field import unpack
from grabberd.storage import CaptureReader
from grabberd_fake.faults import PERIOD_NS
from grabberd_fake.stamp import read_stamp

_UNCERTAIN = re.compile(r"number uncertain by up to (\d+)")
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
        if meta.device.get("driver") != "fake":
            raise CaptureFileError(
                f"{path}: made with driver {meta.device.get('driver')!r}, not 'fake'",
                "only the simulated grabber's pictures tell their number",
            )
        judged = [
            Judged(recorded.numbered.n, stamp.number, recorded.numbered.time_ns, recorded.reason)
            for recorded in reader.fields()
            if (stamp := read_stamp(unpack(recorded.numbered.packed).luma)) is not None
        ]
    begin_n = None
    if meta.device.get("stream", {}).get("live"):
        begin_ns = meta.start_ns - meta.extra.get("trigger", {}).get("n", 0) * PERIOD_NS
        begin_n = math.ceil(begin_ns / PERIOD_NS)
    uncertain = sum(_stated(one.reason) > 0 for one in judged)
    return Audit(ledger.total, len(judged), uncertain, tuple(lies_of(judged, begin_n)))


def lies_of(fields: Iterable[Judged], begin_n: int | None) -> Iterator[str]:
    """Sentences about fields whose number or time is another one than the camera's.

    Args:
        fields: In the order of the file.
        begin_n: Camera field that the capture was to begin with; None where nobody knows.
    """
    known, stated = None, 0
    for one in fields:
        stated = max(stated, _stated(one.reason))
        if known is None:
            known = one.camera_n - one.n
            if begin_n is not None and abs(known - begin_n) > _AT_THE_BEGIN:
                known = begin_n
        off = one.n - (one.camera_n - known)
        if abs(off) > stated:
            yield f"field {one.n} is the camera's {one.camera_n}, {abs(off)} places from where it is entered"
        late_ns = one.time_ns - one.camera_n * PERIOD_NS
        if begin_n is not None and abs(late_ns) > PERIOD_NS * (1 + stated):
            yield f"field {one.n} was exposed {-late_ns / 1e6:+.0f} ms from the time that is entered"


def _stated(reason: str | None) -> int:
    found = _UNCERTAIN.search(reason or "")
    return int(found[1]) if found else 0
