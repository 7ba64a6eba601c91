"""Line jitter: its effect on located positions, and its correction by the shifts of the lines.

With more than 1 bit, runs above the threshold are cut into chords of blobs on the delivered lines, from which
`line_shifts` solves for the shifts. At 1 bit `row_shifts` takes them away, and the effect to be expected
without that is stated, as it is if the settings forbid both (docs/decisions).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.measurement.labelling import run_greys
from grabberd.core.measurement.line_shifts import (
    LINES_APART,
    LineShifts,
    line_shifts,
    steady_centres,
    unsolved,
)
from grabberd.core.measurement.locators.locator import Chords, Located, Seen, line_of_row, lines_of, noise_of


def grey_chords(seen: Seen, noise: float) -> Chords:
    """Make chords with pixels weighted by g − T.

    Args:
        seen: The field and its components.
        noise: Standard deviation of a pixel, grey values.
    """
    grey, column, begin = run_greys(seen.packed, seen.runs)
    weight = (grey - seen.packed.threshold).astype(np.float64)
    total, moment = (np.add.reduceat(values, begin[: len(grey)]) for values in (weight, weight * column))
    length = (seen.runs.last - seen.runs.first + 1).astype(np.float64)
    return _chords(seen, _Cuts(total, moment / total, noise * length**1.5 / (12**0.5 * total)))


class Shares(NamedTuple):
    """Influence of each line's shift on the x of N blobs of at most h lines, all pixels weighted equally.

    Attributes:
        blob: (N,) int64, the component of each.
        share: (N, h) float64, as in `Chords`.
    """

    blob: NDArray[np.int64]
    share: Array


def binary_shares(seen: Seen) -> Shares:
    """Compute the shares of a field of 1 bit; empty if no blob has a chord."""
    low = seen.low
    runs, label = seen.runs, seen.label
    length, row = runs.last - runs.first + 1, runs.row
    if not low.all():
        chosen = low[label]
        label, length, row = (np.cumsum(low) - 1)[label[chosen]], length[chosen], row[chosen]
    half_lines = row * seen.packed.y_step - seen.packed.first_delivered
    grid = _Grid.of(label, half_lines, lines_of(seen.packed))
    if seen.packed.y_step == seen.packed.lines_apart:
        share = grid.sums(length)
    else:
        amount = grid.sums(length * (half_lines % 2 == 0))
        before = length * grid.part_before(amount)
        share = grid.sums(before) + grid.sums(length - before, after=True)
    return Shares(np.flatnonzero(low), share / share.sum(axis=1, keepdims=True))


class _Cuts(NamedTuple):
    """Each run's weight in its blob, its middle in columns, and the middle's σ; (R,) each."""

    amount: Array
    middle: Array
    sigma_px: Array


def _chords(seen: Seen, cuts: _Cuts) -> Chords:
    """Make chords of delivered rows; interpolated rows give their share to the lines beside them."""
    low = seen.low
    chosen = low[seen.label]
    cuts = _Cuts(*(values[chosen] for values in cuts))
    half_lines = seen.runs.row[chosen] * seen.packed.y_step - seen.packed.first_delivered
    grid = _Grid.of((np.cumsum(low) - 1)[seen.label[chosen]], half_lines, lines_of(seen.packed))
    delivered = half_lines % 2 == 0
    amount = grid.sums(cuts.amount * delivered)
    spread = grid.sums((cuts.amount * cuts.sigma_px * delivered) ** 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        centre = np.where(amount > 0, grid.sums(cuts.amount * cuts.middle * delivered) / amount, 0.0)
        weight = np.where(amount > 0, amount**2 / spread, 0.0)
    before = grid.part_before(amount)
    share = grid.sums(cuts.amount * before) + grid.sums(cuts.amount * (1.0 - before), after=True)
    return Chords(np.flatnonzero(low), grid.line, centre, weight, share / share.sum(axis=1, keepdims=True))


class _Grid(NamedTuple):
    """Position of R runs in an array of N blobs by h lines; a row between two lines belongs to both.

    Attributes:
        line: (N,) int64, each blob's first line.
        height: h.
        before: (R,) int64, flat index of the line at or before each run's row.
        after: (R,) int64, flat index of the line at or after it.
    """

    line: NDArray[np.int64]
    height: int
    before: NDArray[np.int64]
    after: NDArray[np.int64]

    @classmethod
    def of(cls, blob: NDArray[np.int64], half_lines: NDArray[np.int64], lines: int) -> "_Grid":
        count = int(blob.max(initial=-1)) + 1
        before, after = (np.minimum(np.maximum(half_lines + more >> 1, 0), lines - 1) for more in (0, 1))
        line = np.full(count, lines)
        np.minimum.at(line, blob, before)
        height = int((after - line[blob]).max(initial=0)) + 1
        return cls(line, height, *(blob * height + at - line[blob] for at in (before, after)))

    def part_before(self, amount: Array) -> Array:
        """(R,) share of a row that belongs to the line before it: all or nothing if only one is bright."""
        bright = amount.ravel() > 0
        return 0.5 + 0.5 * (bright[self.before].astype(np.float64) - bright[self.after])

    def sums(self, values: NDArray[np.floating] | NDArray[np.integer], *, after: bool = False) -> Array:
        """(N, h) sums of values (R,)."""
        shape = len(self.line), self.height
        at = self.after if after else self.before
        summed = np.asarray(np.bincount(at, values, shape[0] * shape[1]), np.float64)
        return summed.reshape(shape)


class Steadied(NamedTuple):
    """Components of a field with their lines' shifts removed, as far as those can be known.

    Attributes:
        centres: (N, 2) float64, in the field's own columns and rows.
        common_px: (N,) float64, standard deviation of the error in x shared by all on the same lines.
        common_reach_px: Distance over which that error is shared, frame lines.
        line_jitter_px: Standard deviation of a line's shift in this field; None if not estimated.
    """

    centres: Array
    common_px: Array
    common_reach_px: float
    line_jitter_px: float | None


def steadied(seen: Seen, located: Located) -> Steadied:
    """Take the shifts of the lines away, unless the settings forbid it, and state what is left of their
    effect.
    """
    expected_px = seen.settings.line_jitter_px
    nothing = Steadied(located.centres, np.full(len(seen.shapes), expected_px), LINES_APART, None)
    if expected_px == 0 or not seen.of_size.any():
        return nothing
    if seen.packed.bits == 1:
        shares, centres = binary_shares(seen), steady_centres(seen, located)
        return _unsolved(nothing, centres, shares)
    chords = grey_chords(seen, noise_of(seen)) if located.chords is None else located.chords
    if seen.settings.line_shifts is False:
        return _unsolved(nothing, located.centres, chords)
    if not (chords.weight > 0).any():
        return nothing
    line = line_of_row(seen.packed, located.centres[chords.blob, 1])
    known = seen.settings.line_jitter_known
    size = lines_of(seen.packed), seen.packed.columns
    shifts = line_shifts(chords, line, size, expected_px, known=known)
    steady = _corrected(nothing, located.centres, chords.blob, shifts)
    return steady if known else steady._replace(line_jitter_px=shifts.line_jitter_px)


def _unsolved(nothing: Steadied, centres: Array, shares: Shares | Chords) -> Steadied:
    """The positions as they are, with the expected effect of line jitter on each."""
    if not len(shares.blob):
        return nothing
    return _corrected(nothing, centres, shares.blob, unsolved(shares.share, float(nothing.common_px[0])))


def _corrected(nothing: Steadied, centres: Array, blob: NDArray[np.int64], shifts: LineShifts) -> Steadied:
    steady, common = centres.copy(), np.full(len(centres), shifts.line_jitter_px)
    steady[blob, 0] -= shifts.x_px
    common[blob] = shifts.common_px
    return Steadied(steady, common, shifts.common_reach_px, None)
