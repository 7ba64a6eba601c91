"""Continuous calibration: marks fixed to the cup show any movement of the rig's images, which is taken off.

The newest quarter second and the newest second are compared with what is in force. What is clearly moved is
followed as soon as the marks stand still again, from the longest stretch in which they did; the correction is
refined while they go on standing still. It is a local field of the calibration, its σ part of that of all
points. All depends on the marks of the fields given and on nothing else, so measuring again gives the same.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.geometry import Calibration, ImageMovement, View
from grabberd.core.measurement.marks import LEAST_PLACES, Located, MarkReference
from grabberd.core.reconstruction.drift_check import MarkState, ViewMarks

EVERY = 6
"""Fields from one comparison to the next: as many of either parity."""
COMPARED = (12, 48)
"""Fields of a comparison: a knock of .1 px is seen in a quarter second, a creep of .02 px in one."""
STRETCHES = (96, 48, 24, 12)
"""Fields of a stretch at rest that a correction is taken from."""
REMEMBERED = STRETCHES[0]
"""Fields before a capture's first whose marks tell where the rig stood when it began."""
PATIENCE = 48
"""Fields after which a rig that does not come to rest is followed all the same."""
LEAST_PX = 0.02
"""Smaller movements do no harm."""
CLEARLY, AS_ONE, HARDLY = 6.5, 3.0, 3.0
"""Standard normal quantiles of what has moved, of marks that do not move as one, of what is not at rest."""
UNMODELLED_PX, UNMODELLED_SHARE = 0.004, 0.002
"""σ of a mark's displacement that does not average, and its share of the displacement: the centre's error
varies with its place between the pixels, mirrors are uneven.
"""
SEEN_SHARE, AREA_SHARE = 0.5, 0.08
"""Least share of a comparison's fields that a mark is to be seen in, and the change of its mean area beyond
which it is partly covered: between the pixels it varies by .025.
"""
_STANDS_OUT = 4.0
"""Ratio of the costs without any other mark and without the one that has come off."""
_ALONE_SHARE = 0.15
"""Share of the other's displacement below which one of two marks has stayed: hardly a turn, which would have
to be about that very mark.
"""
_OF_HOMOGRAPHY = 4
_OF_A_TURN, _OF_ANY_HOMOGRAPHY = (0.001, 0.005, 0.02), (0.06, 0.3, 1.0)
"""Shares of the displacements that show scale, aspect, skew and keystone: a turned camera's distortion, a
turned mirror; and what only four marks determine.
"""
_DIGITS = 4


@dataclass(frozen=True, slots=True, eq=False)
class RigCorrection:
    """Movements that are taken off the images of both views; made anew whenever they change.

    Attributes:
        movements: Of the left and of the right view; None where nothing is corrected.
        states: What the marks of either view say.
        marks: Marks used in either view.
    """

    movements: tuple[ImageMovement | None, ImageMovement | None]
    states: tuple[MarkState, MarkState]
    marks: tuple[int, int]

    @property
    def views(self) -> tuple[ViewMarks, ViewMarks]:
        """In short, of the left and of the right view."""
        left, right = (
            ViewMarks(state, marks, *((movement.size_px, movement.sigma_px) if movement else (0.0, 0.0)))
            for movement, state, marks in zip(self.movements, self.states, self.marks, strict=True)
        )
        return left, right

    @property
    def document(self) -> dict[str, Any]:
        """The correction as a run keeps it: by view, the patterns and what they move the view's middle by."""
        return {
            view: _view_document(movement, state, marks)
            for view, movement, state, marks in zip(
                ("left", "right"), self.movements, self.states, self.marks, strict=True
            )
        }

    @property
    def corrects(self) -> bool:
        """True if anything is taken off."""
        return any(one is not None for one in self.movements)

    def applied_to(self, calibration: Calibration) -> Calibration:
        """The calibration with the movements in its local fields; itself if nothing is corrected."""
        if not self.corrects:
            return calibration
        known = zip(self.movements, calibration.local_fields, strict=True)
        left, right = (own if moved is None else moved.added_to(own) for moved, own in known)
        return replace(calibration, local_fields=(left, right))


def _view_document(movement: ImageMovement | None, state: MarkState, marks: int) -> dict[str, Any]:
    own: dict[str, Any] = {"state": str(state), "marks": marks}
    if movement is None:
        return own
    shift_px, sigma_px = movement.in_the_middle
    pattern_sigma_px = np.sqrt(np.diag(movement.covariance_px2))
    return own | {
        "shift_px": _rounded(shift_px),
        "shift_sigma_px": _rounded(sigma_px),
        "pattern_px": _rounded(movement.pattern_px),
        "pattern_sigma_px": _rounded(pattern_sigma_px),
        "size_px": round(movement.size_px, _DIGITS),
        "sigma_px": round(movement.sigma_px, _DIGITS),
    }


def _rounded(values: Array) -> list[float]:
    rounded: list[float] = np.round(values, _DIGITS).tolist()
    return rounded


class MarkWatch:
    """Follows the marks of both views from field to field."""

    def __init__(self, calibration: Calibration, reference: MarkReference) -> None:
        self._reference = reference
        x_px = reference.place_px[0, :, 0]
        self._own = tuple(
            np.flatnonzero((x_px >= view.first_column - 0.5) & (x_px < view.end_column - 0.5))
            for view in calibration.views
        )
        self._views = tuple(
            _ViewWatch(view, calibration.lines, reference.select(own))
            for view, own in zip(calibration.views, self._own, strict=True)
        )
        self._fields = 0
        self.correction = self._now()

    @classmethod
    def of(cls, calibration: Calibration) -> "MarkWatch | None":
        """Begin with the calibration as it was; None if it has learnt no marks.

        Raises:
            InputError: The calibration's marks are invalid.
        """
        reference = MarkReference.of(calibration)
        return None if reference is None else cls(calibration, reference)

    def see(self, parity: int, marks: Located | None) -> RigCorrection:
        """Take a field's marks; returns the correction in force for it, the same object until it changes."""
        change = self._reference.change(parity, marks)
        for watch, own in zip(self._views, self._own, strict=True):
            watch.add(change[own])
        self._fields += 1
        if self._fields % EVERY == 0:
            changed = [watch.compare() for watch in self._views]
            if any(changed):
                self.correction = self._now()
        return self.correction

    def _now(self) -> RigCorrection:
        left, right = self._views
        return RigCorrection(
            (left.movement, right.movement), (left.state, right.state), (left.marks, right.marks)
        )


class _Mean(NamedTuple):
    """Mean displacement of K marks over some fields.

    Attributes:
        marks: (K,) indices of the marks that are seen often enough.
        displacement_px: (K, 2); `sigma_px`: (K, 2).
    """

    marks: Indices
    displacement_px: Array
    sigma_px: Array

    def without(self, left_out: int) -> "_Mean":
        """The same without one of the marks."""
        kept = np.arange(len(self.marks)) != left_out
        return _Mean(self.marks[kept], self.displacement_px[kept], self.sigma_px[kept])

    def differs(
        self, other: Array, least_px: float, quantile: float, other_sigma_px: Array | float = 0.0
    ) -> bool:
        """True if it differs from other displacements (K, 2) by more than noise and `least_px`."""
        off = self.displacement_px - other
        size_px = np.sqrt((off * off).sum(axis=1).mean())
        squares = (off * off / (self.sigma_px**2 + np.square(other_sigma_px))).sum()
        return bool(size_px > least_px and squares > chi_square(off.size, quantile))


class _ViewWatch:
    """Marks of one view."""

    def __init__(self, view: View, lines: int, reference: MarkReference) -> None:
        self.movement: ImageMovement | None = None
        self.state = MarkState.UNKNOWN
        self.marks = 0
        self._view, self._lines, self._reference = view, lines, reference
        self._places = reference.place_px.mean(axis=0)
        self._seen: deque[Array] = deque(maxlen=STRETCHES[0])
        self._sound = np.ones(len(self._places), np.bool_)
        self._based_on = 0
        self._age = 0
        self._moving = 0

    def add(self, change: Array) -> None:
        """Take the changes (K, 3) of one field, as `MarkReference.change` gives them."""
        self._seen.append(change)
        self._age += 1

    def compare(self) -> bool:
        """Compare the newest fields with what is in force; True if state or correction have changed."""
        before = self.movement, self.state, self.marks
        if len(self._seen) >= COMPARED[0]:
            self._compare()
        return (self.movement, self.state, self.marks) != before

    def _compare(self) -> None:
        # Earlier fields belong to what was in force before.
        means = [self._mean(count) for count in COMPARED if self._age >= count]
        self.marks = len(means[0].marks)
        if self.marks < LEAST_PLACES:
            enough = len(self._places) >= LEAST_PLACES
            self.state = MarkState.HIDDEN if enough else MarkState.UNKNOWN
            return
        means = [one for one in means if len(one.marks) >= LEAST_PLACES]
        if any(one.differs(self._in_force(one.marks), LEAST_PX, CLEARLY) for one in means):
            self._moving += EVERY
            self._follow()
        else:
            self._moving = 0
            self.state = MarkState.AT_REST if self.movement is None else MarkState.CORRECTED
            self._readmit()
            self._refine()

    def _in_force(self, marks: Indices) -> Array:
        if self.movement is None:
            return np.zeros((len(marks), 2))
        return self.movement.at(self._places[marks])

    def _follow(self) -> None:
        """Take over where the marks stand now, once they stand still."""
        stretch = self._longest_at_rest(len(self._seen))
        if stretch is None and self._moving < PATIENCE:
            self.state = MarkState.MOVING
            return
        self._take_over(stretch or STRETCHES[-1])

    def _readmit(self) -> None:
        """Use marks again that have come back to where the others stand: they have dried, or been cleaned."""
        if self._sound.all() or self._age < COMPARED[-1]:
            return
        sound, self._sound = self._sound, np.ones_like(self._sound)
        mean = self._mean(COMPARED[-1])
        sigma_px = mean.sigma_px
        if self.movement is not None:
            sigma_px = np.hypot(sigma_px, self.movement.sigma_at(self._places[mean.marks]))
        agrees = np.abs(mean.displacement_px - self._in_force(mean.marks)) < HARDLY * sigma_px
        sound[mean.marks[agrees.all(axis=1)]] = True
        self._sound = sound

    def _refine(self) -> None:
        """Take a correction from a longer stretch as soon as there is one."""
        if self.movement is None or self._age < 2 * self._based_on or self._based_on >= STRETCHES[0]:
            return
        stretch = self._longest_at_rest(min(self._age, len(self._seen)))
        if stretch is not None and stretch > self._based_on:
            self._take_over(stretch)

    def _longest_at_rest(self, most: int) -> int | None:
        for count in STRETCHES:
            if count <= most and self._is_at_rest(count):
                return count
        return None

    def _is_at_rest(self, count: int) -> bool:
        """True if the marks are, in either half of the newest fields, at the same places."""
        newer, older = self._mean(count // 2), self._mean(count // 2, count // 2)
        if len(newer.marks) < LEAST_PLACES or not np.array_equal(newer.marks, older.marks):
            return False
        return not newer.differs(older.displacement_px, LEAST_PX, HARDLY, older.sigma_px)

    def _take_over(self, stretch: int) -> None:
        mean = self._mean(stretch)
        movement, mean = self._agreeing(mean)
        if movement is None:
            self.state = MarkState.CONTRADICTORY
            return
        self._based_on = self._age = stretch
        self._moving = 0
        self.marks = len(mean.marks)
        moved = mean.differs(np.zeros_like(mean.displacement_px), LEAST_PX, HARDLY)
        self.movement = movement if moved else None
        self.state = MarkState.CORRECTED if moved else MarkState.AT_REST

    def _agreeing(self, mean: _Mean) -> tuple[ImageMovement | None, _Mean]:
        """The movement that all marks agree upon, or all but one, which is left out until it comes back.

        Two marks of a turned view keep their distance, which is one check; each further mark adds two. So two
        and three can only be refused as a whole, four tell which of them has come off.
        """
        movement, count = self._fitted(mean), len(mean.marks)
        if _as_one(movement, count):
            return (None if count == LEAST_PLACES and _one_alone_moved(mean) else movement), mean
        if count < _OF_HOMOGRAPHY:
            return None, mean
        fewer = [mean.without(one) for one in range(count)]
        movements = [self._fitted(one) for one in fewer]
        best, second, *_ = np.argsort([one.cost for one in movements]).tolist()
        stands_out = movements[second].cost > _STANDS_OUT * movements[best].cost
        if _as_one(movements[best], count - 1):
            if not stands_out or movements[second].cost < chi_square(2 * count - 5, CLEARLY):
                return None, mean
            self._sound[mean.marks[best]] = False
            return movements[best], fewer[best]
        # Where no mark has come off, all show a homography that is not that of a turn.
        movement = self._fitted(mean, _OF_ANY_HOMOGRAPHY)
        return (None if stands_out or not _as_one(movement, count) else movement), mean

    def _fitted(self, mean: _Mean, shares: Sequence[float] = _OF_A_TURN) -> ImageMovement:
        given = self._places[mean.marks], mean.displacement_px, mean.sigma_px
        return ImageMovement.fitted(self._view, self._lines, *given, shares)

    def _mean(self, count: int, back: int = 0) -> _Mean:
        """Mean over so many fields, before the newest `back`."""
        end = len(self._seen) - back
        fields = np.array([self._seen[at] for at in range(end - count, end)])
        fields[:, ~self._sound] = np.nan
        seen = np.isfinite(fields[:, :, 0]).sum(axis=0)
        means = np.nansum(fields, axis=0) / np.maximum(seen, 1)[:, np.newaxis]
        marks = np.flatnonzero((seen >= SEEN_SHARE * count) & (np.abs(means[:, 2]) <= AREA_SHARE))
        mean, often = means[marks, :2], seen[marks, np.newaxis]
        scatter = np.nansum((fields[:, marks, :2] - mean) ** 2, axis=0) / np.maximum(often - 1, 1)
        # No less than at calibration: few fields may agree by chance. More where light or signal are worse.
        least = self._reference.sigma_px[marks] ** 2
        single = np.clip(scatter, least, _MOST_NOISE * least)
        unmodelled = UNMODELLED_PX + UNMODELLED_SHARE * np.abs(mean)
        variance = single / often + self._reference.mean_sigma_px[marks] ** 2 + unmodelled**2
        return _Mean(marks, mean, np.sqrt(variance))


_MOST_NOISE = 4.0
"""Largest ratio of variances that is taken for noise rather than for movement within the fields."""


def _as_one(movement: ImageMovement, marks: int) -> bool:
    """True if marks move as those of a turned view."""
    return movement.cost < chi_square(2 * marks - 3, AS_ONE)


def _one_alone_moved(mean: _Mean) -> bool:
    """True if one of two marks has stayed where it was."""
    size_px = np.sqrt((mean.displacement_px**2).sum(axis=1))
    return bool(size_px.min() < _ALONE_SHARE * size_px.max())


def chi_square(degrees: int, quantile: float) -> float:
    """Quantile of χ² at a standard normal quantile (Wilson and Hilferty's cube)."""
    share = 2.0 / (9.0 * degrees)
    return float(degrees * (1.0 - share + quantile * np.sqrt(share)) ** 3)
