"""Layout of the fields in a buffer."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import BOTTOM, PROGRESSIVE, TOP, Field, FieldOrder
from grabberd.errors import DeviceRefused
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.formats import luma
from grabberd_v4l2.profiles import Profile
from grabberd_v4l2.standards import SCAN_625, Scan

_WOVEN = (Arrangement.INTERLACED, Arrangement.INTERLACED_TB, Arrangement.INTERLACED_BT)
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
        columns: pixels per line; `lines`: lines per buffer: of a frame, of one field, or of a whole picture.
        bytes_per_line: distance of two lines in the first plane.
        fourcc: pixel format, e.g. "YUYV".
        field: V4L2_FIELD_*, never ANY.
        standard: video standard, e.g. "PAL"; "" for a camera without.
        kernel_driver: kernel driver, e.g. "bttv"; `card`: the device's own name; `bus_info`: its location.
        buffers: number of buffers in the kernel's queue.
        scan: what the camera scans.
    """

    columns: int
    lines: int
    bytes_per_line: int
    fourcc: str
    field: int
    standard: str
    kernel_driver: str
    card: str
    bus_info: str
    buffers: int
    scan: Scan = SCAN_625


class LaidField(NamedTuple):
    """A field in a buffer.

    Attributes:
        luma: (field_rows, columns) uint8, often a view into the buffer.
        parity: `TOP`, `BOTTOM` or `PROGRESSIVE`.
        age_steps: age relative to the newest field in the buffer, in field periods: 0 or 1.
    """

    luma: NDArray[np.uint8]
    parity: int
    age_steps: int

    @property
    def field(self) -> Field:
        """The field that leaves the driver."""
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
        granted: the granted stream.
        order: order in which its fields arrive.
        rate_hz: fields per second, or whole pictures.
        field_rows: rows per field, or per picture.
        remarks: remarks for the operator.
    """

    granted: Granted
    order: FieldOrder
    rate_hz: float
    field_rows: int
    remarks: tuple[str, ...]
    _parts: Mapping[int, tuple[_Part, ...]]
    """Parts by the buffer's own field entry; under ANY if that entry is irrelevant."""

    @classmethod
    def of(cls, granted: Granted, profile: Profile, older: int | None = None) -> "Layout":
        """The layout of a stream.

        Args:
            granted: the granted stream.
            profile: profile of the kernel driver.
            older: parity of the older field, overriding driver and profile.

        Raises:
            DeviceRefused: such buffers contain no whole fields.
        """
        if granted.scan.is_progressive:
            return cls._progressive(granted)
        arrangement = _believed(granted, profile)
        if arrangement is Arrangement.ALTERNATE:
            return cls._alternate(granted)
        if arrangement in _SINGLE:
            return cls._single(granted, _SINGLE[arrangement])
        # The installer's word comes first, then the arrangement, which some drivers state wrongly; plain
        # INTERLACED leaves it to the profile (usbtv's older field is the bottom one), else to the standard.
        if older is None:
            older = _OLDER.get(arrangement, profile.older_parity)
        return cls._frames(granted, arrangement, granted.scan.older if older is None else older)

    @property
    def period_ns(self) -> int:
        """Time from field to field of the camera, whether both parities are delivered or one, or from picture
        to picture.
        """
        return self.granted.scan.period_ns

    def fields(self, buffer: NDArray[np.uint8], buffer_field: int) -> tuple[LaidField, ...]:
        """The fields in a buffer, the older first.

        Args:
            buffer: (n,) uint8.
            buffer_field: the driver's field entry (`v4l2_buffer.field`); decides if a buffer has one field.

        Raises:
            DeviceRefused: a buffer of one field does not tell its parity.
            ValueError: the buffer is too short.
        """
        parts = self._parts.get(buffer_field) or self._parts.get(Arrangement.ANY)
        if parts is None:
            raise _no_parity(self.granted, buffer_field)
        return tuple(LaidField(self._luma(buffer, part.rows), *part[1:]) for part in parts)

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
            f"the driver {granted.kernel_driver} delivers only the {_NAMES[parity]} field of every frame: "
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
        DeviceRefused: the buffers cannot be split into fields.
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
        DeviceRefused: there are more rows than a field has, so they are interpolated.
    """
    lines = granted.scan.lines
    most = lines // 2
    if rows > most:
        what = f"{rows} rows a field are more than the {most} that the camera has: the driver scales"
        raise _refused(granted, what, f"switch its scaler off, or request woven frames of {lines} lines")
    remark = f"a field has only {rows} of {most} rows: the driver cuts or scales the picture"
    return rows, (remark,) if rows < most else ()


def _no_parity(granted: Granted, buffer_field: int) -> DeviceRefused:
    what = f"a buffer of alternating fields does not tell its parity (field {buffer_field})"
    return _refused(granted, what, "request woven frames: put 'interlaced' first in the field orders")


def _refused(granted: Granted, what: str, hint: str) -> DeviceRefused:
    return DeviceRefused(f"{granted.card} (driver {granted.kernel_driver}): {what}", hint)
