"""Recordings as the driver sees them, and whole pictures split into the fields that they deliver."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import BOTTOM, TOP, Field, FieldOrder, split_frame, standard_rate_hz
from grabberd.errors import DeviceRefused
from grabberd.instrument.acquisition import GrabbedField

Batch = Sequence[GrabbedField]
"""The fields of one picture, the older first."""


@dataclass(frozen=True, slots=True)
class Format:
    """Properties of a recording's fields, in the terms of `StreamInfo`."""

    columns: int
    field_rows: int
    rate_hz: float
    field_order: FieldOrder
    counts_losses: bool
    details: dict[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


class Recording(Protocol):
    """An opened recording."""

    format: Format

    def batches(self) -> Iterator[Batch]:
        """Every picture's fields in order of time.

        Raises:
            PictureError, CaptureFileError: the next picture cannot be read; those before it were delivered.
        """
        ...

    def close(self) -> None:
        """Closes the recording; may be called twice. Nothing to do unless it keeps a file open."""
        return


class Pictures(StrEnum):
    """Kind of a picture: woven frame, single field, or all that a progressive camera saw at one moment."""

    AUTO = "auto"
    FRAMES = "frames"
    FIELDS = "fields"
    DOUBLED = "doubled"
    PROGRESSIVE = "progressive"

    @property
    def fields(self) -> int:
        """Number of fields in one picture."""
        return 2 if self is Pictures.FRAMES else 1


_FRAME_SIZES = {(columns, 576) for columns in (704, 720, 768)} | {(704, 480), (720, 480), (720, 486)}
_FIELD_LINES = (288, 240)
_EITHER_LINES = (480, 486, 576, 1080)
"""Lines of frames of other widths as well as of progressive pictures."""


def recognise(
    path: Path, pictures: Pictures, lines: int, columns: int, *, interlaced: bool = False
) -> Pictures:
    """Kind of pictures of this size in `path`.

    Args:
        path: where they are from.
        pictures: their kind as it was given.
        lines: their height.
        columns: their width.
        interlaced: True if they are marked as frames of two fields.

    Raises:
        DeviceRefused: the kind cannot be told from the size, or frames have an odd number of lines.
    """
    found = _by_size(lines, columns) if pictures is Pictures.AUTO else pictures
    if interlaced and pictures is Pictures.AUTO and found is not Pictures.FIELDS:
        found = Pictures.FRAMES
    hint = "give their kind by the option 'pictures': 'grabberd inspect' tells it from what they show"
    if found is None:
        raise DeviceRefused(
            f"{path}: pictures of {columns}x{lines} may be interlaced frames or progressive; "
            "expected pictures=frames or progressive",
            hint,
        )
    if found is Pictures.FRAMES and lines % 2:
        raise DeviceRefused(
            f"{path}: a frame has an even number of lines, expected 576 for PAL, not {lines}", hint
        )
    return found


def _by_size(lines: int, columns: int) -> Pictures | None:
    if (columns, lines) in _FRAME_SIZES:
        return Pictures.FRAMES
    if lines in _FIELD_LINES:
        return Pictures.FIELDS
    return None if lines in _EITHER_LINES else Pictures.PROGRESSIVE


def usual_rate_hz(path: Path, pictures: Pictures, lines: int) -> float:
    """Fields a second where nothing tells the rate: that of the video standard.

    Raises:
        DeviceRefused: progressive pictures have none.
    """
    if pictures is Pictures.PROGRESSIVE:
        raise DeviceRefused(
            f"{path}: nothing tells how many progressive pictures there are a second", "give 'rate_hz'"
        )
    frame_lines = lines if pictures in (Pictures.FRAMES, Pictures.DOUBLED) else 2 * lines
    return standard_rate_hz(frame_lines)


class Splitter(NamedTuple):
    """Splitter of pictures into fields.

    Attributes:
        pictures: kind of the pictures, not AUTO.
        order: order of the fields of a frame.
        first_parity: parity of the first field, if pictures are fields or doubled.
        rate_hz: fields per second.
    """

    pictures: Pictures
    order: FieldOrder
    first_parity: int
    rate_hz: float

    def batch(self, luma: NDArray[np.uint8], number: int, time_s: float, damage: str | None = None) -> Batch:
        """The fields of picture `number`, counted from 0 and taken at this time, the older first."""
        first = number * self.pictures.fields
        return [
            GrabbedField(field, round((time_s + (n - first) / self.rate_hz) * 1e9), n, damage)
            for n, field in enumerate(self._split(luma, self._parity(first)), start=first)
        ]

    def format(
        self, lines: int, columns: int, details: dict[str, str], remarks: tuple[str, ...] = ()
    ) -> Format:
        """Format of a recording with pictures of this size."""
        return Format(
            columns=columns,
            field_rows=lines // self.pictures.fields,
            rate_hz=self.rate_hz,
            field_order=self._order_of_fields,
            counts_losses=True,
            details={"pictures": str(self.pictures), "size": f"{columns}x{lines}", **details},
            remarks=remarks,
        )

    @property
    def _order_of_fields(self) -> FieldOrder:
        if self.pictures is Pictures.FRAMES:
            return self.order
        return FieldOrder.PROGRESSIVE if self.pictures is Pictures.PROGRESSIVE else FieldOrder.ALTERNATE

    def _split(self, luma: NDArray[np.uint8], parity: int) -> tuple[Field, ...]:
        if self.pictures is Pictures.FRAMES:
            return split_frame(luma, parity)
        if self.pictures is Pictures.PROGRESSIVE:
            return (Field.progressive(luma),)
        if self.pictures is Pictures.DOUBLED:
            return (Field(luma, parity, y0=0, y_step=1),)
        return (Field.intact(luma, parity),)

    def _parity(self, n: int) -> int:
        if self.pictures is Pictures.FRAMES:
            return older_parity(self.order)
        return self.first_parity if n % 2 == 0 else TOP + BOTTOM - self.first_parity


def parity_named(name: str) -> int:
    """`TOP` or `BOTTOM`.

    Raises:
        ValueError: it is called neither top nor bottom.
    """
    if name not in ("top", "bottom"):
        raise ValueError(f"first_parity is 'top' or 'bottom', not {name!r}")
    return TOP if name == "top" else BOTTOM


def older_parity(order: FieldOrder) -> int:
    """Parity of the field of a frame that was exposed first.

    Raises:
        ValueError: the order is not one of frames.
    """
    if order not in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST):
        raise ValueError(f"field_order of frames is 'top_first' or 'bottom_first', not {str(order)!r}")
    return TOP if order is FieldOrder.TOP_FIRST else BOTTOM
