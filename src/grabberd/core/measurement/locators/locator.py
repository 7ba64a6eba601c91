"""Input and output of locators: components of a field, the windows of grey values around them, positions,
chords.

Windows are all of the same size, from the delivered lines: a doubled field has the same as the intact one,
because interpolated rows add no information.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Mask
from grabberd.core.field import BIT_DEPTHS, PackedField
from grabberd.core.measurement.labelling import Runs, Shapes, binary_centres, greys_at
from grabberd.core.measurement.noise import background_in
from grabberd.core.measurement.settings import LocationSettings
from grabberd.errors import InputError

GREY = tuple(bits for bits in BIT_DEPTHS if bits > 1)
"""Bit depths of the locators that need grey values."""
ALL_BUT_THE_TALLEST = 0.95
"""Share of blobs whose chords all fit when they are trimmed: one tall blob would make every array tall."""
TALLEST = 2.0
"""Height of a blob, in largest diameters, beyond which it is no target."""


@dataclass(frozen=True, eq=False)
class Seen:
    """The N connected components of one field, before location.

    Attributes:
        packed: The field.
        runs: R runs of pixels above the threshold, ordered by component, row and column.
        label: (R,) int64, component of every run.
        shapes: Size and extent of every component, in the field's own columns and rows.
        settings: Settings of target location.
    """

    packed: PackedField
    runs: Runs
    label: NDArray[np.int64]
    shapes: Shapes
    settings: LocationSettings

    @cached_property
    def area_px(self) -> NDArray[np.float64]:
        """(N,) float64, size above the threshold in square frame pixels."""
        return self.shapes.pixels.astype(np.float64) * self.packed.y_step

    @cached_property
    def centroids(self) -> NDArray[np.float64]:
        """(N, 2) float64 column and row of each centre, with pixels above the threshold weighted equally."""
        return binary_centres(self.runs, self.label, len(self.shapes))

    @cached_property
    def of_size(self) -> Mask:
        """(N,) bool, True for components neither too small nor too large for a target."""
        diameter = np.sqrt(4 / np.pi * self.area_px)
        least_px, most_px = self.settings.limits_px
        return (diameter >= least_px) & (diameter <= most_px)

    @cached_property
    def whole(self) -> Mask:
        """(N,) bool, True for those that are low and not cut off by the field's edge."""
        return self.low & ~self.shapes.touch_border(self.packed.rows, self.packed.columns)

    @cached_property
    def low(self) -> Mask:
        """(N,) bool, True for those that are not too tall either: tall ones are costly and no targets."""
        height_px = (self.shapes.last_row - self.shapes.first_row + 1) * self.packed.y_step
        return self.of_size & (height_px <= TALLEST * self.settings.limits_px[1])


class Chords(NamedTuple):
    """Chords of N blobs on at most h delivered lines each, from which the shifts of whole lines can be found.

    Attributes:
        blob: (N,) int64, the component of each.
        line: (N,) int64, field line of its first chord, whatever the packed field's rows are.
        centre: (N, h) float64, middle of each chord, columns.
        weight: (N, h) float64, 1/σ² of that in px⁻²; 0 where there is no chord.
        share: (N, h) float64, derivative of the located x by the shift of that line, which need not have a
            chord.
    """

    blob: NDArray[np.int64]
    line: NDArray[np.int64]
    centre: NDArray[np.float64]
    weight: NDArray[np.float64]
    share: NDArray[np.float64]

    def trimmed(self, wanted: Mask) -> "Chords":
        """Keep as few lines as hold the wanted ones, (N, h) bool; only the tallest blobs lose some of
        theirs.
        """
        if not wanted.any():
            return self
        first, height = wanted.argmax(axis=1), wanted.shape[1]
        tall = np.sort(height - wanted[:, ::-1].argmax(axis=1) - first)
        count = int(tall[int(ALL_BUT_THE_TALLEST * (len(tall) - 1))])
        first = np.minimum(first, height - count)
        kept = first[:, np.newaxis] + np.arange(count)
        centre, weight, share = (
            np.take_along_axis(one, kept, axis=1) for one in (self.centre, self.weight, self.share)
        )
        return Chords(self.blob, self.line + first, centre, weight, share)


class Located(NamedTuple):
    """Positions of the N components of a field.

    Attributes:
        centres: (N, 2) float64, in the field's own columns and rows.
        sigma_px: (N, 2) float64, x and y, frame pixels.
        chords: Chords for estimating the shifts of lines, from locators that have them.
        discs: (N,) bool, components that a locator of 1 bit takes for targets; None if all whole ones are.
    """

    centres: NDArray[np.float64]
    sigma_px: NDArray[np.float64]
    chords: Chords | None = None
    discs: Mask | None = None


Locator = Callable[[Seen], Located]


def meant_for(seen: Seen, method: str, bits: tuple[int, ...]) -> None:
    """Refuse a field whose bit depth a method does not support.

    Raises:
        InputError: The bit depth is not supported; the message lists those that are.
    """
    if seen.packed.bits not in bits:
        meant = ", ".join(str(one) for one in bits)
        raise InputError(
            f"method {method!r} needs fields of {meant} bits, not of {seen.packed.bits}",
            "use method 'automatic', which suits every bit depth",
        )


def noise_of(seen: Seen) -> float:
    """Standard deviation of a pixel in grey values: as set, or as the background shows it."""
    known = seen.settings.noise_levels
    return background_in(seen.packed).noise if known is None else known


BEYOND_PX = (1.2, 3.9)
"""Margin of a window beyond the pixels above the threshold (of all but the largest blobs), and its increase
for a threshold at their full height, since a high threshold leaves more of them out."""
LARGEST_SHARE = 0.5
ALL_BUT_THE_LARGEST = 0.9
MOST_SPOTS = 4096
"""Components beyond which a field shows noise, and nothing to keep apart."""
_FAR = 1 << 30

Array = NDArray[np.float32]


class Windows(NamedTuple):
    """Windows of N blobs, each of `h` field lines by `w` columns inside the field.

    Attributes:
        blob: (N,) int64, component of each window.
        grey: (N, h, w) float32, grey values.
        background: (N,) float32, median of each window: more than half of it is no target.
        line: (N,) int64, field line of the first row, counted as the camera delivered them.
        column: (N,) int64, the first column.
        middle: (N, 2) float32, position of the blob's centroid in the window: columns, frame lines.
        lines_apart: Frame lines from one line to the next.
    """

    blob: NDArray[np.int64]
    grey: Array
    background: Array
    line: NDArray[np.int64]
    column: NDArray[np.int64]
    middle: Array
    lines_apart: int

    @property
    def x_px(self) -> Array:
        """(w,) columns from the first."""
        return np.arange(self.grey.shape[2], dtype=np.float32)

    @property
    def y_px(self) -> Array:
        """(h,) frame lines from the first."""
        return np.arange(self.grey.shape[1], dtype=np.float32) * np.float32(self.lines_apart)

    def located(
        self,
        seen: Seen,
        x_px: NDArray[np.floating],
        y_px: NDArray[np.floating],
        sigma_px: NDArray[np.floating],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Convert positions (N,) and σ (N, 2) in the windows to centres and σ of all components.

        A component without a window, too small or too large for a target, keeps its centroid with σ NaN.
        """
        centres, sigma = seen.centroids.copy(), np.full((len(seen.shapes), 2), np.nan)
        line = self.line + y_px.astype(np.float64) / self.lines_apart
        centres[self.blob, 0] = self.column + x_px.astype(np.float64)
        centres[self.blob, 1] = row_of_line(seen.packed, line)
        sigma[self.blob] = sigma_px
        return centres, sigma


def windows_of(seen: Seen) -> Windows:
    """Cut windows around the components of a target's size; off-centre at an edge of the field."""
    blob = np.flatnonzero(seen.of_size)
    shapes, packed, apart = seen.shapes, seen.packed, seen.packed.lines_apart
    # Noise moves a centroid less than the middle of an extent.
    x, row = seen.centroids[blob].T
    beyond = _beyond_px(packed, x, row)
    columns = _size(shapes.last_column[blob] - shapes.first_column[blob] + 1, beyond, 1, packed.columns)
    extent = (shapes.last_row[blob] - shapes.first_row[blob] + 1) * packed.y_step
    lines = _size(extent, beyond, apart, lines_of(packed))
    y = line_of_row(packed, row)
    column, line = _first(x, columns, packed.columns), _first(y, lines, lines_of(packed))
    middle = np.stack([x - column, apart * (y - line)], axis=1).astype(np.float32)
    grey = _gathered(packed, line, lines, column, columns)
    half = lines * columns // 2
    background = np.partition(grey.reshape(len(grey), lines * columns), half, axis=1)[:, half]
    rows = (line[:, np.newaxis] + np.arange(lines)) * (apart // packed.y_step) + packed.first_delivered
    is_own = _own_pixels(seen, rows, column[:, np.newaxis] + np.arange(columns), blob)
    # The light of another blob would draw the disc there.
    grey = np.where(is_own, grey, background[:, np.newaxis, np.newaxis])
    return Windows(blob, grey, background, line, column, middle, apart)


def _own_pixels(
    seen: Seen, rows: NDArray[np.int64], columns: NDArray[np.int64], blob: NDArray[np.int64]
) -> Mask:
    """(N, h, w) True for pixels of windows, given by rows (N, h) and columns (N, w), that no other component
    is nearer to.
    """
    packed = seen.packed
    low, high = _shared(seen, rows.shape[1] * packed.lines_apart // packed.y_step, columns.shape[1])
    across, down = (
        (place >= low[axis, blob, np.newaxis]) & (place <= high[axis, blob, np.newaxis])
        for axis, place in enumerate((columns, rows))
    )
    return down[:, :, np.newaxis] & across[:, np.newaxis]


def _shared(seen: Seen, rows: int, columns: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(2, C) first and last column, and row, of the pixels that belong to each component.

    Two of them share the pixels between them by the middle of the wider gap: that between columns, or rows.
    """
    shapes = seen.shapes
    count = len(shapes) if len(shapes) <= MOST_SPOTS else 0
    first = np.stack([shapes.first_column, shapes.first_row])
    last = np.stack([shapes.last_column, shapes.last_row])
    low, high = np.full(first.shape, -1), np.full(first.shape, _FAR)
    step, reach = np.array([[1], [seen.packed.y_step]]), np.array([[columns], [rows]])
    for ahead in range(1, count):
        one, other = slice(None, -ahead), slice(ahead, None)
        if not (first[1, other] <= last[1, one] + reach[1]).any():
            break
        behind, before = first[:, other] - last[:, one], first[:, one] - last[:, other]
        gap = step * np.maximum(behind, before)
        is_near = ((behind <= reach) & (before <= reach)).all(axis=0) & (gap > 0).any(axis=0)
        by = is_near & np.stack([gap[0] >= gap[1], gap[0] < gap[1]])
        for gap_there, this, that in ((behind, one, other), (before, other, one)):
            at = by & (gap_there > 0)
            high[:, this][at] = np.minimum(high[:, this], (last[:, this] + first[:, that]) // 2)[at]
            low[:, that][at] = np.maximum(low[:, that], (last[:, this] + first[:, that] + 1) // 2)[at]
    return low, high


def lines_of(packed: PackedField) -> int:
    """Number of lines that the camera delivered."""
    return packed.rows * packed.y_step // packed.lines_apart


def _beyond_px(packed: PackedField, x: NDArray[np.float64], row: NDArray[np.float64]) -> float:
    """Margin of windows beyond the pixels above the threshold."""
    if not len(x):
        return BEYOND_PX[0]
    stride = packed.data.shape[2] * (1 if packed.bits == 8 else 8)
    pixel = row.astype(np.int64) * stride + x.astype(np.int64)
    background = background_in(packed).level
    height = max(float(np.median(greys_at(packed, pixel))) - background, 1.0)
    share = (packed.threshold - background) / height
    return BEYOND_PX[0] + BEYOND_PX[1] * min(max(share, 0.0), LARGEST_SHARE)


def _size(extent: NDArray[np.int64], beyond_px: float, step: int, most: int) -> int:
    """Size of a window in steps: odd, unless the field is smaller."""
    large = int(ALL_BUT_THE_LARGEST * len(extent))
    reach = float(np.partition(extent, large)[large]) / 2 + beyond_px if len(extent) else 1.0
    return min(2 * math.ceil(reach / step - 0.01) + 1, most)


def _first(middle: NDArray[np.float64], size: int, end: int) -> NDArray[np.int64]:
    return (np.rint(middle).astype(np.int64) - size // 2).clip(0, end - size)


def _gathered(
    packed: PackedField, line: NDArray[np.int64], lines: int, column: NDArray[np.int64], columns: int
) -> Array:
    stride = packed.data.shape[2] * (1 if packed.bits == 8 else 8)
    rows_apart = packed.lines_apart // packed.y_step
    first = (line * rows_apart + packed.first_delivered) * stride + column
    within = np.arange(lines)[:, np.newaxis] * (rows_apart * stride) + np.arange(columns)
    pixel = first[:, np.newaxis, np.newaxis] + within
    return greys_at(packed, pixel.ravel()).reshape(pixel.shape).astype(np.float32)


def line_of_row(packed: PackedField, row: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert a row of the field to a delivered line, fractions included."""
    return (row - packed.first_delivered) * packed.y_step / packed.lines_apart


def row_of_line(packed: PackedField, line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert a delivered line to a row of the field."""
    return line * packed.lines_apart / packed.y_step + packed.first_delivered
