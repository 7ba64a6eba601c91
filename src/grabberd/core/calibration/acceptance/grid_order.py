"""Order of a calibration frame's targets: whether they lie as the file's own rows and columns say."""

from dataclasses import dataclass

import numpy as np

from grabberd.core.reconstruction import ObjectModel

_ROUNDS = 3
_MOST_PITCHES = 0.5


@dataclass(frozen=True, slots=True)
class GridOrder:
    """Targets, by their indices, that stand more than half a pitch from where row and column put them.

    Attributes:
        swapped: Pairs of which each stands where row and column put the other.
        astray: All others.
    """

    swapped: tuple[tuple[int, int], ...] = ()
    astray: tuple[int, ...] = ()


def grid_order(frame: ObjectModel) -> GridOrder:
    """Find the targets that are out of order.

    Positions follow row and column by an affine map that is fitted without those that contradict it. Nothing
    is said of a frame whose rows and columns follow no such map at all.
    """
    terms = np.column_stack([np.ones(len(frame)), frame.row, frame.column]).astype(float)
    places = frame.xyz_mm[:, :2]
    kept = np.ones(len(frame), np.bool_)
    for _ in range(_ROUNDS):
        map_mm, *_ = np.linalg.lstsq(terms[kept], places[kept], rcond=None)
        pitch = min(np.linalg.norm(map_mm[1]), np.linalg.norm(map_mm[2]))
        if pitch < 1e-9:
            return GridOrder()
        expected = terms @ map_mm
        pitches = np.linalg.norm(places - expected, axis=1) / pitch
        kept = pitches <= max(_MOST_PITCHES, float(np.median(pitches)))
    wrong = np.flatnonzero(pitches > _MOST_PITCHES)
    if 2 * len(wrong) >= len(frame):
        return GridOrder()
    between = np.linalg.norm(places[wrong, np.newaxis] - expected[wrong], axis=2) / pitch
    mutual = (between <= _MOST_PITCHES) & (between <= _MOST_PITCHES).T
    pairs = tuple((int(wrong[i]), int(wrong[j])) for i, j in zip(*np.nonzero(np.triu(mutual)), strict=True))
    paired = {one for pair in pairs for one in pair}
    return GridOrder(pairs, tuple(int(one) for one in wrong if one not in paired))
