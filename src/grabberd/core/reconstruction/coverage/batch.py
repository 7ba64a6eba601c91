"""The fields of a run that are counted together."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.miss import Miss
from grabberd.core.reconstruction.points import Points
from grabberd.core.reconstruction.tracking.tracker import Track
from grabberd.core.reconstruction.view_blobs import ViewBlobs

Indices = NDArray[np.intp]
BothViews = tuple[ViewBlobs, ViewBlobs]
MOST_AT_ONCE = 25
"""Half a second."""


class FieldSeen(Protocol):
    """A field that has been measured; what is asked of few fields is made when it is asked for."""

    @property
    def misses(self) -> Indices | None:
        """(M,) `Miss` of each target; None if none was found."""

    @property
    def unconfirmed(self) -> Indices:
        """Indices of the targets found that are not reported."""

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of blobs of the left and right view."""

    @property
    def points(self) -> Points:
        """Points reported."""

    @property
    def track(self) -> Track:
        """Track after it."""

    @property
    def halves(self) -> BothViews:
        """Blobs of the left and right view."""


class TrackedField(NamedTuple):
    """A `FieldSeen` of which all is known."""

    track: Track
    points: Points
    halves: BothViews

    @property
    def misses(self) -> Indices | None:
        """See `FieldSeen`."""
        return None if self.track.sighting is None else self.track.sighting.misses

    @property
    def unconfirmed(self) -> Indices:
        """See `FieldSeen`."""
        sighting = self.track.sighting
        if sighting is None or len(self.points) == len(sighting):
            return np.empty(0, np.intp)
        return sighting.target[~np.isin(sighting.points.target, self.points.target)]

    @property
    def counts(self) -> tuple[int, int]:
        """See `FieldSeen`."""
        return len(self.halves[0]), len(self.halves[1])


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

    def add(self, field: FieldSeen) -> None:
        """Add a field."""
        at, self.length = self.length, self.length + 1
        misses = field.misses
        if misses is None:
            self.misses[at] = Miss.NOT_IDENTIFIED
            self.lost.append((at, *field.counts))
        else:
            self.misses[at] = misses
            self.misses[at, field.unconfirmed] = Miss.UNCONFIRMED

    def take(self) -> tuple[NDArray[np.int64], list[tuple[int, int, int]]]:
        """Take the misses (B, M) and the rows of lost fields, and make room."""
        taken = self.misses[: self.length], self.lost
        self.length, self.lost = 0, []
        return taken
