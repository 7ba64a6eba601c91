"""What line jitter does to the located places, and what of it can be undone."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.measurement.chords import binary_chords, grey_chords
from grabberd.measurement.grey import noise_of
from grabberd.measurement.line_shifts import LineShifts, line_shifts, unsolved_px
from grabberd.measurement.locator import Chords, Located, Seen
from grabberd.measurement.windows import line_of_row, lines_of

Array = NDArray[np.float64]


class Steadied(NamedTuple):
    """The components of a field, as if its lines had not been shifted, as far as that can be known.

    Attributes:
        centres: (N, 2) float64, in the field's own columns and rows.
        common_px: (N,) float64, standard deviation of the error in x that all on the same lines share.
        line_jitter_px: standard deviation of a line's shift in this field; None where it was not estimated.
    """

    centres: Array
    common_px: Array
    line_jitter_px: float | None


def steadied(seen: Seen, located: Located) -> Steadied:
    """Solves for the shifts of the lines, or where the settings forbid it says how much they do."""
    expected_px = seen.settings.line_jitter_px
    common = np.full(len(seen.shapes), expected_px)
    if expected_px == 0 or not len(seen.shapes):
        return Steadied(located.centres, common, None)
    chords = _chords(seen) if located.chords is None else located.chords
    if not (seen.settings.line_shifts and len(chords.blob)):
        common[chords.blob] = unsolved_px(chords, expected_px)
        return Steadied(located.centres, common, None)
    return _solved(seen, located.centres, chords)


def _solved(seen: Seen, centres: Array, chords: Chords) -> Steadied:
    line = line_of_row(seen.packed, centres[chords.blob, 1])
    found: LineShifts = line_shifts(chords, line, lines_of(seen.packed), seen.settings.line_jitter_px)
    steady, common = centres.copy(), np.full(len(centres), found.line_jitter_px)
    steady[chords.blob, 0] -= found.x_px
    common[chords.blob] = found.common_px
    return Steadied(steady, common, found.line_jitter_px)


def _chords(seen: Seen) -> Chords:
    return binary_chords(seen) if seen.packed.bits == 1 else grey_chords(seen, noise_of(seen))
