"""Check that the targets of a calibration frame's file lie in the order of its own rows and columns."""

import numpy as np
from numpy.typing import NDArray

from grabberd.reconstruction import ObjectModel

_ROUNDS = 3
_MOST_PITCHES = 0.5


def out_of_order(frame: ObjectModel) -> NDArray[np.intp]:
    """Indices of targets that stand more than half a pitch from where their row and column put them.

    Positions follow row and column by an affine map that is fitted without those that contradict it. Nothing
    is said of a frame whose rows and columns follow no such map at all.
    """
    terms = np.column_stack([np.ones(len(frame)), frame.row, frame.column]).astype(float)
    places = frame.xyz_mm[:, :2]
    kept = np.ones(len(frame), np.bool_)
    pitches = np.zeros(len(frame))
    for _ in range(_ROUNDS):
        map_mm, *_ = np.linalg.lstsq(terms[kept], places[kept], rcond=None)
        pitch = min(np.linalg.norm(map_mm[1]), np.linalg.norm(map_mm[2]))
        if pitch < 1e-9:
            return np.empty(0, np.intp)
        pitches = np.linalg.norm(places - terms @ map_mm, axis=1) / pitch
        kept = pitches <= max(_MOST_PITCHES, float(np.median(pitches)))
    wrong = np.flatnonzero(pitches > _MOST_PITCHES)
    return wrong if 2 * len(wrong) < len(frame) else np.empty(0, np.intp)
