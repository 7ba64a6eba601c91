"""Exposure times and sequence numbers of the fields in a buffer.

Drivers stamp a buffer in software when the last field in it is over. A camera without a shutter exposes a
field while it reads the one before, so the exposure ends as the read-out begins: its middle lies 1.5 field
periods before the stamp. A shutter shortens the exposure at its beginning and moves its middle by up to half
a period; as long as nobody tells the exposure, that is part of the standard deviation.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from grabberd.acquisition import FieldOrder
from grabberd_v4l2 import abi
from grabberd_v4l2.layout import LaidField, Layout
from grabberd_v4l2.profiles import Profile

PERIOD_NS = 20_000_000
"""From field to field."""
_ARRIVAL_SIGMA_NS = 5_000_000
_WRAP = 2**32


class Stamp(NamedTuple):
    """Metadata that came with a buffer.

    Attributes:
        time_ns: the driver's timestamp.
        flags: of the buffer; they tell the timestamp's clock.
        sequence: the driver's count, modulo 2³².
        arrival_ns: when it was dequeued, CLOCK_MONOTONIC.
    """

    time_ns: int
    flags: int
    sequence: int
    arrival_ns: int


class FieldTime(NamedTuple):
    """A field's time and place.

    Attributes:
        time_ns: middle of its exposure.
        sequence: the driver's own count without its wrap. Frames of two fields count two; where fields come
            one a buffer it is what the driver says, be it a number of fields or of frames.
    """

    time_ns: int
    sequence: int


class FieldTimes:
    """From the stamps of buffers to times and counts of fields.

    Args:
        layout: of the buffers.
        profile: says whether the driver's timestamps are to be believed.
        exposure_ns: of the camera, if it is known.

    Raises:
        ValueError: an exposure that is longer than a field.
    """

    def __init__(self, layout: Layout, profile: Profile, exposure_ns: int | None = None) -> None:
        if exposure_ns is not None and not 0 <= exposure_ns <= PERIOD_NS:
            raise ValueError(
                f"a field is exposed for 0 to {PERIOD_NS / 1e6:.0f} ms, not {exposure_ns / 1e6} ms"
            )
        self._per_buffer = 2 if layout.order in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST) else 1
        self._believed = profile.trusts_time
        self._half_exposure_ns = (PERIOD_NS if exposure_ns is None else exposure_ns) // 2
        # Anything from none to a whole period is as likely: the middle is off by up to half of it.
        unknown_ns = PERIOD_NS / 2 / math.sqrt(3) if exposure_ns is None else 0.0
        stamp_ns = profile.time_sigma_ms * 1e6 if profile.trusts_time else _ARRIVAL_SIGMA_NS
        self._sigma_ns = round(math.hypot(unknown_ns, stamp_ns))
        self._count: int | None = None
        self._last_ns: int | None = None

    @property
    def sigma_ns(self) -> int:
        """Standard deviation of a field's time."""
        return self._sigma_ns

    def restarted(self) -> None:
        """The driver's count begins anew."""
        self._count, self._last_ns = None, None

    def handed_back(self, stamp: Stamp) -> bool:
        """True if a buffer was returned without a field of the camera; call it for each buffer, in order.

        A driver that gives up waiting for the camera flags all its buffers and returns them at one time; the
        first of them stands for the field that did not come.
        """
        before_ns, self._last_ns = self._last_ns, stamp.time_ns
        flagged = bool(stamp.flags & abi.BUF_FLAG_ERROR)
        return flagged and before_ns is not None and abs(stamp.time_ns - before_ns) < PERIOD_NS // 2

    def of(self, stamp: Stamp, fields: Sequence[LaidField]) -> tuple[FieldTime, ...]:
        """Times of the fields of one buffer; buffers are given in order."""
        newest_ns, last = self._newest_ns(stamp), self._counted(stamp.sequence) * self._per_buffer
        return tuple(
            FieldTime(newest_ns - field.age_steps * PERIOD_NS, last + self._per_buffer - 1 - field.age_steps)
            for field in fields
        )

    def _newest_ns(self, stamp: Stamp) -> int:
        """Middle of the exposure of a buffer's newest field."""
        if not self._believed or not _is_monotonic(stamp.flags):
            return stamp.arrival_ns - PERIOD_NS - self._half_exposure_ns
        if stamp.flags & abi.BUF_FLAG_TSTAMP_SRC_MASK == abi.BUF_FLAG_TSTAMP_SRC_SOE:
            return stamp.time_ns + (self._per_buffer - 1) * PERIOD_NS + self._half_exposure_ns
        return stamp.time_ns - PERIOD_NS - self._half_exposure_ns

    def _counted(self, sequence: int) -> int:
        """The driver's count without its wrap; a count that falls back falls back here too."""
        if self._count is None:
            self._count = sequence
        self._count += (sequence - self._count + _WRAP // 2) % _WRAP - _WRAP // 2
        return self._count


def _is_monotonic(flags: int) -> bool:
    return flags & abi.BUF_FLAG_TIMESTAMP_MASK == abi.BUF_FLAG_TIMESTAMP_MONOTONIC
