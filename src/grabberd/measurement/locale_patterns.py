"""The bits of blobs, ready to be compared with what targets of their size would show."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.measurement.locale_sizes import (
    NOMINAL_FRACTION,
    STEP_PX,
    Sizes,
    is_delivered,
    moments_of,
    sizes_of,
    threshold_fraction,
)
from grabberd.measurement.locale_table import Window
from grabberd.measurement.locator import Seen

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


class Kind(NamedTuple):
    """What blobs have to share in order to share a table.

    Attributes:
        half_width_px: half axes of what lies above the threshold; `half_height_px`: likewise.
        lean: columns by which chords move from frame line to frame line.
        interpolated: whether the anchor's row is an interpolated one.
    """

    half_width_px: float
    half_height_px: float
    lean: float
    interpolated: bool


class Patterns(NamedTuple):
    """M blobs that may be targets, those of a kind together.

    Attributes:
        blob: (M,) int64, their components.
        anchor: (M, 2) int64 column and row nearest to each centroid.
        ends: (M, `Window.size`) float32, 1 where a run has ended, −1 where it begins.
        kinds: the K kinds; `first`: (K + 1,) int64, where each begins among the M.
        window: of pixels about the anchors.
        fraction: the threshold's share of the contrast.
    """

    blob: Whole
    anchor: Whole
    ends: NDArray[np.float32]
    kinds: tuple[Kind, ...]
    first: Whole
    window: Window
    fraction: float


def patterns_of(seen: Seen, centres: Array) -> Patterns:
    """The patterns of all blobs of a field that lie in it as a whole and are of a target's size.

    Args:
        seen: a field of 1 bit.
        centres: (N, 2) float64, the centroids of its N components, columns and rows.
    """
    packed, y_step = seen.packed, seen.packed.y_step
    whole = seen.of_size & ~seen.shapes.touch_border(packed.rows, packed.columns)
    moments = moments_of(packed, seen.runs, seen.label, centres)
    sizes = sizes_of(moments, whole, centres, packed)
    half_width, half_height = (STEP_PX * axis[whole].max(initial=1) for axis in sizes[:2])
    window = Window.of(half_width, half_height, y_step)
    anchor = np.rint(centres).astype(np.int64)
    place, fits = _places(seen, anchor, window)
    whole[seen.label[~fits]] = False
    odd = ~is_delivered(packed, anchor[:, 1])
    blob, kinds, first = _sorted_by_kind(np.flatnonzero(whole), sizes, odd)
    fraction = NOMINAL_FRACTION
    if y_step == 1:
        fraction = threshold_fraction(seen.shapes.pixels, moments, sizes, whole, seen.settings.spread_px)
    return Patterns(
        blob, anchor[blob], _ends(seen.label, blob, place, window), kinds, first, window, fraction
    )


class _Ends(NamedTuple):
    """Where R runs begin and end in the windows of their blobs: (R,) int64 each."""

    start: Whole
    end: Whole


def _places(seen: Seen, anchor: Whole, window: Window) -> tuple[_Ends, NDArray[np.bool_]]:
    """Where all runs lie in their windows, and whether they do."""
    column, row = anchor[seen.label].T
    start = seen.runs.first - column + window.columns
    end = seen.runs.last + 1 - column + window.columns
    in_row = seen.runs.row - row + window.rows
    fits = (start >= 0) & (end < window.ends) & (in_row >= 0) & (in_row <= 2 * window.rows)
    return _Ends(in_row * window.ends + start, in_row * window.ends + end), fits


def _sorted_by_kind(
    blob: Whole, sizes: Sizes, odd: NDArray[np.bool_]
) -> tuple[Whole, tuple[Kind, ...], Whole]:
    """The blobs with those of a kind together, the kinds, and where each begins."""
    columns = (sizes.half_width[blob], sizes.half_height[blob], sizes.lean[blob], odd[blob].astype(np.int64))
    order = np.lexsort(columns)
    values = np.stack(columns, axis=1)[order]
    new = np.flatnonzero((values[1:] != values[:-1]).any(axis=1)) + 1
    begin = np.concatenate([[0], new]) if len(blob) else new
    kinds = tuple(
        Kind(width * STEP_PX, height * STEP_PX, lean * STEP_PX, bool(interpolated))
        for width, height, lean, interpolated in values[begin].tolist()
    )
    return blob[order], kinds, np.append(begin, len(blob))


def _ends(label: Whole, blob: Whole, place: _Ends, window: Window) -> NDArray[np.float32]:
    number = np.full(int(label.max(initial=-1)) + 1, -1)
    number[blob] = np.arange(len(blob))
    of_run = number[label]
    kept = of_run >= 0
    ends = np.zeros((len(blob), window.size), np.float32)
    flat, offset = ends.reshape(-1), of_run[kept] * window.size
    flat[offset + place.start[kept]] = -1.0
    flat[offset + place.end[kept]] = 1.0
    return ends
