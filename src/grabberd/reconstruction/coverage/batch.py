"""The fields of a run that are counted together."""

import numpy as np
from numpy.typing import NDArray

from grabberd.reconstruction.correspondence.agreement import Sighting
from grabberd.reconstruction.miss import Miss
from grabberd.reconstruction.points import Points
from grabberd.reconstruction.view_blobs import ViewBlobs

BothViews = tuple[ViewBlobs, ViewBlobs]
MOST_AT_ONCE = 25
"""Half a second."""


class Batch:
    """Room for the misses of up to `MOST_AT_ONCE` fields.

    Copies: the arrays of a field are parts of larger ones, and keeping those would cost a field more than
    counting it.

    Attributes:
        length: Number of fields in it.
        misses: (MOST_AT_ONCE, M) `Miss` of each target; `NOT_IDENTIFIED` in fields where none was.
        lost: Rows of those fields, with the numbers of blobs in their left and right view.
    """

    def __init__(self, count: int) -> None:
        self.length = 0
        self.misses = np.zeros((MOST_AT_ONCE, count), np.int64)
        self.lost: list[tuple[int, int, int]] = []

    def add(self, sighting: Sighting | None, points: Points, blobs: BothViews) -> None:
        """Add a field."""
        at, self.length = self.length, self.length + 1
        if sighting is None:
            self.misses[at] = Miss.NOT_IDENTIFIED
            self.lost.append((at, len(blobs[0]), len(blobs[1])))
            return
        assert sighting.misses is not None
        self.misses[at] = sighting.misses
        if len(points) < len(sighting):
            reported = np.isin(sighting.points.target, points.target)
            self.misses[at, sighting.target[~reported]] = Miss.UNCONFIRMED

    def take(self) -> tuple[NDArray[np.int64], list[tuple[int, int, int]]]:
        """Take the misses (B, M) and the rows of lost fields, and make room."""
        taken = self.misses[: self.length], self.lost
        self.length, self.lost = 0, []
        return taken
