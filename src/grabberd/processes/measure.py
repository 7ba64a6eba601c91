"""Fields in, points out: location, correspondence and intersection (paper figures 4 and 10).

Beside the points, the rig watch finds out if camera or mirrors have moved.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.field import NumberedField, PackedField
from grabberd.geometry import Calibration, LocalField, Rig, View
from grabberd.kernel import KERNEL
from grabberd.measurement import Blobs, LocationSettings, measure
from grabberd.reconstruction import (
    Correspondence,
    ImageNoise,
    ObjectModel,
    Points,
    Track,
    Tracker,
    TrackingSettings,
    ViewBlobs,
)
from grabberd.reconstruction.accuracy.drift_check import (
    LEAST_TARGETS,
    WINDOW,
    DriftCheck,
    RigFit,
    RigVerdict,
)

Array = NDArray[np.float64]

JITTERS, JITTER_EVERY = 9, 25
"""The line jitter is the median of so many fields' own estimates; then one field in so many is asked."""
EVERY = 10
"""One field in so many is looked at: five a second."""
LEAST_SHARE = 0.5
"""Of the blobs in the view that shows fewer: with fewer points, targets are identified more generously."""
FIT_EVERY = 50
"""Fields from fit to fit: one a second."""
MANY = 3 * LEAST_TARGETS
"""Blobs in either view that cannot all be false: of these some targets have to be identified."""
GENEROUS_PX = 1.0
"""What a rig that has moved may add to every image coordinate: past this, nothing is identified."""


@dataclass(frozen=True, slots=True)
class MeasureSetup:
    """Setup of a measurement: the same setup and fields give the same points, bit for bit.

    Attributes:
        calibration: both virtual cameras.
        object_model: where the targets nominally are.
        line_jitter_px: standard deviation of the shift that all pixels of a field line have in common.
        location: how blobs are located; `tracking`: how targets are identified and followed.
    """

    calibration: Calibration
    object_model: ObjectModel
    line_jitter_px: float = 0.12
    location: LocationSettings = field(default_factory=LocationSettings)
    tracking: TrackingSettings = field(default_factory=TrackingSettings)


class MeasuredField(NamedTuple):
    """One field's blobs, of both views together, and its points."""

    n: int
    time_ns: int
    blobs: Blobs
    points: Points


def measure_fields(fields: Iterable[NumberedField], setup: MeasureSetup) -> Iterator[MeasuredField]:
    """Points of every field, in order; identities and velocities are carried from field to field.

    Yields one result for each field as soon as it has taken it, so the fields may be endless.
    """
    step: _Step | None = None
    for numbered in fields:
        if step is None or step.y_step != numbered.packed.y_step:
            step = _Step(setup, numbered.packed.y_step)
        yield step.measure(numbered)


class _Locating:
    """Location of each field's blobs; line jitter, a property of the equipment, is seldom re-estimated."""

    def __init__(self, settings: LocationSettings) -> None:
        self._asking = self._knowing = settings
        self._fields = 0
        self._jitters_px: deque[float] = deque(maxlen=JITTERS)

    def blobs(self, packed: PackedField) -> Blobs:
        asked = len(self._jitters_px) < JITTERS or self._fields % JITTER_EVERY == 0
        blobs = measure(packed, None, self._asking if asked else self._knowing)
        self._fields += 1
        if blobs.line_jitter_px is not None:
            self._jitters_px.append(blobs.line_jitter_px)
            likely_px = float(np.median(self._jitters_px))
            self._knowing = replace(self._asking, line_jitter_px=likely_px, line_jitter_known=True)
        return blobs


class _Step:
    """State carried from field to field."""

    def __init__(self, setup: MeasureSetup, y_step: int) -> None:
        self.y_step = y_step
        self._setup = setup
        rig = Rig.of(setup.calibration)
        self._locating = _Locating(replace(setup.location, line_jitter_px=setup.line_jitter_px))
        noise = ImageNoise.of(rig, setup.object_model, setup.line_jitter_px, y_step)
        self._tracker = Tracker(rig, setup.object_model, noise, setup.tracking)
        self._track: Track = self._tracker.start()
        self._last_ns: int | None = None

    def measure(self, numbered: NumberedField) -> MeasuredField:
        blobs = self._locating.blobs(numbered.packed)
        known = self._setup.calibration
        halves = zip(known.views, known.local_fields, strict=True)
        left, right = (whole_blobs(blobs, view, local_field) for view, local_field in halves)
        self._track, points = self._tracker.step(self._track, left, right, self._passed_s(numbered.time_ns))
        return MeasuredField(numbered.n, numbered.time_ns, blobs, points)

    def _passed_s(self, time_ns: int) -> float:
        """Since the field before; infinite where none came earlier, so that targets are identified anew."""
        last_ns, self._last_ns = self._last_ns, time_ns
        return np.inf if last_ns is None or time_ns <= last_ns else (time_ns - last_ns) / 1e9


def whole_blobs(blobs: Blobs, view: View, local_field: LocalField | None = None) -> ViewBlobs:
    """The blobs of a view, but none that the field's edge or the seam cuts off: those have no true centre.

    What the picture is known to show there beyond the model, the view's local field, is taken off.
    """
    chosen = _chosen_compiled if KERNEL else _chosen
    xy_px, sigma_px, common_px = chosen(blobs, view.first_column, view.end_column)
    if local_field is not None:
        xy_px = xy_px - local_field.at(xy_px)
    return ViewBlobs(xy_px, sigma_px, common_px, blobs.common_reach_px)


def _chosen(blobs: Blobs, first_column: int, end_column: int) -> tuple[Array, Array, Array]:
    """Places, their standard deviations, and what they have in common, of a half's whole blobs."""
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
    """(N,) which blobs lie in the half of these columns, and wholly so."""
    x, half = blobs.xy_px[:, 0], blobs.width_px / 2
    inside = (x - half >= first_column - 0.5) & (x + half <= end_column - 0.5)
    own: NDArray[np.bool_] = inside & ~blobs.at_border
    return own


class RigWatch:
    """Compares the pictures with the calibration while they are measured; costs far less than measuring.

    Before a rig that has moved by more than half a pixel rays no longer meet, and so no target is identified.
    Therefore they are then identified as if the calibration were uncertain by `GENEROUS_PX`, for this
    comparison alone.
    """

    def __init__(self, setup: MeasureSetup) -> None:
        rig, model = Rig.of(setup.calibration), setup.object_model
        known = setup.tracking.correspondence
        noise = ImageNoise.of(rig, model, setup.line_jitter_px, 1)
        self._calibration = setup.calibration
        self._generous = Correspondence(rig, model, noise, replace(known, unmodelled_px=GENEROUS_PX))
        self._movement = DriftCheck(rig, model)
        self._blobs: deque[int] = deque(maxlen=WINDOW)
        self._fields = 0

    def see(self, measured: MeasuredField) -> RigFit | None:
        """Takes a measured field; once a second what the last seconds say, else None."""
        self._fields += 1
        if self._fields % EVERY == 0:
            self._movement.add(self._points(measured))
        return self.fit() if self._fields % FIT_EVERY == 0 else None

    def fit(self) -> RigFit:
        """Fit over the last seconds."""
        fit = self._movement.fit()
        seen = sorted(self._blobs)[len(self._blobs) // 2] if self._blobs else 0
        if fit.verdict is RigVerdict.UNKNOWN and seen >= MANY:
            return replace(fit, verdict=RigVerdict.UNMATCHED)
        return fit

    def _points(self, measured: MeasuredField) -> Points:
        x_px, seam = measured.blobs.xy_px[:, 0], self._calibration.views[1].first_column
        fewer = int(min(np.count_nonzero(x_px < seam), np.count_nonzero(x_px >= seam)))
        self._blobs.append(fewer)
        if len(measured.points) >= LEAST_SHARE * fewer:
            return measured.points
        return self._generous.identify(*self._view_blobs(measured)).points

    def _view_blobs(self, measured: MeasuredField) -> tuple[ViewBlobs, ViewBlobs]:
        halves = zip(self._calibration.views, self._calibration.local_fields, strict=True)
        left, right = (whole_blobs(measured.blobs, view, local_field) for view, local_field in halves)
        return left, right
