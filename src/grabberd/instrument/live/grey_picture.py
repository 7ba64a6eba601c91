"""Grey pictures for a screen: a part of a field, with as much detail as a link carries."""

import zlib
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.light import CLIPPED_LEVEL
from grabberd.core.field import Field

BLACK_LEVEL = 1
"""Grey value up to which a pixel is as dark as the camera gets."""
WHITE, BLACK = 255, 0
"""Grey values that no other pixel is sent as: by them a client tells what is over- or under-exposed."""


class Detail(NamedTuple):
    """Detail of a picture.

    Attributes:
        step: Number of grey values that are sent as one.
        reduce: Number of columns that are sent as one, and of frame lines.
    """

    step: int
    reduce: int

    def rows(self, y_step: int) -> int:
        """Number of rows that are sent as one, of a field whose rows are so many frame lines apart."""
        return max(self.reduce // y_step, 1)


LADDER = (Detail(4, 1), Detail(8, 1), Detail(16, 1), Detail(8, 2), Detail(16, 2), Detail(16, 4))
"""From a good link to a bad one: 73, 54, 34, 21, 14 and 3 kB for a picture of the simulated liner."""


class Part(NamedTuple):
    """Part of a frame, in frame pixels.

    Attributes:
        x: First column.
        y: First frame line.
        columns: Number of columns.
        lines: Number of frame lines.
    """

    x: int
    y: int
    columns: int
    lines: int


class SentPicture(NamedTuple):
    """A picture as it is sent.

    Attributes:
        columns: Number of its columns.
        rows: Number of its rows.
        x0: First frame column of its first column.
        x_step: Frame columns of each of its columns.
        y0: Frame line of the middle of its first row.
        y_step: Frame lines from row to row.
        deflated: Its rows.
    """

    columns: int
    rows: int
    x0: int
    x_step: int
    y0: int
    y_step: int
    deflated: bytes


NO_PICTURE = SentPicture(0, 0, 0, 0, 0, 0, b"")


def grey_picture(field: Field, part: Part | None, detail: Detail) -> SentPicture:
    """A part of a field, or all of it, with this detail; no picture where the part lies outside."""
    cut, x0, y0 = _cut(field, part, detail)
    if not cut.size:
        return NO_PICTURE
    columns, rows = detail.reduce, detail.rows(field.y_step)
    luma = _levels(detail.step)[cut if columns == 1 else _reduced(cut, rows, columns)]
    y_step = rows * field.y_step
    middle = y0 + (rows - 1) * field.y_step // 2
    return SentPicture(luma.shape[1], luma.shape[0], x0, columns, middle, y_step, _deflated(luma))


def _deflated(luma: NDArray[np.uint8]) -> bytes:
    """The rows, each pixel as its difference from the one to its left, under zlib."""
    differences = luma.copy()
    differences[:, 1:] -= luma[:, :-1]
    # Runs and frequencies alone: a search for repetitions takes four times as long and gains a tenth.
    deflate = zlib.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS, 9, zlib.Z_RLE)
    return deflate.compress(differences.tobytes()) + deflate.flush()


def _cut(field: Field, part: Part | None, detail: Detail) -> tuple[NDArray[np.uint8], int, int]:
    """The part's pixels, in whole blocks, with its first column and the frame line of its first row."""
    columns, rows = detail.reduce, detail.rows(field.y_step)
    first, end, top, bottom = 0, field.columns, 0, field.rows
    if part is not None:
        first, end = max(part.x, 0), min(part.x + part.columns, field.columns)
        top = max((part.y - field.y0) // field.y_step, 0)
        bottom = min(-((field.y0 - part.y - part.lines) // field.y_step), field.rows)
    first, top = first - first % columns, top - top % rows
    wide, high = max(end - first, 0) // columns * columns, max(bottom - top, 0) // rows * rows
    return field.luma[top : top + high, first : first + wide], first, field.y0 + top * field.y_step


def _reduced(luma: NDArray[np.uint8], rows: int, columns: int) -> NDArray[np.uint8]:
    """The mean of each block of pixels; one that is clipped must not vanish among its neighbours."""
    pixels = [luma[row::rows, column::columns] for row in range(rows) for column in range(columns)]
    total = pixels[0].astype(np.uint16)
    brightest = pixels[0]
    for one in pixels[1:]:
        total += one
        brightest = np.maximum(brightest, one)
    mean = total // len(pixels)
    return np.where(brightest >= CLIPPED_LEVEL, WHITE, mean).astype(np.uint8)


@lru_cache(len(LADDER))
def _levels(step: int) -> NDArray[np.uint8]:
    """(256,) the grey value that each is sent as: the middle of its step."""
    grey = np.arange(256)
    middle = np.minimum(grey // step * step + step // 2, CLIPPED_LEVEL - 1)
    middle = np.maximum(middle, BLACK_LEVEL + 1)
    return np.where(grey >= CLIPPED_LEVEL, WHITE, np.where(grey <= BLACK_LEVEL, BLACK, middle)).astype(
        np.uint8
    )
