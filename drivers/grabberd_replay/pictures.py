"""From a whole picture to the fields in it."""

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from grabberd.acquisition import FieldOrder
from grabberd.field import BOTTOM, TOP, Field, split_frame


class Pictures(StrEnum):
    """What a picture is."""

    AUTO = "auto"
    FRAMES = "frames"
    FIELDS = "fields"
    DOUBLED = "doubled"


_FRAME_LINES = (576, 480)
_FIELD_LINES = (288, 240)


def recognise(pictures: Pictures, lines: int) -> Pictures:
    """What pictures of this height are.

    Raises:
        ValueError: their height does not tell, or frames have an odd number of lines.
    """
    if pictures is Pictures.AUTO:
        pictures = _by_height(lines)
    if pictures is Pictures.FRAMES and lines % 2:
        raise ValueError(f"a frame has an even number of lines, expected 576 for PAL, not {lines}")
    return pictures


def _by_height(lines: int) -> Pictures:
    if lines in _FRAME_LINES:
        return Pictures.FRAMES
    if lines in _FIELD_LINES:
        return Pictures.FIELDS
    raise ValueError(
        f"{lines} lines are neither a frame (576, 480) nor a field (288, 240); "
        "expected pictures=frames, fields or doubled"
    )


def fields_of(luma: NDArray[np.uint8], pictures: Pictures, parity: int) -> tuple[Field, ...]:
    """The fields in a picture, the older first; `parity` is the first one's."""
    if pictures is Pictures.FRAMES:
        return split_frame(luma, parity)
    if pictures is Pictures.DOUBLED:
        return (Field(luma, parity, y0=0, y_step=1),)
    return (Field.intact(luma, parity),)


def parity_named(name: str) -> int:
    """`TOP` or `BOTTOM`.

    Raises:
        ValueError: it is called neither top nor bottom.
    """
    if name not in ("top", "bottom"):
        raise ValueError(f"first_parity is 'top' or 'bottom', not {name!r}")
    return TOP if name == "top" else BOTTOM


def older_parity(order: FieldOrder) -> int:
    """Which parity of a frame was exposed first.

    Raises:
        ValueError: frames have no such order.
    """
    if order not in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST):
        raise ValueError(f"field_order of frames is 'top_first' or 'bottom_first', not {str(order)!r}")
    return TOP if order is FieldOrder.TOP_FIRST else BOTTOM
