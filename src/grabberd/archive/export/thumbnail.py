"""A small picture of a capture: the field in its middle, a quarter as wide and as high as a frame."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.reader import CaptureReader, Opened
from grabberd.archive.export.grey_png import grey_png
from grabberd.core.field import unpack
from grabberd.errors import NotFound

SHARE = 4
"""Pixels and frame lines that become one."""
_AROUND = 50
"""Fields among which the nearest to the middle is taken: the middle one may be lost."""


def thumbnail_png(path: Path, opened: Opened = CaptureReader) -> bytes:
    """The small picture as PNG.

    Args:
        path: The capture.
        opened: Opens the capture.

    Raises:
        CaptureFileError: The file cannot be read.
        NotFound: It has no fields.
    """
    with opened(path) as reader:
        middle = (reader.first_n or 0) + reader.field_span // 2
        field = next(reader.fields(middle, middle + _AROUND), None) or next(reader.fields(), None)
        if field is None:
            raise NotFound(f"capture {reader.meta.id} has no fields", "its ledger says what became of them")
        packed = field.numbered.packed
    return grey_png(smaller(unpack(packed).luma, SHARE // packed.y_step))


def smaller(luma: NDArray[np.uint8], rows: int) -> NDArray[np.uint8]:
    """A picture with the mean of so many rows and of `SHARE` columns in place of each; the rest is cut off.

    Targets stay visible: a white disc becomes a grey one, and is never passed over.
    """
    height, width = luma.shape[0] // rows, luma.shape[1] // SHARE
    blocks = luma[: height * rows, : width * SHARE].reshape(height, rows, width, SHARE)
    small: NDArray[np.uint8] = blocks.mean(axis=(1, 3), dtype=np.float32).astype(np.uint8)
    return small
