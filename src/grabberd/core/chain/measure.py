"""Fields in, points out: location, correspondence and intersection (paper figures 4 and 10); and beside the
points of the same fields, the images of targets that one view alone sees.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby, islice
from typing import NamedTuple

import numpy as np

from grabberd.core.chain.engine import Engine
from grabberd.core.chain.locating import HINT, Locating, OtherSizes, px_per_mm_of, sized, whole_views
from grabberd.core.chain.mark_watch import MarkWatch, RigCorrection
from grabberd.core.field import NumberedField, PackedField
from grabberd.core.geometry import Calibration, Rig
from grabberd.core.kernel import KERNEL
from grabberd.core.measurement import Blobs, LocationSettings
from grabberd.core.measurement.marks import Located
from grabberd.core.reconstruction import (
    Correspondence,
    CoverageTally,
    DiscCentres,
    ImageNoise,
    ObjectModel,
    Points,
    SingleViewImages,
    SingleViewSearch,
    Track,
    Tracker,
    TrackingSettings,
)
from grabberd.core.reconstruction.coverage_tally import TrackedField
from grabberd.errors import CalibrationMismatch, MeasurementError

MarksBefore = Callable[[int], Iterable[tuple[int, Located]]]
"""Gives parity and located marks of the fields before one, in order."""
FIELDS_A_GROUP = 500
"""Ten seconds of video."""
FIELDS_AT_ONCE = 25
"""Half a second."""


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

    @property
    def scale(self) -> float:
        """Pixels of the picture for a millimetre on the object."""
        return px_per_mm_of(self.calibration.views)

    @property
    def sized(self) -> LocationSettings:
        """Settings for locating blobs, with limits of their size that suit the object's targets."""
        return sized(self.location, self.scale, self.object_model.target_diameter_mm)


class MeasuredField(NamedTuple):
    """Blobs of both views of one field, and its points.

    `correction` is what was taken off the images, the same object until it changes; None without marks.
    """

    n: int
    time_ns: int
    blobs: Blobs
    points: Points
    correction: RigCorrection | None = None


class Trackers:
    """Trackers of one setup, for those who measure with it again and again, in one thread.

    They take longer to make than a field lasts, and keep nothing from field to field.
    """

    def __init__(self, setup: MeasureSetup) -> None:
        self.setup = setup
        self._made: dict[tuple[int, int], tuple[Tracker, DiscCentres | None]] = {}

    def of(self, lines: tuple[int, int]) -> tuple[Tracker, DiscCentres | None]:
        """Tracker of fields with these lines, and the correction of its points; made when first asked for."""
        if lines not in self._made:
            self._made[lines] = _tracker(self.setup, self.setup.calibration, lines)
        return self._made[lines]


def _tracker(
    setup: MeasureSetup, calibration: Calibration, lines: tuple[int, int]
) -> tuple[Tracker, DiscCentres | None]:
    rig, model = Rig.of(calibration), setup.object_model
    noise = ImageNoise.of(rig, model, setup.line_jitter_px, *lines)
    tracker = Tracker(rig, model, noise, setup.tracking)
    return tracker, DiscCentres(rig, model) if calibration.disc_centres else None


def measure_fields(
    fields: Iterable[NumberedField],
    setup: MeasureSetup,
    tally: CoverageTally | None = None,
    ahead: int = 1,
    before: MarksBefore = lambda _: (),
    trackers: Trackers | None = None,
) -> Iterator[MeasuredField]:
    """Points of every field, in order; identities and velocities are carried from field to field.

    Args:
        fields: In order; they may be endless.
        setup: Of the measurement.
        tally: Counts who was found in them.
        ahead: Number of fields that are taken together. By default each result is yielded before the next
            field is taken; with more the results are the same, in less time.
        before: Asked for the marks of the fields before the first, once that has come: so a rig that was
            knocked earlier is corrected from the first field on.
        trackers: Of this setup, if they were made for earlier fields.
    """
    step: _Step | None = None
    trackers = trackers or Trackers(setup)
    assert trackers.setup is setup, "trackers of another setup would measure with its calibration"
    watched = _watched(fields, setup.calibration, before)
    while some := list(islice(watched, ahead)):
        for (lines, *_), alike in groupby(some, _kind):
            group = list(alike)
            # Lines of other kinds have different σ of their image coordinates: the tracker starts again.
            if step is None or step.lines != lines:
                step = _Step(trackers, lines, tally)
            step.correct(group[0].numbered.n, group[0].correction)
            yield from step.results([one.numbered for one in group])


class _Watched(NamedTuple):
    """A field, and the correction that is in force for it."""

    numbered: NumberedField
    correction: RigCorrection | None


def _watched(
    fields: Iterable[NumberedField], calibration: Calibration, before: MarksBefore
) -> Iterator[_Watched]:
    watch = MarkWatch.of(calibration)
    if watch is None:
        yield from (_Watched(numbered, None) for numbered in fields)
        return
    remembered = False
    for numbered in fields:
        if not remembered:
            remembered = True
            for parity, marks in before(numbered.n):
                watch.see(parity, marks)
        yield _Watched(numbered, watch.see(numbered.packed.parity, numbered.packed.marks))


def _kind(watched: _Watched) -> tuple[tuple[int, int], int, int, tuple[int, ...], int]:
    """Kind of a field, lines first: those of one kind are measured together."""
    packed = watched.numbered.packed
    return packed.lines, packed.bits, packed.columns, packed.data.shape, id(watched.correction)


def measured_groups(
    fields: Iterable[NumberedField], setup: MeasureSetup, tally: CoverageTally | None = None
) -> Iterator[list[MeasuredField]]:
    """Measure every field, in groups that bound the memory in use; the results are those of `measure_fields`.

    Raises:
        CalibrationMismatch: a field's size differs from the calibration's.
        MeasurementError: there are no fields, or no points in any of them.
    """
    newest: deque[NumberedField] = deque(maxlen=1)
    measured = measure_fields(_fitting(fields, setup, newest), setup, tally, FIELDS_AT_ONCE)
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
        raise _no_points(count, newest[-1].packed, setup)


def _no_points(count: int, packed: PackedField, setup: MeasureSetup) -> MeasurementError:
    halves = [(view.first_column, view.end_column) for view in setup.calibration.views]
    sizes = OtherSizes(packed, halves, setup.sized, setup.scale).in_words()
    return MeasurementError(
        f"no target of the object model was found in any of {count} fields" + (f": {sizes}" if sizes else ""),
        HINT if sizes else "check that calibration and object model belong to this capture's rig and object",
    )


def _fitting(
    fields: Iterable[NumberedField], setup: MeasureSetup, newest: deque[NumberedField]
) -> Iterator[NumberedField]:
    known = setup.calibration
    for numbered in fields:
        newest.append(numbered)
        lines = numbered.packed.rows * numbered.packed.y_step
        if (numbered.packed.columns, lines) != (known.columns, known.lines):
            raise CalibrationMismatch(
                f"calibration {known.id} is for pictures of {known.columns} x {known.lines}, "
                f"field {numbered.n} has {numbered.packed.columns} x {lines}",
                "measure this capture with a calibration of its own grabber",
            )
        yield numbered


class _Step:
    """State carried from field to field."""

    def __init__(self, trackers: Trackers, lines: tuple[int, int], tally: CoverageTally | None) -> None:
        self.lines = lines
        self._setup = setup = trackers.setup
        self._tally = tally
        self._locating = Locating(setup.sized, setup.line_jitter_px)
        self._correction: RigCorrection | None = None
        self._use(setup.calibration, *trackers.of(lines))
        # From the object model alone, never from an earlier track: points are a function of the fields given.
        self._track: Track = self._tracker.start()
        self._last_ns: int | None = None

    def correct(self, n: int, correction: RigCorrection | None) -> None:
        """Use a corrected calibration from field `n` on; what is tracked stays where it is."""
        if correction is None or correction is self._correction:
            return
        before, self._correction = self._correction, correction
        if self._tally is not None:
            self._tally.correct(n, correction.document)
        if not (correction.corrects or (before and before.corrects)):
            return
        track = self._engine.track if self._engine else None
        corrected = correction.applied_to(self._setup.calibration)
        self._use(corrected, *_tracker(self._setup, corrected, self.lines))
        if self._engine and track is not None:
            self._engine.track = track

    def _use(self, calibration: Calibration, tracker: Tracker, centres: DiscCentres | None) -> None:
        self._calibration, self._tracker, self._centres = calibration, tracker, centres
        self._engine = Engine.of(KERNEL, self._tracker, calibration.views)

    def results(self, fields: Sequence[NumberedField]) -> Iterator[MeasuredField]:
        """Results of the next fields, in order, all of one kind."""
        while fields:
            alike = self._locating.alike(fields[0].packed)
            some, fields = fields[:alike], fields[alike:]
            if self._engine and self._engine.takes(some[0].packed, self._locating.settings):
                yield from self._by_engine(self._engine, some)
            else:
                yield from map(self._by_numpy, some)

    def _by_engine(self, engine: Engine, fields: Sequence[NumberedField]) -> Iterator[MeasuredField]:
        passed_s = [self._passed_s(one.time_ns) for one in fields]
        ways = engine.run([one.packed for one in fields], passed_s, self._locating.settings)
        for numbered, way in zip(fields, ways, strict=True):
            blobs = way.blobs
            self._locating.note(blobs)
            if self._tally is not None:
                self._tally.add(numbered.n, way, self._tracker.correspondence)
            points = way.points
            if self._centres is not None:
                points = self._centres.corrected(points, way.places_mm)
            yield MeasuredField(numbered.n, numbered.time_ns, blobs, points, self._correction)

    def _by_numpy(self, numbered: NumberedField) -> MeasuredField:
        """Measure what the engine does not cover, each step by whatever there is for it."""
        blobs = self._locating.blobs(numbered.packed)
        left, right = whole_views(blobs, self._calibration)
        before = Track.of_numbers(self._engine.target, self._engine.track) if self._engine else self._track
        self._track, points = self._tracker.step(before, left, right, self._passed_s(numbered.time_ns))
        if self._engine:
            self._engine.track = self._track.numbers
        if self._tally is not None:
            field = TrackedField(self._track, points, (left, right))
            self._tally.add(numbered.n, field, self._tracker.correspondence)
        if self._centres is not None:
            points = self._centres.corrected(points, self._track.xyz_mm)
        return MeasuredField(numbered.n, numbered.time_ns, blobs, points, self._correction)

    def _passed_s(self, time_ns: int) -> float:
        """Time since the previous field; infinite for the first or a backward time, to restart tracking."""
        last_ns, self._last_ns = self._last_ns, time_ns
        return np.inf if last_ns is None or time_ns <= last_ns else (time_ns - last_ns) / 1e9


def single_view_images(
    fields: Iterable[NumberedField],
    points: Mapping[int, Points],
    setup: MeasureSetup,
    before: MarksBefore = lambda _: (),
) -> Iterator[tuple[int, SingleViewImages]]:
    """Images of the targets of each field that have no point, because one view alone sees them.

    Points are those of two views, so an analysis that can use one view's rays locates the fields once more.

    Args:
        fields: of a capture, in order.
        points: measured in them, by the field's number; other fields are left out.
        setup: of the measurement that made the points.
        before: as for `measure_fields`.
    """
    searching: _Searching | None = None
    for numbered, correction in _watched(fields, setup.calibration, before):
        if numbered.n not in points:
            continue
        # Lines of other kinds have different σ of their image coordinates.
        if searching is None or searching.made_for != (numbered.packed.lines, correction):
            searching = _Searching(setup, numbered.packed.lines, correction)
        yield numbered.n, searching.images(numbered, points[numbered.n])


class _Searching:
    """Location and search for fields with the same lines and correction."""

    def __init__(self, setup: MeasureSetup, lines: tuple[int, int], correction: RigCorrection | None) -> None:
        self.made_for = lines, correction
        self._locating = Locating(setup.sized, setup.line_jitter_px)
        self._calibration = correction.applied_to(setup.calibration) if correction else setup.calibration
        rig, model = Rig.of(self._calibration), setup.object_model
        noise = ImageNoise.of(rig, model, setup.line_jitter_px, *lines)
        self._search = SingleViewSearch(Correspondence(rig, model, noise, setup.tracking.correspondence))

    def images(self, numbered: NumberedField, points: Points) -> SingleViewImages:
        blobs = self._locating.blobs(numbered.packed)
        return self._search.images(points, *whole_views(blobs, self._calibration))
