"""The engine: packed fields to points by one call of the compiled kernel for many of them.

It carries the track from field to field.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.engine_inputs import Following, Inputs
from grabberd.core.chain.engine_way import (
    FOUND_INDICES,
    FOUND_NUMBERS,
    HALF_COLUMNS,
    HEAD,
    TRACK,
    TRACK_REST,
    Way,
)
from grabberd.core.field import PackedField
from grabberd.core.geometry import View
from grabberd.core.kernel import MORE_ROOM, UNSOUND, Kernel
from grabberd.core.measurement import LocationSettings
from grabberd.core.measurement.compiled.binary_location import COLUMNS, ROOM, takes
from grabberd.core.measurement.compiled.grey_location import takes_grey
from grabberd.core.measurement.location import settings_for
from grabberd.core.reconstruction import Tracker
from grabberd.core.reconstruction.correspondence.compiled_search import World

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

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


class _Taken:
    """Fields of a call, and room for what comes of them: `kept` by their results, or only `held` for now."""

    def __init__(
        self,
        room: int,
        data: tuple[NDArray[np.uint8], ...],
        about: Array,
        index: Indices,
        kept: Array,
        held: Array,
    ) -> None:
        self.room, self.data = room, data
        self.about, self.index, self.kept, self.held = about, index, kept, held

    def arrays(self, done: int) -> tuple[NDArray[Any], ...]:
        """The kernel's, but for those of fields that are done."""
        every = self.about, self.index, self.kept, self.held
        return tuple(one[done:] for one in every) if done else every
