"""A field's way through the engine: the kernel's arrays for it, and the objects that are made of them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.measurement import Blobs
from grabberd.core.measurement.compiled.binary_location import COLUMNS, blobs_of
from grabberd.core.reconstruction import Points, Track, ViewBlobs
from grabberd.core.reconstruction.correspondence.agreement import Sighting
from grabberd.core.reconstruction.correspondence.displacement_field import Expected

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Head(NamedTuple):
    """Outcome of a field (engine.h)."""

    status: float
    blobs: float
    common_reach_px: float
    jitter_px: float
    left: float
    right: float
    found: float
    believed: float
    wide: float
    high: float
    fraction: float
    noise: float
    surprise: float


HEAD = len(Head._fields)
HALF_COLUMNS, FOUND_NUMBERS, FOUND_INDICES, TRACK, TRACK_REST = 5, 32, 5, 8, 3
"""Numbers of a blob of a view, a target found, and a target of the track, as in engine.h and space.h."""


class Way:
    """One field's way to its points, in the kernel's arrays; what nobody asks for is not made."""

    def __init__(self, target: NDArray[np.int32], index: Indices, kept: Array, held: Array) -> None:
        """Take over what the kernel wrote.

        Args:
            target: (M,) ids of the targets.
            index: Indices of what was found.
            kept: Numbers of blobs and points, which keep them.
            held: All other numbers.
        """
        self._target, self._targets = target, len(target)
        self._index, self._kept, self._held = index, kept, held
        self._room = (len(kept) - FOUND_NUMBERS * len(target)) // COLUMNS
        self.head = Head._make(held[:HEAD].tolist())

    @property
    def blobs(self) -> Blobs:
        """Blobs of both views."""
        head, room = self.head, self._room
        columns = self._kept[: COLUMNS * room].reshape(COLUMNS, room)
        return blobs_of(columns, int(head.blobs), head.common_reach_px, head.jitter_px)

    @property
    def halves(self) -> tuple[ViewBlobs, ViewBlobs]:
        """Whole blobs of the left and right view."""
        left, right = (self._half(view, int(count)) for view, count in enumerate(self.head[4:6]))
        return left, right

    def _half(self, view: int, count: int) -> ViewBlobs:
        room = self._room
        own = self._held[HEAD + HALF_COLUMNS * room * view :]
        xy_px, sigma_px = (own[at * room :][: 2 * count].reshape(count, 2) for at in (0, 2))
        return ViewBlobs(xy_px, sigma_px, own[4 * room :][:count], self.head.common_reach_px)

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of whole blobs of the left and right view."""
        return int(self.head.left), int(self.head.right)

    @property
    def misses(self) -> Indices | None:
        """(M,) `Miss` of each target; None if none was found."""
        return self._index[3] if self.head.found else None

    @property
    def unconfirmed(self) -> Indices:
        """Indices of the targets found that are not to be reported."""
        count = int(self.head.found)
        if self.head.believed == count:
            return self._index[0, :0]
        unconfirmed: Indices = self._index[0, :count][self._index[4, :count] == 0]
        return unconfirmed

    @property
    def points(self) -> Points:
        """Points to be reported."""
        if self.head.believed == self.head.found:
            return self._points
        return self._points.select(self._index[4, : int(self.head.found)] != 0)

    @property
    def _points(self) -> Points:
        """Points of all targets found."""
        count, room = int(self.head.found), self._targets
        numbers = self._kept[COLUMNS * self._room :]
        return Points(
            self._target[self._index[0, :count]],
            numbers[: 3 * count].reshape(count, 3),
            numbers[3 * room :][: 9 * count].reshape(count, 3, 3),
            numbers[12 * room :][: 9 * count].reshape(count, 3, 3),
            numbers[21 * room :][: 4 * count].reshape(count, 2, 2),
            numbers[25 * room :][:count],
        )

    @property
    def track(self) -> Track:
        """Track after it, with its sighting if anything was found."""
        count, room, head = int(self.head.found), self._targets, self.head
        if not count:
            return Track.of_numbers(self._target, self.track_numbers)
        target, left, right = self._index[:3, :count]
        rest = self._held[HEAD + 2 * HALF_COLUMNS * self._room :]
        expected = Expected(rest[: 3 * room].reshape(room, 3), rest[7 * room :][:room])
        predicted_px = rest[3 * room :][: 4 * room].reshape(2, room, 2)
        sighting = Sighting(
            self._points, target, left, right, expected, None, head.surprise, self._index[3], predicted_px
        )
        return Track.of_numbers(self._target, self.track_numbers, sighting)

    @property
    def track_numbers(self) -> Array:
        """Numbers of the track after it."""
        return self._held[-(TRACK * self._targets + TRACK_REST) :]
