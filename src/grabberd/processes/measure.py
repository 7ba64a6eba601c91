"""Fields in, points out: location, correspondence and intersection (paper figures 4 and 10)."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import CalibrationMismatch, MeasurementError
from grabberd.field import NumberedField, PackedField
from grabberd.geometry import Calibration, LocalField, Rig, View
from grabberd.kernel import KERNEL
from grabberd.measurement import Blobs, LocationSettings, measure
from grabberd.reconstruction import (
    CoverageTally,
    ImageNoise,
    ObjectModel,
    Points,
    Track,
    Tracker,
    TrackingSettings,
    ViewBlobs,
)

Array = NDArray[np.float64]

FIELDS_A_GROUP = 500
"""Ten seconds of video."""
JITTERS, JITTER_EVERY = 9, 25
"""The line jitter is the median of the last nine estimates. It belongs to the equipment and hardly changes,
so that after the first nine fields only every 25th is used for a new estimate."""


@dataclass(frozen=True, slots=True)
class MeasureSetup:
    """Setup of a measurement: the same setup and fields give the same points, bit for bit.

    Attributes:
        calibration: both virtual cameras.
        object_model: nominal positions of the targets.
        line_jitter_px: standard deviation of the shift common to all pixels of a field line.
        location: settings for locating blobs; `tracking`: for identifying and following targets.
    """

    calibration: Calibration
    object_model: ObjectModel
    line_jitter_px: float = 0.12
    location: LocationSettings = field(default_factory=LocationSettings)
    tracking: TrackingSettings = field(default_factory=TrackingSettings)


class MeasuredField(NamedTuple):
    """Blobs of both views of one field, and its points."""

    n: int
    time_ns: int
    blobs: Blobs
    points: Points


def measure_fields(
    fields: Iterable[NumberedField], setup: MeasureSetup, tally: CoverageTally | None = None
) -> Iterator[MeasuredField]:
    """Points of every field, in order; identities and velocities are carried from field to field.

    Yields the result of each field before it takes the next, so the fields may be endless. A `tally` counts
    who was found in them.
    """
    step: _Step | None = None
    for numbered in fields:
        # Doubled and intact lines have different σ of their image coordinates: the tracker starts again.
        if step is None or step.y_step != numbered.packed.y_step:
            step = _Step(setup, numbered.packed.y_step, tally)
        yield step.measure(numbered)


def measured_groups(
    fields: Iterable[NumberedField], setup: MeasureSetup, tally: CoverageTally | None = None
) -> Iterator[list[MeasuredField]]:
    """Measure every field, in groups that bound the memory in use; the results are those of `measure_fields`.

    Raises:
        CalibrationMismatch: a field's size differs from the calibration's.
        MeasurementError: there are no fields, or no points in any of them.
    """
    measured = measure_fields(_fitting(fields, setup), setup, tally)
    count = points = 0
    while group := list(islice(measured, FIELDS_A_GROUP)):
        count += len(group)
        points += sum(len(one.points) for one in group)
        yield group
    if not count:
        raise MeasurementError(
            "the capture has no undamaged field to measure", "the capture's ledger gives the reasons"
        )
    if not points:
        raise MeasurementError(
            f"no target of the object model was found in any of {count} fields",
            "check that calibration and object model belong to this capture's rig and object",
        )


def _fitting(fields: Iterable[NumberedField], setup: MeasureSetup) -> Iterator[NumberedField]:
    known = setup.calibration
    for numbered in fields:
        lines = numbered.packed.rows * numbered.packed.y_step
        if (numbered.packed.columns, lines) != (known.columns, known.lines):
            raise CalibrationMismatch(
                f"calibration {known.id} is for pictures of {known.columns} x {known.lines}, "
                f"field {numbered.n} has {numbered.packed.columns} x {lines}",
                "measure this capture with a calibration of its own grabber",
            )
        yield numbered


class Locating:
    """Location of each field's blobs; line jitter, a property of the equipment, is seldom re-estimated."""

    def __init__(self, settings: LocationSettings) -> None:
        self._estimating = self._settled = settings
        self._fields = 0
        self._jitters_px: deque[float] = deque(maxlen=JITTERS)

    @classmethod
    def of(cls, setup: MeasureSetup) -> "Locating":
        """Location before the first field."""
        return cls(replace(setup.location, line_jitter_px=setup.line_jitter_px))

    def blobs(self, packed: PackedField) -> Blobs:
        """Blobs of the next field."""
        due = len(self._jitters_px) < JITTERS or self._fields % JITTER_EVERY == 0
        blobs = measure(packed, None, self._estimating if due else self._settled)
        self._fields += 1
        if blobs.line_jitter_px is not None:
            self._jitters_px.append(blobs.line_jitter_px)
            likely_px = float(np.median(self._jitters_px))
            self._settled = replace(self._estimating, line_jitter_px=likely_px, line_jitter_known=True)
        return blobs


class _Step:
    """State carried from field to field."""

    def __init__(self, setup: MeasureSetup, y_step: int, tally: CoverageTally | None) -> None:
        self.y_step = y_step
        self._setup = setup
        self._tally = tally
        rig = Rig.of(setup.calibration)
        self._locating = Locating.of(setup)
        noise = ImageNoise.of(rig, setup.object_model, setup.line_jitter_px, y_step)
        self._tracker = Tracker(rig, setup.object_model, noise, setup.tracking)
        # From the object model alone, never from an earlier track: points are a function of the fields given.
        self._track: Track = self._tracker.start()
        self._last_ns: int | None = None

    def measure(self, numbered: NumberedField) -> MeasuredField:
        blobs = self._locating.blobs(numbered.packed)
        known = self._setup.calibration
        halves = zip(known.views, known.local_fields, strict=True)
        left, right = (whole_blobs(blobs, view, local_field) for view, local_field in halves)
        self._track, points = self._tracker.step(self._track, left, right, self._passed_s(numbered.time_ns))
        if self._tally is not None:
            self._tally.add(numbered.n, self._track, points, (left, right), self._tracker.correspondence)
        return MeasuredField(numbered.n, numbered.time_ns, blobs, points)

    def _passed_s(self, time_ns: int) -> float:
        """Time since the previous field; infinite for the first or a backward time, to restart tracking."""
        last_ns, self._last_ns = self._last_ns, time_ns
        return np.inf if last_ns is None or time_ns <= last_ns else (time_ns - last_ns) / 1e9


def whole_blobs(blobs: Blobs, view: View, local_field: LocalField | None = None) -> ViewBlobs:
    """Blobs of a view without those cut off by the field's edge or the seam, whose centres are false.

    The view's local field, known displacements beyond the model, is subtracted.
    """
    chosen = _chosen_compiled if KERNEL else _chosen
    xy_px, sigma_px, common_px = chosen(blobs, view.first_column, view.end_column)
    # Taken off the blobs rather than added to the functional model: equations (4) to (7) stay as printed, and
    # a rig without a local field pays nothing for it.
    if local_field is not None:
        xy_px = xy_px - local_field.at(xy_px)
    return ViewBlobs(xy_px, sigma_px, common_px, blobs.common_reach_px)


def _chosen(blobs: Blobs, first_column: int, end_column: int) -> tuple[Array, Array, Array]:
    """Positions, their σ, and the common error of the whole blobs in one half."""
    own = whole(blobs, first_column, end_column)
    return blobs.xy_px[own], blobs.sigma_px[own], blobs.common_px[own]


def _chosen_compiled(blobs: Blobs, first_column: int, end_column: int) -> tuple[Array, Array, Array]:
    assert KERNEL
    all_of_them, out = len(blobs), np.empty(5 * len(blobs))
    parts = (blobs.xy_px, blobs.sigma_px, blobs.common_px, blobs.width_px, blobs.at_border)
    count = KERNEL.whole(*map(np.ascontiguousarray, parts), first_column, end_column, out)
    pairs = out[: 4 * all_of_them].reshape(2, all_of_them, 2)
    return pairs[0, :count], pairs[1, :count], out[4 * all_of_them :][:count]


def whole(blobs: Blobs, first_column: int, end_column: int) -> NDArray[np.bool_]:
    """(N,) True for blobs that lie wholly within the columns."""
    x, half = blobs.xy_px[:, 0], blobs.width_px / 2
    inside = (x - half >= first_column - 0.5) & (x + half <= end_column - 0.5)
    own: NDArray[np.bool_] = inside & ~blobs.at_border
    return own
