"""Bit patterns of blobs, prepared for comparison with targets of their size."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.measurement.labelling.labels import short
from grabberd.core.measurement.locale.locale_sizes import (
    NOMINAL_FRACTION,
    Sizes,
    is_delivered,
    moments_of,
    sizes_of,
    threshold_fraction,
)
from grabberd.core.measurement.locale.locale_table import STEPS_X, STEPS_Y
from grabberd.core.measurement.locators.locator import Seen

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


HALF = STEPS_X / 2
ROUNDED_PX = (0.5, 0.25)
"""Steps to which half axes are rounded, so that few tables are needed; blobs are stretched to match."""


Kind = tuple[float, float]
"""Half axes of the region above the threshold, in x and y: what blobs that use the same table share."""


class Cuts(NamedTuple):
    """The R rows of M blobs, blob by blob, in steps of the fine grid from the blob's middle position.

    Attributes:
        first: (M,) int64, start index of each blob's rows, which are contiguous.
        interpolated: (R,) int64, 1 for an interpolated row.
        row: (R,) int64, the row.
        start: (R,) int64, its first pixel.
        end: (R,) int64, the pixel after its last.
        phase: (M,) int64, distance to any pixel.
    """

    first: Whole
    interpolated: Whole
    row: Whole
    start: Whole
    end: Whole
    phase: Whole


class Patterns(NamedTuple):
    """All blobs of a field that may be targets, grouped by kind.

    Attributes:
        blob: (M,) int64, their components.
        middle: (M, 2) float64, columns and rows: the fine-grid position nearest to each centroid.
        stretched: (M, 2) float64, stretch in x and y.
        kinds: Their kinds, the most frequent first.
        blobs: Number of blobs of each kind.
        cuts: Their rows.
        fraction: The threshold's share of the contrast.
    """

    blob: Whole
    middle: Array
    stretched: Array
    kinds: list[Kind]
    blobs: list[int]
    cuts: Cuts
    fraction: float


def patterns_of(seen: Seen, centres: Array) -> Patterns:
    """Prepare the patterns of all blobs that lie wholly inside the field and have a target's size.

    Args:
        seen: A field of 1 bit.
        centres: (N, 2) float64, centroids of its N components, columns and rows.
    """
    packed = seen.packed
    whole = seen.low & ~seen.shapes.touch_border(packed.rows, packed.columns)
    moments = moments_of(packed, seen.runs, seen.label, centres)
    sizes = sizes_of(moments, whole, centres, packed)
    fraction = NOMINAL_FRACTION
    if packed.is_doubled:
        fraction = threshold_fraction(seen.shapes.pixels, moments, sizes, whole, seen.settings.spread_px)
    blob, kinds, count = _by_kind(whole.nonzero()[0], sizes)
    steps = np.array([STEPS_X, STEPS_Y * packed.y_step])
    before = np.array([0, packed.first_delivered])
    middle = np.rint((centres[blob] - before) * steps).astype(np.int64)
    wanted = np.repeat(kinds, count, axis=0).reshape(-1, 2)
    stretched = wanted / np.array(sizes[:2]).T[blob]
    cuts = _cuts(seen, blob, middle, stretched, sizes.lean[blob])
    return Patterns(blob, middle / steps + before, stretched, kinds, count, cuts, fraction)


def _by_kind(blob: Whole, sizes: Sizes) -> tuple[Whole, list[Kind], list[int]]:
    """Group blobs by kind: the blobs, the kinds, and the number of blobs of each."""
    width, height = (
        np.rint(axis[blob] / rounded_px).astype(np.int64)
        for axis, rounded_px in zip(sizes[:2], ROUNDED_PX, strict=True)
    )
    heights = int(height.max(initial=0)) + 1
    code = width * heights + height
    count = np.bincount(code)
    by_count = np.argsort(-count, kind="stable")[: np.count_nonzero(count)]
    rank = np.empty(len(count), np.int64)
    rank[by_count] = np.arange(len(by_count))
    wide, high = np.divmod(by_count, heights)
    kinds = list(zip((ROUNDED_PX[0] * wide).tolist(), (ROUNDED_PX[1] * high).tolist(), strict=True))
    order = short(rank[code], len(by_count)).argsort(kind="stable")
    return blob[order], kinds, count[by_count].tolist()


def _cuts(seen: Seen, blob: Whole, middle: Whole, stretched: Array, lean: Array) -> Cuts:
    """Cut the wanted blobs into rows relative to their `middle` (M, 2) steps; stretched and made upright."""
    number = np.full(len(seen.shapes), len(blob))
    number[blob] = np.arange(len(blob))
    of_run = number[seen.label]
    run = short(of_run, len(blob) + 1).argsort(kind="stable")[: np.count_nonzero(of_run < len(blob))]
    of, row, first, last = of_run[run], seen.runs.row[run], seen.runs.first[run], seen.runs.last[run]
    # A gap between two runs of a row is taken as set: no target has such rows.
    same = (of[1:] == of[:-1]) & (row[1:] == row[:-1])
    if same.any():
        new = np.flatnonzero(np.append(True, ~same))
        of, row, first, last = of[new], row[new], first[new], last[np.append(new[1:] - 1, -1)]
    begin = np.cumsum(np.bincount(of, minlength=len(blob)))
    x, y, wider, higher, leaning = np.array([*middle.T, *stretched.T, lean])[:, of]
    down = (row - seen.packed.first_delivered) * (seen.packed.y_step * STEPS_Y) - y
    origin = x + HALF + leaning * down * (STEPS_X / STEPS_Y)
    # A pixel's position is a whole number; what is stretched is its edge, half a pixel before.
    start, end = (
        np.rint((edge * STEPS_X - origin) * wider + HALF).astype(np.int64) for edge in (first, last + 1)
    )
    return Cuts(
        first=np.append(0, begin[:-1])[: len(blob)],
        interpolated=1 - is_delivered(seen.packed, row).astype(np.int64),
        row=np.rint(down * higher).astype(np.int64),
        start=start,
        end=end,
        phase=-middle[:, 0],
    )
