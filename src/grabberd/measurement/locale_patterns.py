"""The bits of blobs, ready to be compared with what targets of their size would show."""

from collections.abc import Iterator
from itertools import pairwise
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
        start: (R,) int32 places of the runs' beginnings in the window's ends; `end`: of their ends.
        first: (M + 1,) int64, where each blob's runs begin.
    """

    kind: Kind
    window: Window
    start: NDArray[np.int32]
    end: NDArray[np.int32]
    first: Whole

    def patterns(self) -> list[bytes]:
        """Of each blob, what tells its bits from other patterns of the kind."""
        both = np.stack([self.start, self.end], axis=1).tobytes()
        at = (8 * self.first).tolist()
        return [both[begin:end] for begin, end in pairwise(at)]


class Patterns(NamedTuple):
    """All blobs of a field that may be targets, those of a kind together.

    Attributes:
        blob: (M,) int64, their components.
        anchor: (M, 2) int64 column and row nearest to each centroid.
        fits: (M,) bool, whether it lies within its kind's window; the runs of others are cut short.
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
    of_blob = np.repeat(np.array(windows, np.int64).reshape(-1, 2), count, axis=0)
    placed = _placed(seen, anchor, blob, of_blob)
    alike = _parted(placed, kinds, windows, np.append(0, np.cumsum(count)).tolist())
    return Patterns(blob, anchor[blob], placed.fits, tuple(alike), fraction)


class _Placed(NamedTuple):
    """The runs of M blobs, blob by blob: `start`, `end` (R,), `first` (M + 1,) as in `Alike`; `fits` (M,)."""

    start: NDArray[np.int32]
    end: NDArray[np.int32]
    first: Whole
    fits: NDArray[np.bool_]


def _parted(placed: _Placed, kinds: list[Kind], windows: list[Window], bounds: list[int]) -> Iterator[Alike]:
    for kind, window, (begin, end) in zip(kinds, windows, pairwise(bounds), strict=True):
        first = placed.first[begin : end + 1]
        runs = slice(int(first[0]), int(first[-1]))
        yield Alike(kind, window, placed.start[runs], placed.end[runs], first - first[0])


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


def _placed(seen: Seen, anchor: Whole, blob: Whole, windows: Whole) -> _Placed:
    """Where the runs lie in the windows.

    Args:
        seen: the field.
        anchor: (N, 2) of all components.
        blob: (M,) those wanted.
        windows: (M, 2) columns and rows of their windows.
    """
    number = np.full(len(anchor), -1)
    number[blob] = np.arange(len(blob))
    run = np.argsort(number[seen.label], kind="stable")
    run = run[np.count_nonzero(number[seen.label] < 0) :]
    label = seen.label[run]
    of = number[label]
    columns, rows = windows[of].T
    start, end = seen.runs.first[run] - anchor[label, 0], seen.runs.last[run] + 1 - anchor[label, 0]
    row = seen.runs.row[run] - anchor[label, 1]
    inside = (start >= -columns) & (end <= columns + 1) & (np.abs(row) <= rows)
    fits = np.ones(len(blob), np.bool_)
    fits[of[~inside]] = False
    begin = (row.clip(-rows, rows) + rows) * (2 * columns + 2) + columns
    start, end = start.clip(-columns, columns + 1), end.clip(-columns, columns + 1)
    first = np.append(0, np.cumsum(np.bincount(of, minlength=len(blob))))
    return _Placed((begin + start).astype(np.int32), (begin + end).astype(np.int32), first, fits)
