"""The grey values around each blob, all of the same size, from the lines that the camera delivered.

A doubled field has the same windows as the intact one: interpolated rows know nothing of their own.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.field import PackedField
from grabberd.measurement.locator import Seen
from grabberd.measurement.mask import greys_at

LINES_APART = 2
"""Frame lines from one field line to the next, whatever a packed field's rows are."""
BEYOND_PX = 1.5
"""A window reaches so far beyond the pixels above the threshold of all but the largest blobs."""
ALL_BUT_THE_LARGEST = 0.9

Array = NDArray[np.float32]


class Windows(NamedTuple):
    """Windows of N blobs, each of `h` field lines and `w` columns.

    Attributes:
        blob: (N,) int64, the component that each window belongs to.
        grey: (N, h, w) float32, grey values; beyond the field's edge its last ones are repeated.
        inside: (N, h, w) float32, 1 where the field is, 0 beyond its edge.
        line: (N,) int64, the field line of the first row, counted as the camera delivered them.
        column: (N,) int64, the first column.
    """

    blob: NDArray[np.int64]
    grey: Array
    inside: Array
    line: NDArray[np.int64]
    column: NDArray[np.int64]

    @property
    def x_px(self) -> Array:
        """(w,) columns from the first."""
        return np.arange(self.grey.shape[2], dtype=np.float32)

    @property
    def y_px(self) -> Array:
        """(h,) frame lines from the first."""
        return np.arange(self.grey.shape[1], dtype=np.float32) * np.float32(LINES_APART)

    @property
    def background(self) -> Array:
        """(N,) the median of each window: more than half of it is no target."""
        median: Array = np.median(self.grey.reshape(len(self.grey), -1), axis=1)
        return median

    def located(
        self,
        seen: Seen,
        x_px: NDArray[np.floating],
        y_px: NDArray[np.floating],
        sigma_px: NDArray[np.floating],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centres and standard deviations of all components, from places (N,) and (N, 2) in the windows.

        A component without a window, which is too small or too large for a target, is placed in its middle,
        and how well is not known (NaN).
        """
        centres, sigma = middles(seen), np.full((len(seen.shapes), 2), np.nan)
        line = self.line + y_px.astype(np.float64) / LINES_APART
        centres[self.blob, 0] = self.column + x_px.astype(np.float64)
        centres[self.blob, 1] = row_of_line(seen.packed, line)
        sigma[self.blob] = sigma_px
        return centres, sigma


def windows_of(seen: Seen) -> Windows:
    """The windows around those components that have the size of a target."""
    blob = np.flatnonzero(seen.of_size)
    shapes, packed = seen.shapes, seen.packed
    centres = middles(seen)[blob]
    half_columns = _half(shapes.last_column[blob] - shapes.first_column[blob] + 1, 1)
    half_lines = _half((shapes.last_row[blob] - shapes.first_row[blob] + 1) * packed.y_step, LINES_APART)
    column = np.rint(centres[:, 0]).astype(np.int64) - half_columns
    line = np.rint(line_of_row(packed, centres[:, 1])).astype(np.int64) - half_lines
    columns = column[:, np.newaxis] + np.arange(2 * half_columns + 1)
    lines = line[:, np.newaxis] + np.arange(2 * half_lines + 1)
    return Windows(blob, *_gathered(packed, lines, columns), line, column)


def middles(seen: Seen) -> NDArray[np.float64]:
    """(components, 2) columns and rows of the middles of their extents."""
    shapes = seen.shapes
    column, row = shapes.first_column + shapes.last_column, shapes.first_row + shapes.last_row
    return np.stack([column, row], axis=1) / 2


def lines_of(packed: PackedField) -> int:
    """How many lines the camera delivered."""
    return packed.rows * packed.y_step // LINES_APART


def _half(extent: NDArray[np.int64], step: int) -> int:
    """Half a window's size in steps of so many pixels."""
    if not len(extent):
        return 1
    return math.ceil((float(np.quantile(extent, ALL_BUT_THE_LARGEST)) / 2 + BEYOND_PX) / step - 0.01)


def _gathered(
    packed: PackedField, lines: NDArray[np.int64], columns: NDArray[np.int64]
) -> tuple[Array, Array]:
    line, column = lines.clip(0, lines_of(packed) - 1), columns.clip(0, packed.columns - 1)
    stride = packed.data.shape[2] * (1 if packed.bits == 8 else 8)
    row = (line * (LINES_APART // packed.y_step) + first_row(packed)) * stride
    place = row[:, :, np.newaxis] + column[:, np.newaxis, :]
    grey = greys_at(packed, place.ravel()).reshape(place.shape).astype(np.float32)
    inside = (line == lines)[:, :, np.newaxis] & (column == columns)[:, np.newaxis, :]
    return grey, inside.astype(np.float32)


def first_row(packed: PackedField) -> int:
    """The row of the first line that the camera delivered."""
    return packed.parity if packed.y_step == 1 else 0


def line_of_row(packed: PackedField, row: NDArray[np.float64]) -> NDArray[np.float64]:
    return (row - first_row(packed)) * packed.y_step / LINES_APART


def row_of_line(packed: PackedField, line: NDArray[np.float64]) -> NDArray[np.float64]:
    return line * LINES_APART / packed.y_step + first_row(packed)
