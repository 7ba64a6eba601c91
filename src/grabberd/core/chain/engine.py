"""The engine: packed fields to points by one call of the compiled kernel for many of them.

It carries the track from field to field. `Way` is one field's way: the kernel's arrays for it, and the
objects that are made of them when somebody asks.
"""

import ctypes
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices
from grabberd.core.field import PackedField
from grabberd.core.geometry import View
from grabberd.core.kernel import MORE_ROOM, NO_FULLNESS, NO_TABLE, UNSOUND, Kernel
from grabberd.core.measurement import Blobs, LocationSettings
from grabberd.core.measurement.location import (
    COLUMNS,
    ROOM,
    Kept,
    blobs_of,
    fail,
    grey_settings,
    known_of,
    settings_for,
    takes,
    takes_grey,
)
from grabberd.core.reconstruction import Points, Track, Tracker, ViewBlobs
from grabberd.core.reconstruction.correspondence.agreement import Sighting
from grabberd.core.reconstruction.correspondence.compiled_search import Identifying, Predictors, World
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField, Expected


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
        return self._index[0, :count][self._index[4, :count] == 0]

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
    def places_mm(self) -> Array:
        """(M, 3) places of all targets after it, as the track has them."""
        return self.track_numbers[: 3 * self._targets].reshape(self._targets, 3)

    @property
    def track_numbers(self) -> Array:
        """Numbers of the track after it."""
        return self._held[-(TRACK * self._targets + TRACK_REST) :]


_REAL, _ADDRESS = ctypes.c_double, ctypes.c_void_p


class Following(ctypes.Structure):
    """Settings of tracking and identification, and the views' columns; keeps alive what it points to."""

    _fields_ = (
        ("columns", _REAL * 4),
        ("speed_mm_s", _REAL),
        ("longest_gap_s", _REAL),
        ("least_share", _REAL),
        ("astray_mm", _REAL),
        ("otherwise_mm", _REAL),
        ("acceleration_mm_s2", _REAL),
        ("vague_mm", _REAL),
        ("firm_mm", _REAL),
        ("predictors", _ADDRESS),
        ("identifying", Identifying),
    )
    kept: tuple[Predictors, Identifying]

    @classmethod
    def of(cls, tracker: Tracker, views: Sequence[View]) -> "Following":
        """Fill it in for a tracker whose targets the kernel identifies."""
        known, limits, judges = tracker.settings, tracker.limits, tracker.correspondence
        assert judges.identification is not None
        assert isinstance(judges.following.field, DisplacementField)
        predictors, identifying = Predictors.of(judges.following.field), judges.identification.in_c()
        columns = [edge for view in views for edge in (view.first_column, view.end_column)]
        own = cls(
            (_REAL * 4)(*columns),
            known.speed_mm_s,
            known.longest_gap_s,
            known.least_share,
            known.astray_mm,
            limits.otherwise_mm,
            known.acceleration_mm_s2,
            limits.vague_mm,
            limits.firm_mm,
            ctypes.addressof(predictors),
            identifying,
        )
        own.kept = predictors, identifying
        return own


class Inputs:
    """Inputs of location beside the fields of one kind."""

    settings: ctypes.Structure

    def __init__(self, packed: PackedField, settings: LocationSettings) -> None:
        self.picture, self._lines_apart = _picture(packed), packed.lines_apart
        self._of = settings
        own = settings_for(packed, settings)
        self._known = known_of(own, packed.y_step, packed.lines_apart) if packed.bits == 1 else None
        if self._known is None:
            self.settings = grey_settings(own)

    def fits(self, packed: PackedField, settings: LocationSettings) -> bool:
        """True if these are the inputs for a field and settings."""
        same_lines = self._lines_apart == packed.lines_apart
        return self._of is settings and self.picture == _picture(packed) and same_lines

    def begin(self) -> None:
        """Take up the tables made so far."""
        if self._known is not None:
            self._add(self._known.begin())

    def complete(self, packed: PackedField, head: Head) -> None:
        """Add the table that the kernel lacks.

        Raises:
            MeasurementError: It lacks none, but memory, or refuses the picture.
        """
        if self._known is None or head.status not in (NO_TABLE, NO_FULLNESS):
            fail(int(head.status), packed)
        missing = head.wide, head.high, head.fraction, head.noise
        self._add(self._known.completed(self._kept, int(head.status), missing))

    def _add(self, kept: Kept) -> None:
        self._kept, self.settings = kept, kept.settings


def _picture(packed: PackedField) -> tuple[int, int, int, int, int]:
    _, rows, stride = packed.data.shape
    return packed.bits, rows, stride, packed.columns, packed.y_step


MOST_FIELDS = 64
"""Fields of one call."""


class Engine:
    """Location, tracking and intersection of one object before one rig.

    Attributes:
        track: Numbers of the track after the last field: all state there is, as tables and predictors are
            made again if they are missing.
        target: (M,) ids of the targets.
    """

    def __init__(self, kernel: Kernel, tracker: Tracker, views: Sequence[View]) -> None:
        self.track = tracker.start().numbers
        self.target = tracker.model.target
        self._kernel = kernel
        self._world = World.of(tracker.rig, tracker.correspondence.following, tracker.noise)
        self._following = Following.of(tracker, views)
        self._room = ROOM
        self._inputs: Inputs | None = None

    @classmethod
    def of(cls, kernel: Kernel | None, tracker: Tracker, views: Sequence[View]) -> "Engine | None":
        """Begin before the first field; None if the kernel does not cover the rig or the object."""
        return cls(kernel, tracker, views) if kernel and tracker.correspondence.identification else None

    @staticmethod
    def takes(packed: PackedField, settings: LocationSettings) -> bool:
        """True if the kernel covers this field and these settings."""
        own = settings_for(packed, settings)
        return takes(packed, own) or takes_grey(packed, own)

    def run(
        self, fields: Sequence[PackedField], passed_s: Sequence[float], settings: LocationSettings
    ) -> Iterator[Way]:
        """Ways of the next fields, in order.

        Args:
            fields: Of one kind: bits, size and lines.
            passed_s: Time since the field before each.
            settings: For all of them.

        Raises:
            MeasurementError: There is not enough memory, or the kernel refuses the picture or a blob.
        """
        inputs, taken = self._inputs_of(fields[0], settings), self._take(fields, passed_s)
        done = 0
        while done < len(fields):
            some = taken.data[done : done + MOST_FIELDS]
            given = inputs.settings, self._world, self._following, self.track, *taken.arrays(done)
            end = done + self._kernel.measure(some, inputs.picture, taken.room, *given)
            for at in range(done, end):
                way = self._way(taken, at)
                self.track = way.track_numbers
                yield way
            stopped, done = end < done + len(some), end
            if not stopped:
                continue
            way = self._way(taken, done)
            if way.head.status == MORE_ROOM:
                self._room = int(way.head.blobs)
                fields, passed_s, done = fields[done:], passed_s[done:], 0
                taken = self._take(fields, passed_s)
            else:
                self._complete(inputs, fields[done], way)

    def _complete(self, inputs: Inputs, packed: PackedField, way: Way) -> None:
        """Make what the kernel lacks for a field."""
        if way.head.status == UNSOUND:
            _ = way.halves  # says what is wrong with them
        inputs.complete(packed, way.head)

    def _way(self, taken: "_Taken", at: int) -> Way:
        return Way(self.target, taken.index[at], taken.kept[at], taken.held[at])

    def _inputs_of(self, packed: PackedField, settings: LocationSettings) -> Inputs:
        if self._inputs is None or not self._inputs.fits(packed, settings):
            self._inputs = Inputs(packed, settings)
        self._inputs.begin()
        return self._inputs

    def _take(self, fields: Sequence[PackedField], passed_s: Sequence[float]) -> "_Taken":
        about = [(one.parity, one.y0, one.threshold, s) for one, s in zip(fields, passed_s, strict=True)]
        count, targets = len(fields), len(self.target)
        kept = COLUMNS * self._room + FOUND_NUMBERS * targets
        held = HEAD + 2 * HALF_COLUMNS * self._room + (8 + TRACK) * targets + TRACK_REST
        return _Taken(
            self._room,
            tuple(np.ascontiguousarray(packed.data) for packed in fields),
            np.array(about),
            np.empty((count, FOUND_INDICES, targets), np.intp),
            np.empty((count, kept)),
            np.empty((count, held)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Taken:
    """Fields of a call, and room for what comes of them: `kept` by their results, or only `held` for now."""

    room: int
    data: tuple[NDArray[np.uint8], ...]
    about: Array
    index: Indices
    kept: Array
    held: Array

    def arrays(self, done: int) -> tuple[NDArray[Any], ...]:
        """The kernel's, but for those of fields that are done."""
        every = self.about, self.index, self.kept, self.held
        return tuple(one[done:] for one in every) if done else every
