"""The bits of blobs, ready to be compared with what targets of their size would show."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.measurement.locale_sizes import (
    NOMINAL_FRACTION,
    Sizes,
    is_delivered,
    moments_of,
    sizes_of,
    threshold_fraction,
)
from grabberd.measurement.locale_table import STEPS_X, STEPS_Y
from grabberd.measurement.locator import Seen
from grabberd.measurement.windows import first_row

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


HALF = STEPS_X / 2
ROUNDED_PX = (0.5, 0.25)
"""Half axes are rounded to these, so that few tables are needed; blobs are stretched to that."""


class Kind(NamedTuple):
    """What blobs have to share in order to share a table.

    Attributes:
        half_width_px: half axes of what lies above the threshold; `half_height_px`: likewise.
    """

    half_width_px: float
    half_height_px: float


class Cuts(NamedTuple):
    """The R rows of M blobs, blob by blob, in steps of the fine grid from the place in the blob's middle.

    Attributes:
        first: (M,) int64, where each blob's rows begin; they follow each other without a gap.
        interpolated: (R,) int64, 1 where the row is an interpolated one.
        row: (R,) int64; `start`: (R,) of the first pixel, `end`: (R,) of the one after the last.
        phase: (M,) int64, to any pixel.
    """

    first: Whole
    interpolated: Whole
    row: Whole
    start: Whole
    end: Whole
    phase: Whole

    def repeated(self, blobs: int, times: int) -> "Cuts":
        """Those of so many blobs from the first, several times over."""
        rows = int(self.first[blobs]) if blobs < len(self.first) else len(self.row)
        begin = np.repeat(np.arange(times) * rows, blobs)
        interpolated, row, start, end = (np.tile(values[:rows], times) for values in self[1:5])
        first, phase = (np.tile(values[:blobs], times) for values in (self.first, self.phase))
        return Cuts(begin + first, interpolated, row, start, end, phase)


class Patterns(NamedTuple):
    """All blobs of a field that may be targets, those of a kind together.

    Attributes:
        blob: (M,) int64, their components.
        middle: (M, 2) float64, columns and rows: the place of the fine grid next to each centroid.
        stretched: (M, 2) float64, by how much in x and y.
        kinds: theirs, the most frequent one first; `blobs`: how many are of each.
        cuts: their rows.
        fraction: the threshold's share of the contrast.
    """

    blob: Whole
    middle: Array
    stretched: Array
    kinds: list[Kind]
    blobs: list[int]
    cuts: Cuts
    fraction: float


def patterns_of(seen: Seen, centres: Array) -> Patterns:
    """The patterns of all blobs of a field that lie in it as a whole and are of a target's size.

    Args:
        seen: a field of 1 bit.
        centres: (N, 2) float64, the centroids of its N components, columns and rows.
    """
    packed = seen.packed
    whole = seen.of_size & ~seen.shapes.touch_border(packed.rows, packed.columns)
    moments = moments_of(packed, seen.runs, seen.label, centres)
    sizes = sizes_of(moments, whole, centres, packed)
    fraction = NOMINAL_FRACTION
    if packed.y_step == 1:
        fraction = threshold_fraction(seen.shapes.pixels, moments, sizes, whole, seen.settings.spread_px)
    blob, kinds, count = _by_kind(np.flatnonzero(whole), sizes)
    steps = np.array([STEPS_X, STEPS_Y * packed.y_step])
    before = np.array([0, first_row(packed)])
    middle = np.rint((centres[blob] - before) * steps).astype(np.int64)
    wanted = np.repeat(kinds, count, axis=0).reshape(-1, 2)
    stretched = wanted / np.stack(sizes[:2], axis=1)[blob]
    cuts = _cuts(seen, blob, middle, stretched, sizes.lean[blob])
    return Patterns(blob, middle / steps + before, stretched, kinds, count, cuts, fraction)


def _by_kind(blob: Whole, sizes: Sizes) -> tuple[Whole, list[Kind], list[int]]:
    """The blobs with those of a kind together, the kinds, and how many blobs each has."""
    steps = np.rint(np.stack(sizes[:2], axis=1)[blob] / ROUNDED_PX)
    _, some, kind, count = np.unique(
        steps @ (1e3, 1.0), return_index=True, return_inverse=True, return_counts=True
    )
    by_count = np.argsort(-count, kind="stable")
    rank = np.empty_like(by_count)
    rank[by_count] = np.arange(len(by_count))
    kinds = [Kind(*values) for values in (steps[some[by_count]] * ROUNDED_PX).tolist()]
    return blob[np.argsort(rank[kind], kind="stable")], kinds, count[by_count].tolist()


def _cuts(seen: Seen, blob: Whole, middle: Whole, stretched: Array, lean: Array) -> Cuts:
    """Of the blobs wanted, from the middle of each, (M, 2) steps of x and y; stretched and set upright."""
    number = np.full(len(seen.shapes), len(blob))
    number[blob] = np.arange(len(blob))
    of_run = number[seen.label]
    run = np.argsort(of_run, kind="stable")[: np.count_nonzero(of_run < len(blob))]
    of, row, last = of_run[run], seen.runs.row[run], seen.runs.last[run]
    # What is empty between two runs of a row is taken for set: no target has such rows.
    new = np.flatnonzero((np.diff(of, prepend=-1) != 0) | (np.diff(row, prepend=-1) != 0))
    before, after = seen.runs.first[run][new], last[np.append(new[1:] - 1, -1)[: len(new)]] + 1
    of, row = of[new], row[new]
    (x, y), (wider, higher) = middle[of].T, stretched[of].T
    down = (row - first_row(seen.packed)) * (seen.packed.y_step * STEPS_Y) - y
    origin = x + HALF + lean[of] * down * (STEPS_X / STEPS_Y)
    # A pixel's own place is a whole number; what is stretched is its edge, half a pixel before.
    start, end = (
        np.rint((edge * STEPS_X - origin) * wider + HALF).astype(np.int64) for edge in (before, after)
    )
    return Cuts(
        first=np.searchsorted(of, np.arange(len(blob))),
        interpolated=(~is_delivered(seen.packed, row)).astype(np.int64),
        row=np.rint(down * higher).astype(np.int64),
        start=start,
        end=end,
        phase=-middle[:, 0],
    )
