"""Exposure times and sequence numbers of the fields in a buffer.

Drivers stamp a buffer in software at the end of its last field. A camera without a shutter exposes a field
while it reads out the one before, so the exposure ends as the read-out begins: its middle lies 1.5 field
periods before the stamp. A shutter shortens the exposure at its beginning and moves its middle by up to half
a period; unless the exposure is given, that is part of the standard deviation.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from grabberd.core.field import FieldOrder
from grabberd.errors import DeviceRefused
from grabberd_v4l2 import abi
from grabberd_v4l2.layout import LaidField, Layout
from grabberd_v4l2.profiles import Profile

# Scheduling and USB batches of up to 8 ms delay a buffer's arrival in this process.
_ARRIVAL_SIGMA_NS = 5_000_000
_WRAP = 2**32


class Stamp(NamedTuple):
    """Metadata that came with a buffer.

    Attributes:
        time_ns: the driver's timestamp.
        flags: flags of the buffer, which include the timestamp's clock.
        sequence: the driver's count, modulo 2³².
        arrival_ns: time of its dequeuing, CLOCK_MONOTONIC.
    """

    time_ns: int
    flags: int
    sequence: int
    arrival_ns: int


class FieldTime(NamedTuple):
    """A field's time and place.

    Attributes:
        time_ns: middle of the field's exposure.
        sequence: the driver's own count, unwrapped. Frames of two fields count two; with one field or picture
            per buffer it is the driver's number, whether it counts fields or frames.
    """

    time_ns: int
    sequence: int


class FieldTimes:
    """From the stamps of buffers to times and counts of fields.

    Args:
        layout: layout of the buffers.
        profile: profile of the driver, with the trust in its timestamps.
        exposure_ns: exposure time of the camera, if known.

    Raises:
        DeviceRefused: the exposure is longer than the time from field to field.
    """

    def __init__(self, layout: Layout, profile: Profile, exposure_ns: int | None = None) -> None:
        self._period_ns = period_ns = layout.period_ns
        if exposure_ns is not None and not 0 <= exposure_ns <= period_ns:
            raise DeviceRefused(
                f"at {layout.rate_hz:.6g} Hz a field is exposed for 0 to {period_ns / 1e6:.3g} ms, not "
                f"{exposure_ns / 1e6:g} ms",
                "correct the option 'exposure_ms', or leave it out if the exposure is not known",
            )
        self._per_buffer = 2 if layout.order in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST) else 1
        self._believed = profile.trusts_time
        self._half_exposure_ns = (period_ns if exposure_ns is None else exposure_ns) // 2
        # Any exposure up to a whole period is equally likely, which moves the middle by up to half of it.
        unknown_ns = period_ns / 2 / math.sqrt(3) if exposure_ns is None else 0.0
        stamp_ns = profile.time_sigma_ms * 1e6 if profile.trusts_time else _ARRIVAL_SIGMA_NS
        self._sigma_ns = round(math.hypot(unknown_ns, stamp_ns))
        self._count: int | None = None
        self._last_ns: int | None = None

    @property
    def sigma_ns(self) -> int:
        """Standard deviation of a field's time."""
        return self._sigma_ns

    def handed_back(self, stamp: Stamp) -> bool:
        """True if a buffer was returned without a field of the camera; call it for each buffer, in order.

        A driver that gives up waiting for the camera flags all its buffers and returns them at once; the
        first of them stands for the missing field.
        """
        before_ns, self._last_ns = self._last_ns, stamp.time_ns
        flagged = bool(stamp.flags & abi.BUF_FLAG_ERROR)
        return flagged and before_ns is not None and abs(stamp.time_ns - before_ns) < self._period_ns // 2

    def of(self, stamp: Stamp, fields: Sequence[LaidField]) -> tuple[FieldTime, ...]:
        """Times of the fields of one buffer; to be called in the order of the buffers."""
        newest_ns, last = self._newest_ns(stamp), self._counted(stamp.sequence) * self._per_buffer
        return tuple(
            FieldTime(
                newest_ns - field.age_steps * self._period_ns, last + self._per_buffer - 1 - field.age_steps
            )
            for field in fields
        )

    def _newest_ns(self, stamp: Stamp) -> int:
        """Middle of the exposure of a buffer's newest field."""
        if not self._believed or not _is_monotonic(stamp.flags):
            return stamp.arrival_ns - self._period_ns - self._half_exposure_ns
        # SOE: the stamp is the start of exposure, as from UVC devices, not the end of the last field.
        if stamp.flags & abi.BUF_FLAG_TSTAMP_SRC_MASK == abi.BUF_FLAG_TSTAMP_SRC_SOE:
            return stamp.time_ns + (self._per_buffer - 1) * self._period_ns + self._half_exposure_ns
        return stamp.time_ns - self._period_ns - self._half_exposure_ns

    def _counted(self, sequence: int) -> int:
        """The driver's count, unwrapped; if the driver counts backward, so does the result."""
        if self._count is None:
            self._count = sequence
        self._count += (sequence - self._count + _WRAP // 2) % _WRAP - _WRAP // 2
        return self._count


def _is_monotonic(flags: int) -> bool:
    return flags & abi.BUF_FLAG_TIMESTAMP_MASK == abi.BUF_FLAG_TIMESTAMP_MONOTONIC
