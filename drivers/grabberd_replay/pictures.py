"""Splitting of whole pictures into their fields."""

from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.acquisition import FieldOrder, GrabbedField
from grabberd.errors import DeviceRefused
from grabberd.field import BOTTOM, TOP, Field, split_frame
from grabberd_replay.recording import Batch, Format


class Pictures(StrEnum):
    """Kind of a picture: woven frame or single field."""

    AUTO = "auto"
    FRAMES = "frames"
    FIELDS = "fields"
    DOUBLED = "doubled"

    @property
    def fields(self) -> int:
        """Number of fields in one picture."""
        return 2 if self is Pictures.FRAMES else 1


PAL_HZ = 50.0
"""Fields a second."""

_FRAME_LINES = (576, 480)
_FIELD_LINES = (288, 240)


def recognise(path: Path, pictures: Pictures, lines: int) -> Pictures:
    """Kind of pictures of this height in `path`.

    Raises:
        DeviceRefused: the kind cannot be told from the height, or frames have an odd number of lines.
    """
    found = _by_height(lines) if pictures is Pictures.AUTO else pictures
    hint = "give their kind by the option 'pictures', or scale them"
    if found is None:
        raise DeviceRefused(
            f"{path}: {lines} lines are neither a frame (576, 480) nor a field (288, 240); "
            "expected pictures=frames, fields or doubled",
            hint,
        )
    if found is Pictures.FRAMES and lines % 2:
        raise DeviceRefused(
            f"{path}: a frame has an even number of lines, expected 576 for PAL, not {lines}", hint
        )
    return found


def _by_height(lines: int) -> Pictures | None:
    if lines in _FRAME_LINES:
        return Pictures.FRAMES
    return Pictures.FIELDS if lines in _FIELD_LINES else None


class Splitter(NamedTuple):
    """Splitter of pictures without parity and time of their own.

    Attributes:
        pictures: kind of the pictures, not AUTO.
        order: order of the fields of a frame.
        first_parity: parity of the first field, if pictures are fields or doubled.
        rate_hz: fields per second, the first at time zero.
    """

    pictures: Pictures
    order: FieldOrder
    first_parity: int
    rate_hz: float

    def batch(self, luma: NDArray[np.uint8], number: int) -> Batch:
        """The fields of picture `number`, counted from 0, the older first."""
        first = number * self.pictures.fields
        return [
            GrabbedField(field, round(n * 1e9 / self.rate_hz), n, None)
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
            field_order=self.order if self.pictures is Pictures.FRAMES else FieldOrder.ALTERNATE,
            pixel_format="GREY",
            counts_losses=True,
            details={"pictures": str(self.pictures), "size": f"{columns}x{lines}", **details},
            remarks=remarks,
        )

    def _split(self, luma: NDArray[np.uint8], parity: int) -> tuple[Field, ...]:
        if self.pictures is Pictures.FRAMES:
            return split_frame(luma, parity)
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
