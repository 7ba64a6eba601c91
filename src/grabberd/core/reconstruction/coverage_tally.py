"""The count of found and missed targets, field by field.

What costs little is taken from every field: who was found, why the others were not (`Sighting.misses`), and
where they were predicted. What costs more is looked at in some fields only, at first in many of them, then
twice a second: which targets face both views, and which stand off the places where their neighbours put them.
"""

from array import array
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import Calibration, Rig, project_all
from grabberd.core.reconstruction.correspondence.agreement import Sighting
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence
from grabberd.core.reconstruction.correspondence.facing import Facing
from grabberd.core.reconstruction.coverage import Coverage
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.points import Miss, Points, ViewBlobs
from grabberd.core.reconstruction.tracking import Track

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
            own, unconfirmed = self.misses[at], field.unconfirmed
            own[:] = misses
            own[unconfirmed] = np.where(own[unconfirmed] == Miss.FOUND, Miss.UNCONFIRMED, own[unconfirmed])

    def take(self) -> tuple[NDArray[np.int64], list[tuple[int, int, int]]]:
        """Take the misses (B, M) and the rows of lost fields, and make room."""
        taken = self.misses[: self.length], self.lost
        self.length, self.lost = 0, []
        return taken


Counts = NDArray[np.int64]

_REACH = 0.5
"""Share of the pitch within which blobs are sought: beyond, they belong to a neighbour."""


class Offsets:
    """Sums over M targets.

    Attributes:
        looks: (M,) number of fields looked at in which a target was seen, on its place or off it.
    """

    def __init__(self, count: int) -> None:
        self.looks = np.zeros(count, np.int64)
        self._missed, self._off_place = np.zeros((2, count), np.int64)
        self._sum_mm, self._square_mm2 = np.zeros((count, 3)), np.zeros(count)

    def look(
        self,
        sighting: Sighting,
        missed: Mask,
        blobs: tuple[ViewBlobs, ViewBlobs],
        correspondence: Correspondence,
    ) -> None:
        """Add a field: its targets, and those missed ones of which both views show a blob further off."""
        places_mm, _ = correspondence.expected_places(sighting.expected)
        self._missed += missed
        target, off_mm = sighting.target, sighting.points.xyz_mm - places_mm[sighting.target]
        if missed.any():
            further, xyz_mm = self._further(places_mm, missed, blobs, correspondence)
            self._off_place[further] += 1
            target = np.append(target, further)
            off_mm = np.concatenate([off_mm, xyz_mm - places_mm[further]])
        self.looks[target] += 1
        self._sum_mm[target] += off_mm
        self._square_mm2[target] += (off_mm * off_mm).sum(axis=1)

    @staticmethod
    def _further(
        places_mm: Array, missed: Mask, blobs: tuple[ViewBlobs, ViewBlobs], correspondence: Correspondence
    ) -> tuple[Indices, Array]:
        agreement = correspondence.agreement
        wide_mm = min(_REACH * agreement.pitch_mm, agreement.settings.farthest_mm) / agreement.settings.gate
        target, xyz_mm = correspondence.meeting(places_mm, np.full(len(places_mm), wide_mm), *blobs)
        among = missed[target]
        return target[among], xyz_mm[among]

    @property
    def off_place(self) -> Mask:
        """(M,) True for targets that mostly were off their place where they were missed."""
        return (self._off_place > 0) & (2 * self._off_place >= self._missed)

    @property
    def mean_mm(self) -> Array:
        """(M, 3) mean offsets; NaN for targets that were never seen."""
        with np.errstate(invalid="ignore", divide="ignore"):
            mean: Array = self._sum_mm / self.looks[:, np.newaxis]
        return mean

    @property
    def sigma_mm(self) -> Array:
        """(M,) standard deviations of the means in space, from their scatter; NaN below two looks."""
        mean = self.mean_mm
        with np.errstate(invalid="ignore", divide="ignore"):
            scatter = self._square_mm2 / self.looks - (mean * mean).sum(axis=1)
            variance = scatter.clip(0.0) / (self.looks - 1)
        return np.sqrt(np.where(self.looks > 1, variance, np.nan))


_FEW = 0.25
"""Share of the expected targets below which the number of a view's blobs says that it shows nothing."""
_MEET = 0.5
"""Share of the blobs of which another view's must meet the rays if the calibration fits."""


class CoverageTally:
    """Counts over one run."""

    def __init__(self, calibration: Calibration, model: ObjectModel) -> None:
        """Begin before the first field, for a calibration's rig and an object."""
        self._model, rig = model, Rig.of(calibration)
        # (V, 1, 2) corners of each half: the first and last column, and line, of the frame.
        self._low_px = np.array([[[view.first_column - 0.5, -0.5]] for view in rig.views])
        self._high_px = np.array([[[view.end_column - 0.5, calibration.lines - 0.5]] for view in rig.views])
        self._facing = Facing(rig, model)
        # Where nothing is tracked, the object file alone says what should be seen.
        nominal_px = project_all(rig, model.xyz_mm).transpose(1, 2, 0)
        self._nominal_inside = self._inside = self._within(nominal_px, 0.0)
        self._nominal = self._visible = self._facing.both(model.xyz_mm) & self._inside
        self._batch = Batch(len(model))
        self._last: tuple[FieldSeen, Correspondence] | None = None
        self._lost: BothViews | None = None
        self._meet: bool | None = None
        self._counts, self._unexpected = np.zeros((2, len(Miss) * len(model)), np.int64)
        self._offsets = Offsets(len(model))
        self._n, self._field_expected, self._field_found = array("q"), array("q"), array("q")
        self._square_px2, self._points = array("d"), array("q")
        self._variances_px2 = array("d")
        self._corrections: list[tuple[int, Mapping[str, Any]]] = []

    def add(self, n: int, field: FieldSeen, correspondence: Correspondence) -> None:
        """Count a field.

        Args:
            n: Its number.
            field: What was measured in it.
            correspondence: With which it was measured.
        """
        residual_px = field.points.residual_px
        self._n.append(n)
        self._points.append(len(residual_px))
        self._square_px2.append(float(np.vdot(residual_px, residual_px)))
        self._batch.add(field)
        self._last = field, correspondence
        if field.misses is None:
            self._note_lost(field)
        if self._batch.length >= min(len(self._n) // 2 + 1, MOST_AT_ONCE):
            track = field.track
            self._count(track, correspondence)
            if track.sighting is not None:
                self._look(track.sighting, field.halves, correspondence)

    def correct(self, n: int, correction: Mapping[str, Any]) -> None:
        """Note a correction of the rig from field `n` on, as its document."""
        self._corrections.append((n, correction))

    def _note_lost(self, field: FieldSeen) -> None:
        """Keep the blobs of a field in which nothing was identified, if both views show any."""
        if min(field.counts):
            self._lost = field.halves

    def result(self) -> Coverage:
        """Coverage of the fields so far."""
        if self._batch.length and self._last:
            field, correspondence = self._last
            self._count(field.track, correspondence)
        misses = self._reasoned(self._counts.reshape(len(Miss), -1).T)
        points, square_px2 = np.array(self._points, np.int64), np.array(self._square_px2)
        with np.errstate(invalid="ignore", divide="ignore"):
            field_residual_px = np.sqrt(square_px2 / points)
            residual_px = float(np.sqrt(square_px2.sum() / points.sum()))
            # A parallax p leaves p/√8 of residual, as in `Correspondence`.
            typical_px = float(np.sqrt(np.mean(self._variances_px2) / 8.0)) if self._variances_px2 else np.nan
        return Coverage(
            target=self._model.target,
            expected=misses.sum(axis=1),
            misses=misses,
            unexpected=self._unexpected.reshape(len(Miss), -1).T.copy(),
            offset_mm=self._offsets.mean_mm,
            offset_sigma_mm=self._offsets.sigma_mm,
            looks=self._offsets.looks.copy(),
            n=np.array(self._n, np.int64),
            field_expected=np.array(self._field_expected, np.int64),
            field_found=np.array(self._field_found, np.int64),
            field_residual_px=field_residual_px,
            residual_px=residual_px,
            residual_sigma=residual_px / typical_px,
            corrections=tuple(self._corrections),
        )

    def _reasoned(self, misses: Counts) -> Counts:
        """The misses (M, reasons), in which a target off its place is not said to have no blob there."""
        misses = misses.copy()
        own = self._offsets.off_place
        unseen = slice(Miss.NO_BLOB_LEFT, Miss.NO_BLOB + 1)
        misses[own, Miss.OFF_PLACE] += misses[own, unseen].sum(axis=1)
        misses[own, unseen] = 0
        return misses

    def _count(self, track: Track, correspondence: Correspondence) -> None:
        misses, lost = self._batch.take()
        self._meet = None
        visible, inside = self._nominal, self._nominal_inside
        if track.sighting is not None:
            # Those that turn away or leave meanwhile are not expected: how long they were seen is not known.
            before, self._visible = self._visible, self._seen(track, track.sighting)
            visible, inside = before & self._visible, self._inside
            self._refine(misses, track.sighting, correspondence)
        for at, *number in lost:
            misses[at] = self._of_lost(number, correspondence)
        found = misses == Miss.FOUND
        expected = np.broadcast_to(visible, found.shape) & (misses < Miss.CROWDED)
        rows = [at for at, *_ in lost]
        expected[rows] = self._nominal
        missed = ~found & expected
        per_field = found.sum(axis=1)
        self._field_found.extend(per_field.tolist())
        self._field_expected.extend((per_field + missed.sum(axis=1)).tolist())
        self._counts[: len(self._model)] += found.sum(axis=0)
        self._add(self._counts, missed, misses)
        why = np.where(inside, int(Miss.TURNED_AWAY), int(Miss.OUTSIDE))
        self._add(self._unexpected, ~found & ~expected, np.where(misses < Miss.CROWDED, why, misses))

    @staticmethod
    def _add(counts: Counts, chosen: Mask, misses: Counts) -> None:
        field, target = np.nonzero(chosen)
        of_target = misses[field, target] * chosen.shape[1] + target
        counts += np.bincount(of_target, minlength=len(counts))

    def _seen(self, track: Track, sighting: Sighting) -> Mask:
        """(M,) True for targets that both views see now, found or not."""
        assert sighting.predicted_px is not None
        sigma_mm = sighting.expected.sigma_mm.copy()
        sigma_mm[sighting.target] = 0.0
        self._inside = self._within(sighting.predicted_px, 0.0)
        return self._facing.both(track.xyz_mm, sigma_mm) & self._inside

    def _refine(self, misses: Counts, sighting: Sighting, correspondence: Correspondence) -> None:
        """Say why no blob was near the predicted image, where that is known better."""
        assert sighting.predicted_px is not None
        judge = correspondence.agreement
        vague = sighting.expected.sigma_mm > judge.settings.trust * judge.pitch_mm
        cut_off = ~self._within(sighting.predicted_px, correspondence.noise.radius_lines)
        for own, reason in ((vague, Miss.UNPREDICTED), (cut_off, Miss.CUT_OFF)):
            target = np.flatnonzero(own)
            if len(target):
                some = misses[:, target]
                some[(some > Miss.FOUND) & (some <= Miss.NO_BLOB)] = reason
                misses[:, target] = some

    def _of_lost(self, number: list[int], correspondence: Correspondence) -> Miss:
        """Reason why no target was identified in a field with these numbers of blobs in its views."""
        few = max(_FEW * np.count_nonzero(self._nominal), 1.0)
        if dark := (number[0] < few) * Miss.NO_BLOB_LEFT + (number[1] < few) * Miss.NO_BLOB_RIGHT:
            return Miss(dark)
        if self._meet is None and self._lost is not None:
            self._meet = correspondence.meeting_share(*self._lost) >= _MEET
        return Miss.NOT_IDENTIFIED if self._meet else Miss.RAYS_APART

    def _look(self, sighting: Sighting, blobs: BothViews, correspondence: Correspondence) -> None:
        assert sighting.misses is not None
        missed = self._visible & (sighting.misses != Miss.FOUND) & (sighting.misses < Miss.CROWDED)
        self._offsets.look(sighting, missed, blobs, correspondence)
        unmodelled_px = correspondence.settings.unmodelled_px
        located = sum(float(np.mean(view.sigma_px[:, 1] ** 2)) for view in blobs)
        self._variances_px2.append(located + 2.0 * unmodelled_px**2)

    def _within(self, images_px: Array, margin_px: float) -> Mask:
        """(…, M) True for images (…, V, M, 2) that lie in their half of the picture in every view."""
        low, high = self._low_px + margin_px, self._high_px - margin_px
        inside = (images_px >= low) & (images_px < high)
        return np.logical_and.reduce(inside, axis=(-1, -3))
