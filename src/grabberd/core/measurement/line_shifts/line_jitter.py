"""Effect of line jitter on located positions, and its correction."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.measurement.line_shifts.chords import Shares, binary_chords, binary_shares, grey_chords
from grabberd.core.measurement.line_shifts.line_shifts import LINES_APART, LineShifts, line_shifts, unsolved
from grabberd.core.measurement.locators.locator import Chords, Located, Seen, noise_of
from grabberd.core.measurement.locators.windows import line_of_row, lines_of

Array = NDArray[np.float64]


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
    """Solve for the shifts of the lines, or, if the settings forbid it, state their expected effect."""
    expected_px = seen.settings.line_jitter_px
    if expected_px == 0 or not seen.of_size.any():
        return Steadied(located.centres, np.full(len(seen.shapes), expected_px), LINES_APART, None)
    # At 1 bit solving gains a thirtieth of the error in space, with more bits a third.
    if not seen.settings.solves_line_shifts(seen.packed.bits):
        return _unsolved(seen, located)
    chords = _chords(seen) if located.chords is None else located.chords
    if not (chords.weight > 0).any():
        return Steadied(located.centres, np.full(len(seen.shapes), expected_px), LINES_APART, None)
    line = line_of_row(seen.packed, located.centres[chords.blob, 1])
    known = seen.settings.line_jitter_known
    size = lines_of(seen.packed), seen.packed.columns
    shifts = line_shifts(chords, line, size, expected_px, known=known)
    steady = _corrected(located.centres, chords.blob, shifts)
    return steady._replace(line_jitter_px=None) if known else steady


def _unsolved(seen: Seen, located: Located) -> Steadied:
    """The positions as located, with the expected effect of line jitter on each."""
    expected_px = seen.settings.line_jitter_px
    shares = _shares(seen) if located.chords is None else located.chords
    if not len(shares.blob):
        return Steadied(located.centres, np.full(len(seen.shapes), expected_px), LINES_APART, None)
    shifts = unsolved(shares.share, expected_px)
    return _corrected(located.centres, shares.blob, shifts)._replace(line_jitter_px=None)


def _corrected(centres: Array, blob: NDArray[np.int64], shifts: LineShifts) -> Steadied:
    steady, common = centres.copy(), np.full(len(centres), shifts.line_jitter_px)
    steady[blob, 0] -= shifts.x_px
    common[blob] = shifts.common_px
    return Steadied(steady, common, shifts.common_reach_px, shifts.line_jitter_px)


def _shares(seen: Seen) -> Shares | Chords:
    return binary_shares(seen) if seen.packed.bits == 1 else grey_chords(seen, noise_of(seen))


def _chords(seen: Seen) -> Chords:
    return binary_chords(seen) if seen.packed.bits == 1 else grey_chords(seen, noise_of(seen))
