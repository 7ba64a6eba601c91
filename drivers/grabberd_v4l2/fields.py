"""The fields in a buffer: their layout, exposure times and sequence numbers.

Drivers timestamp a buffer in software at the end of its last field. A camera without a shutter exposes a
field while it reads out the previous one, so the exposure ends when the read-out begins: its middle is 1.5
field periods before the timestamp. A shutter shortens the start of the exposure and moves its middle by up to
half a period; unless the exposure is given, that is part of the standard deviation.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import BOTTOM, PROGRESSIVE, TOP, Field, FieldOrder
from grabberd.errors import DeviceRefused
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.formats import SCAN_625, Scan, luma
from grabberd_v4l2.node import Capability
from grabberd_v4l2.profiles import Profile

_STACKED = (Arrangement.SEQ_TB, Arrangement.SEQ_BT)
_SINGLE = {Arrangement.TOP: TOP, Arrangement.BOTTOM: BOTTOM}
_OLDER = {
    Arrangement.INTERLACED_TB: TOP,
    Arrangement.INTERLACED_BT: BOTTOM,
    Arrangement.SEQ_TB: TOP,
    Arrangement.SEQ_BT: BOTTOM,
}
_NAMES = {TOP: "top", BOTTOM: "bottom"}


@dataclass(frozen=True, slots=True)
class Granted:
    """The stream that the kernel driver granted, read back after everything was requested.

    Attributes:
        columns: Pixels per line; `lines`: lines per buffer, of a frame, a field or a progressive picture.
        bytes_per_line: Distance of two lines in the first plane.
        fourcc: Pixel format, e.g. "YUYV".
        field: V4L2_FIELD_*, never ANY.
        standard: Video standard, e.g. "PAL"; "" for a camera without one.
        node: Names and capabilities of the node.
        buffers: Number of buffers in the kernel's queue.
        scan: Lines, rate and field order of the camera.
    """

    columns: int
    lines: int
    bytes_per_line: int
    fourcc: str
    field: int
    standard: str
    node: Capability
    buffers: int
    scan: Scan = SCAN_625


class LaidField(NamedTuple):
    """A field in a buffer.

    Attributes:
        luma: (field_rows, columns) uint8, often a view into the buffer.
        parity: `TOP`, `BOTTOM` or `PROGRESSIVE`.
        age_steps: Age relative to the newest field in the buffer, in field periods: 0 or 1.
        lines: Lines of the buffer that are its rows.
    """

    luma: NDArray[np.uint8]
    parity: int
    age_steps: int
    lines: slice

    @property
    def field(self) -> Field:
        """The field as returned by the driver."""
        if self.parity == PROGRESSIVE:
            return Field.progressive(self.luma)
        return Field.intact(self.luma, self.parity)


class _Part(NamedTuple):
    rows: slice
    parity: int
    age_steps: int


@dataclass(frozen=True, slots=True)
class Layout:
    """Position of the fields in every buffer of a stream.

    Attributes:
        granted: The granted stream.
        order: Order in which its fields arrive.
        rate_hz: Fields or progressive pictures per second.
        field_rows: Rows per field or progressive picture.
        remarks: Remarks for the operator.
    """

    granted: Granted
    order: FieldOrder
    rate_hz: float
    field_rows: int
    remarks: tuple[str, ...]
    _parts: Mapping[int, tuple[_Part, ...]]
    """Parts by the buffer's field entry; under ANY if that entry is irrelevant."""

    @classmethod
    def of(cls, granted: Granted, profile: Profile, older: int | None = None) -> "Layout":
        """The layout of a stream.

        Args:
            granted: The granted stream.
            profile: Profile of the kernel driver.
            older: Parity of the older field, overriding driver and profile.

        Raises:
            DeviceRefused: Such buffers contain no complete fields.
        """
        if granted.scan.is_progressive:
            return cls._progressive(granted)
        arrangement = _believed(granted, profile)
        if arrangement is Arrangement.ALTERNATE:
            return cls._alternate(granted)
        if arrangement in _SINGLE:
            return cls._single(granted, _SINGLE[arrangement])
        # The installer's option has priority, since some drivers report a wrong arrangement. INTERLACED does
        # not state the order: it comes from the profile (for usbtv, bottom first) or else from the standard.
        if older is None:
            older = _OLDER.get(arrangement, profile.older_parity)
        return cls._frames(granted, arrangement, granted.scan.older if older is None else older)

    @property
    def fields_per_buffer(self) -> int:
        """Number of fields in a buffer."""
        return 2 if self.order in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST) else 1

    @property
    def period_ns(self) -> int:
        """The camera's time from field to field, even if only one parity is delivered, or from picture to
        picture.
        """
        return self.granted.scan.period_ns

    def fields(self, buffer: NDArray[np.uint8], buffer_field: int) -> tuple[LaidField, ...]:
        """The fields in a buffer, the older first.

        Args:
            buffer: (n,) uint8.
            buffer_field: The driver's field entry (`v4l2_buffer.field`): the parity if it has one field.

        Raises:
            DeviceRefused: A buffer with one field does not state its parity.
            ValueError: The buffer is too short.
        """
        parts = self._parts.get(buffer_field) or self._parts.get(Arrangement.ANY)
        if parts is None:
            raise _no_parity(self.granted, buffer_field)
        return tuple(
            LaidField(self._luma(buffer, part.rows), part.parity, part.age_steps, part.rows) for part in parts
        )

    def _luma(self, buffer: NDArray[np.uint8], rows: slice) -> NDArray[np.uint8]:
        granted = self.granted
        return luma(buffer, granted.fourcc, granted.lines, granted.columns, granted.bytes_per_line, rows)

    @classmethod
    def _progressive(cls, granted: Granted) -> "Layout":
        parts = {int(Arrangement.ANY): (_Part(slice(None), PROGRESSIVE, 0),)}
        return cls(granted, FieldOrder.PROGRESSIVE, granted.scan.rate_hz, granted.lines, (), parts)

    @classmethod
    def _alternate(cls, granted: Granted) -> "Layout":
        whole = slice(None)
        parts = {int(field): (_Part(whole, parity, 0),) for field, parity in _SINGLE.items()}
        rate_hz = granted.scan.rate_hz
        return cls(granted, FieldOrder.ALTERNATE, rate_hz, *_height(granted, granted.lines), parts)

    @classmethod
    def _single(cls, granted: Granted, parity: int) -> "Layout":
        rows, remarks = _height(granted, granted.lines)
        both_hz = granted.scan.rate_hz
        remark = (
            f"the driver {granted.node.driver} delivers only the {_NAMES[parity]} field of every frame: "
            f"{both_hz / 2:.0f} fields a second instead of {both_hz:.0f}"
        )
        parts = {int(Arrangement.ANY): (_Part(slice(None), parity, 0),)}
        return cls(granted, FieldOrder.ONE_PARITY, both_hz / 2, rows, (remark, *remarks), parts)

    @classmethod
    def _frames(cls, granted: Granted, arrangement: Arrangement, older: int) -> "Layout":
        if granted.lines % 2:
            what = f"{granted.lines} lines are not two fields"
            raise _refused(granted, what, f"ask for {granted.scan.lines} lines")
        rows, remarks = _height(granted, granted.lines // 2)
        places = _places(arrangement, rows)
        parts = tuple(_Part(places[p], p, age) for p, age in ((older, 1), (1 - older, 0)))
        order = FieldOrder.TOP_FIRST if older == TOP else FieldOrder.BOTTOM_FIRST
        return cls(granted, order, granted.scan.rate_hz, rows, remarks, {Arrangement.ANY: parts})


def _believed(granted: Granted, profile: Profile) -> Arrangement:
    """The actual arrangement of the buffers.

    Raises:
        DeviceRefused: The buffers cannot be split into fields.
    """
    arrangement = Arrangement(granted.field)
    if arrangement is Arrangement.NONE and profile.none_is_woven:
        return Arrangement.INTERLACED
    if arrangement in (Arrangement.NONE, Arrangement.ANY):
        what = f"its pictures have no fields (V4L2_FIELD_{arrangement.name})"
        advice = "use a grabber that delivers both fields of every frame; see 'grabberd devices'"
        raise _refused(granted, what, profile.advice or advice)
    return arrangement


def _places(arrangement: Arrangement, rows: int) -> dict[int, slice]:
    """Lines of a frame that belong to each parity."""
    if arrangement in _STACKED:
        upper = _OLDER[arrangement]
        return {upper: slice(0, rows), 1 - upper: slice(rows, 2 * rows)}
    return {parity: slice(parity, None, 2) for parity in (TOP, BOTTOM)}


def _height(granted: Granted, rows: int) -> tuple[int, tuple[str, ...]]:
    """Rows of a field, with a remark if some are missing.

    Raises:
        DeviceRefused: There are more rows than a field has, so they are interpolated.
    """
    lines = granted.scan.lines
    most = lines // 2
    if rows > most:
        what = f"{rows} rows a field are more than the {most} that the camera has: the driver scales"
        raise _refused(granted, what, f"switch its scaler off, or request woven frames of {lines} lines")
    remark = f"a field has only {rows} of {most} rows: the driver cuts or scales the picture"
    return rows, (remark,) if rows < most else ()


def _no_parity(granted: Granted, buffer_field: int) -> DeviceRefused:
    what = f"a buffer of alternating fields does not state its parity (field {buffer_field})"
    return _refused(granted, what, "request woven frames: put 'interlaced' first in the field orders")


def _refused(granted: Granted, what: str, hint: str) -> DeviceRefused:
    return DeviceRefused(f"{granted.node.card} (driver {granted.node.driver}): {what}", hint)


# Scheduling and USB batches of up to 8 ms delay a buffer's arrival in this process.
_ARRIVAL_SIGMA_NS = 5_000_000
_WRAP = 2**32
_GAP = 1.5
"""Times from buffer to buffer after which one is missing."""


class Stamp(NamedTuple):
    """Metadata that came with a buffer.

    Attributes:
        time_ns: The driver's timestamp.
        flags: Flags of the buffer, including the timestamp's clock.
        sequence: The driver's count, modulo 2³².
        arrival_ns: Time when it was dequeued, CLOCK_MONOTONIC.
    """

    time_ns: int
    flags: int
    sequence: int
    arrival_ns: int


class FieldTime(NamedTuple):
    """A field's time and place.

    Attributes:
        time_ns: Middle of the field's exposure.
        sequence: The driver's count, unwrapped. Frames of two fields count twice; with one field or picture
            per buffer it is the driver's number, whether it counts fields or frames.
    """

    time_ns: int
    sequence: int


class FieldTimes:
    """Converts the stamps of buffers to times and counts of fields.

    Args:
        layout: Layout of the buffers.
        profile: Profile of the driver, which states whether its timestamps are trusted.
        exposure_ns: Exposure time of the camera, if known.

    Attributes:
        sigma_ns: Standard deviation of a field's time.
        follows_gap: True if a buffer is missing before the last one that `handed_back` was called for.

    Raises:
        DeviceRefused: The exposure is longer than the time from field to field.
    """

    def __init__(self, layout: Layout, profile: Profile, exposure_ns: int | None = None) -> None:
        self._period_ns = period_ns = layout.period_ns
        if exposure_ns is not None and not 0 <= exposure_ns <= period_ns:
            raise DeviceRefused(
                f"at {layout.rate_hz:.6g} Hz a field is exposed for 0 to {period_ns / 1e6:.3g} ms, not "
                f"{exposure_ns / 1e6:g} ms",
                "correct the option 'exposure_ms', or leave it out if the exposure is not known",
            )
        self._per_buffer = layout.fields_per_buffer
        self._believed = profile.trusts_time
        self._half_exposure_ns = (period_ns if exposure_ns is None else exposure_ns) // 2
        # Any exposure up to a full period is equally likely, which moves the middle by up to half a period.
        unknown_ns = period_ns / 2 / math.sqrt(3) if exposure_ns is None else 0.0
        stamp_ns = profile.time_sigma_ms * 1e6 if profile.trusts_time else _ARRIVAL_SIGMA_NS
        self.sigma_ns = round(math.hypot(unknown_ns, stamp_ns))
        self._count: int | None = None
        self._last_ns: int | None = None
        self.follows_gap = False

    def handed_back(self, stamp: Stamp) -> bool:
        """True if a buffer was returned without a field; to be called for each buffer, in order.

        A driver that gives up waiting for the camera flags all its buffers and returns them at once; the
        first of them counts for the missing field.
        """
        before_ns, self._last_ns = self._last_ns, stamp.time_ns
        buffers = (
            0.0 if before_ns is None else (stamp.time_ns - before_ns) / self._period_ns / self._per_buffer
        )
        self.follows_gap = buffers > _GAP
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
        # SOE: the timestamp is the start of the exposure, as for UVC devices, not the end of the last field.
        if stamp.flags & abi.BUF_FLAG_TSTAMP_SRC_MASK == abi.BUF_FLAG_TSTAMP_SRC_SOE:
            return stamp.time_ns + (self._per_buffer - 1) * self._period_ns + self._half_exposure_ns
        return stamp.time_ns - self._period_ns - self._half_exposure_ns

    def _counted(self, sequence: int) -> int:
        """The driver's count, unwrapped; decreases if the driver counts backward."""
        if self._count is None:
            self._count = sequence
        self._count += (sequence - self._count + _WRAP // 2) % _WRAP - _WRAP // 2
        return self._count


def _is_monotonic(flags: int) -> bool:
    return flags & abi.BUF_FLAG_TIMESTAMP_MASK == abi.BUF_FLAG_TIMESTAMP_MONOTONIC
