"""The bits of blobs, ready to be compared with what targets of their size would show."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.measurement.locale_sizes import (
    NOMINAL_FRACTION,
    STEPS,
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


class Alike(NamedTuple):
    """M blobs of a kind, all of which may be targets.

    Attributes:
        kind: theirs; `window`: of pixels about their anchors.
        ends: (M, `Window.size`) float32, 1 where a run has ended, −1 where it begins.
    """

    kind: Kind
    window: Window
    ends: NDArray[np.float32]


class Patterns(NamedTuple):
    """All blobs of a field that may be targets, those of a kind together.

    Attributes:
        blob: (M,) int64, their components.
        anchor: (M, 2) int64 column and row nearest to each centroid.
        fits: (M,) bool, whether it lies within its kind's window; the ends of others mean nothing.
        alike: the kinds, in the same order, M blobs in all.
        fraction: the threshold's share of the contrast.
    """

    blob: Whole
    anchor: Whole
    fits: NDArray[np.bool_]
    alike: tuple[Alike, ...]
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
    anchor = np.rint(centres).astype(np.int64)
    blob, kinds, count = _by_kind(whole, sizes, ~is_delivered(packed, anchor[:, 1]))
    windows = [Window.of(kind.half_width_px, kind.half_height_px, packed.y_step) for kind in kinds]
    ends, fits = _ends(seen, anchor, blob, np.repeat(np.array(windows, np.int64).reshape(-1, 2), count, axis=0))
    shapes = zip(kinds, windows, count, strict=True)
    alike, first = [], 0
    for kind, window, many in shapes:
        last = first + many * window.size
        alike.append(Alike(kind, window, ends[first:last].reshape(many, window.size)))
        first = last
    return Patterns(blob, anchor[blob], fits, tuple(alike), fraction)


def _by_kind(
    whole: NDArray[np.bool_], sizes: Sizes, odd: NDArray[np.bool_]
) -> tuple[Whole, list[Kind], Whole]:
    """The blobs with those of a kind together, the kinds, and how many blobs each has."""
    blob = np.flatnonzero(whole)
    columns = (sizes.half_width[blob], sizes.half_height[blob], sizes.lean[blob], odd[blob].astype(np.int64))
    order = np.lexsort(columns)
    values = np.stack(columns, axis=1)[order]
    new = np.ones(len(blob), np.bool_)
    new[1:] = (values[1:] != values[:-1]).any(axis=1)
    begin = np.flatnonzero(new)
    kinds = [
        Kind(width * STEPS[0], height * STEPS[1], lean * STEPS[2], bool(interpolated))
        for width, height, lean, interpolated in values[begin].tolist()
    ]
    return blob[order], kinds, np.diff(np.append(begin, len(blob)))


def _ends(
    seen: Seen, anchor: Whole, blob: Whole, windows: Whole
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The ends in all windows, one after the other; and which blobs lie within theirs.

    Args:
        seen: the field.
        anchor: (N, 2) of all components.
        blob: (M,) those wanted.
        windows: (M, 2) columns and rows of their windows.
    """
    number = np.full(len(anchor), -1)
    number[blob] = np.arange(len(blob))
    run = np.flatnonzero(number[seen.label] >= 0)
    label = seen.label[run]
    of = number[label]
    columns, rows = windows[of].T
    start, end = seen.runs.first[run] - anchor[label, 0], seen.runs.last[run] + 1 - anchor[label, 0]
    row = seen.runs.row[run] - anchor[label, 1]
    inside = (start >= -columns) & (end <= columns + 1) & (np.abs(row) <= rows)
    size = (2 * windows[:, 1] + 1) * (2 * windows[:, 0] + 2)
    begin = np.cumsum(size) - size
    middle = begin[of] + (row + rows) * (2 * columns + 2) + columns
    ends = np.zeros(int(size.sum()), np.float32)
    ends[(middle + start)[inside]] = -1.0
    ends[(middle + end)[inside]] = 1.0
    fits = np.ones(len(blob), np.bool_)
    fits[of[~inside]] = False
    return ends, fits
