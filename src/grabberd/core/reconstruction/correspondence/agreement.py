"""Hypotheses about which blobs are which target, their agreement, and the sighting that remains.

Hypotheses are pairs of blobs that may be a target, as far as rays and object model allow; they agree with one
another where neighbouring targets move alike.
"""

from dataclasses import dataclass, field, fields

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import Rig, approach, rays
from grabberd.core.kernel import KERNEL, Kernel
from grabberd.core.reconstruction.correspondence.displacement_field import Expected, Smoothness, field_of
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.points import ImageNoise, Points, ViewBlobs, intersect


@dataclass(frozen=True, slots=True)
class CorrespondenceSettings:
    """Limits within which a correspondence is accepted.

    Attributes:
        farthest_mm: Greatest distance of a target from its nominal position.
        gate: Greatest deviation from an expected position, in standard deviations.
        margin: Difference of χ² by which the next best hypothesis must be worse.
        trust: Share of the pitch to which the others must predict a target for it to be identified.
        stretch: Greatest relative change of the distance between neighbours.
        unmodelled_px: σ of picture errors that the calibration does not describe (local errors of the
            mirrors).
        smoothness: Smoothness of the object's deformation, as assumed where it alone tells targets apart.
        following: The same, as assumed near positions predicted from earlier fields. The outermost columns of
            a closed liner move otherwise than their neighbours tell; here that excludes no target.
    """

    farthest_mm: float = 9.0
    gate: float = 3.7
    margin: float = 6.0
    trust: float = 0.2
    stretch: float = 0.35
    unmodelled_px: float = 0.1
    smoothness: Smoothness = field(default_factory=Smoothness)
    following: Smoothness = field(default_factory=lambda: Smoothness(sigma_mm=5.0, reach_mm=25.0))


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """H hypotheses, by ascending target: a left and a right blob are the images of a target.

    Attributes:
        target: (H,) indices into the object model.
        left: (H,) indices of blobs in the left view.
        right: (H,) indices of blobs in the right view.
        displacement_mm: (H, 3) meeting point of the blobs' rays, relative to the target's nominal position.
        variance_mm2: (H, 3) variance of that point in X, Y and Z.
    """

    target: Indices
    left: Indices
    right: Indices
    displacement_mm: Array
    variance_mm2: Array

    def __len__(self) -> int:
        return len(self.target)

    def select(self, chosen: Mask | Indices) -> "Hypotheses":
        """Select hypotheses by a mask or index array."""
        return Hypotheses(*(getattr(self, one.name)[chosen] for one in fields(self)))


def hypotheses(
    rig: Rig,
    model: ObjectModel,
    blobs: tuple[ViewBlobs, ViewBlobs],
    noise: ImageNoise,
    settings: CorrespondenceSettings,
) -> Hypotheses:
    """List every pair of blobs whose rays meet, for every target nominally near their meeting point.

    Args:
        rig: Left and right view.
        model: The object.
        blobs: Blobs of the left and the right view, with all their uncertainty in σ.
        noise: Line jitter, and the scale at the object.
        settings: Greatest distance between rays, and of a target from its nominal position.
    """
    # Every pair that meets: on a regular grid the rays alone leave only 16 of 108 pairs without a rival.
    left, right = _pairs(rig, *blobs, settings.gate * line_mm(model, noise))
    number = np.arange(len(left), dtype=np.int32)
    met = intersect(rig, number, blobs[0].select(left), blobs[1].select(right), noise)
    apart = met.xyz_mm - model.xyz_mm[:, np.newaxis]
    target, pair = np.nonzero((apart * apart).sum(axis=2) <= settings.farthest_mm**2)
    variance = np.diagonal(met.covariance_mm2, axis1=1, axis2=2)
    return Hypotheses(target, left[pair], right[pair], apart[target, pair], variance[pair])


def line_mm(model: ObjectModel, noise: ImageNoise) -> float:
    """Size of a frame line at the object."""
    return 0.5 * model.target_diameter_mm / noise.radius_lines


def meeting_share(rig: Rig, blobs: tuple[ViewBlobs, ViewBlobs], gate_mm: float) -> float:
    """Share of the blobs of the view with fewer whose rays meet any of the other view.

    Args:
        rig: Left and right view.
        blobs: Blobs of the left and the right view, with all their uncertainty in σ.
        gate_mm: Greatest distance of two rays, per pixel of σ in y.
    """
    few = int(len(blobs[1]) < len(blobs[0]))
    own = _pairs(rig, *blobs, gate_mm)[few]
    return len(np.unique(own)) / max(len(blobs[few]), 1)


def _pairs(rig: Rig, left: ViewBlobs, right: ViewBlobs, gate_mm: float) -> tuple[Indices, Indices]:
    """Indices of pairs whose rays pass each other within `gate_mm` per pixel of σ in y."""
    left_center, from_left = rays(rig.views[0], left.xy_px)
    right_center, from_right = rays(rig.views[1], right.xy_px)
    met = approach(left_center, from_left[:, np.newaxis], right_center, from_right)
    sigma_px = np.hypot(left.sigma_px[:, np.newaxis, 1], right.sigma_px[:, 1])
    in_left, in_right = np.nonzero(np.abs(met.distance_mm) <= gate_mm * sigma_px)
    return in_left, in_right


_MOST_STARTS = 3
_LEAST_SUPPORT = 3
"""Neighbours that must agree with a hypothesis for growth to start from it."""
_AROUND = 1.6
"""Distance of supporting neighbours in pitches: the eight around a target of a square grid."""
_TORN = 1e6
"""χ² of a hypothesis that would tear the grid: it is dropped before any other."""
_SUREST_FIRST = (0.4, 0.6, 1.0)
"""Shares of `trust`, in order: growth crosses a gap only when no nearer target is left."""


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """K targets found in one field, by ascending target.

    Attributes:
        points: Their points.
        target: (K,) their indices in the object model.
        left: (K,) indices of their blobs in the left view.
        right: (K,) indices of their blobs in the right view.
        expected: Prediction of all targets of the model from them.
        settled: (M, 3) positions of all targets and (M,) standard deviations, if already computed.
        surprise: Root mean square distance from the predicted positions, in standard deviations; likewise.
        misses: (M,) `Miss` of every target of the model; None if nothing was predicted.
        predicted_px: (V, M, 2) predicted images of all targets, frame pixels; likewise.
    """

    points: Points
    target: Indices
    left: Indices
    right: Indices
    expected: Expected
    settled: tuple[Array, Array] | None = None
    surprise: float | None = None
    misses: Indices | None = None
    predicted_px: Array | None = None

    def __len__(self) -> int:
        return len(self.target)


class Agreement:
    """Judges which hypotheses about one object are consistent.

    Attributes:
        model: The object.
        settings: Limits of acceptance.
        field: Smooth field of the targets' displacements.
        pitch_mm: Median distance of neighbours; infinite if there are none.
    """

    def __init__(
        self,
        model: ObjectModel,
        settings: CorrespondenceSettings,
        smoothness: Smoothness | None = None,
        kernel: Kernel | None = KERNEL,
    ) -> None:
        self.model = model
        self.settings = settings
        self._neighbours = model.neighbours()
        self._apart_mm = _lengths(model.xyz_mm, self._neighbours)
        self.pitch_mm = _median(self._apart_mm)
        self.field = field_of(model, smoothness or settings.smoothness, self.pitch_mm, kernel)

    @property
    def pairs(self) -> tuple[Indices, Array]:
        """(K, 2) indices of neighbours, and (K,) their nominal distances in mm."""
        return self._neighbours, self._apart_mm

    def largest(self, known: Hypotheses) -> Indices:
        """Find the largest set of hypotheses that agree, growing from the most certain.

        Growth from one start explains most others; from those that it contradicts another growth may start,
        and the largest wins: a grid shifted by a pitch loses a row or a column.

        Args:
            known: Hypotheses, of which several may contradict each other about a target or a blob.

        Returns:
            (K,) indices, by ascending target, of hypotheses with distinct targets and blobs; empty if nothing
            agrees.
        """
        best = np.empty(0, np.intp)
        starts = self._starts(known)
        for _ in range(_MOST_STARTS):
            if not len(starts):
                break
            agreeing = self._agreeing(known, starts[:1])
            best = max(best, agreeing, key=lambda chosen: _worth(known, chosen))
            against = _far(known, self._expected(known, agreeing)) > self.settings.gate**2
            starts = starts[1:][against[starts[1:]]]
        return np.sort(best)

    def consistent(self, known: Hypotheses, chosen: Indices) -> tuple[Indices, Expected]:
        """Drop chosen hypotheses that the others contradict, the worst first.

        Args:
            known: Hypotheses.
            chosen: (K,) indices of some of them, with distinct targets and blobs.

        Returns:
            Indices of those that remain, and the positions that they imply for all targets.
        """
        while True:
            expected = self._expected(known, chosen)
            far = _far(known, expected)[chosen] + _TORN * self._torn(known, chosen)
            if not (far > self.settings.gate**2).any():
                return chosen, expected
            chosen = np.delete(chosen, far.argmax())

    def _starts(self, known: Hypotheses) -> Indices:
        """Hypotheses to start from, the most certain first: near nominal, and supported by neighbours."""
        away = np.linalg.norm(known.displacement_mm, axis=1)
        near = np.flatnonzero(away <= 0.5 * self.pitch_mm)
        few = known.select(near)
        agree = _between(few.displacement_mm) <= self.settings.trust * self.pitch_mm
        agree &= _between(self.model.xyz_mm[few.target]) <= _AROUND * self.pitch_mm
        for own in (few.target, few.left, few.right):
            agree &= own[:, np.newaxis] != own
        supported = near[agree.sum(axis=1) >= _LEAST_SUPPORT]
        return supported[np.argsort(away[supported], kind="stable")]

    def _agreeing(self, known: Hypotheses, start: Indices) -> Indices:
        """Hypotheses that agree with a start and with one another: grown, checked, and grown again."""
        allowed = np.ones(len(known), np.bool_)
        chosen = start
        while True:
            grown = self._grown(known, chosen, allowed)
            chosen, _ = self.consistent(known, grown)
            if len(chosen) == len(grown):
                return chosen
            allowed[np.setdiff1d(grown, chosen, assume_unique=True)] = False

    def _grown(self, known: Hypotheses, chosen: Indices, allowed: Mask) -> Indices:
        """Add, wave by wave, hypotheses predicted well enough by the chosen ones; the most certain first."""
        while more := self._wave(known, chosen, allowed):
            chosen = np.append(chosen, more)
        return chosen

    def _wave(self, known: Hypotheses, chosen: Indices, allowed: Mask) -> list[int]:
        expected = self._expected(known, chosen)
        far = _far(known, expected)
        free = allowed & (far <= self.settings.gate**2)
        for own in (known.target, known.left, known.right):
            free &= ~np.isin(own, own[chosen])
        sigma_mm = expected.sigma_mm[known.target]
        for share in _SUREST_FIRST:
            sure = free & (sigma_mm <= share * self.settings.trust * self.pitch_mm)
            if more := _undoubted(known, far, np.flatnonzero(sure), self.settings.margin):
                return more
        return []

    def _torn(self, known: Hypotheses, chosen: Indices) -> Mask:
        """Mark chosen hypotheses that are too near to a neighbour or too far from it."""
        xyz_mm = np.full_like(self.model.xyz_mm, np.nan)
        target = known.target[chosen]
        xyz_mm[target] = self.model.xyz_mm[target] + known.displacement_mm[chosen]
        off = np.abs(_lengths(xyz_mm, self._neighbours) - self._apart_mm)
        torn = np.zeros(len(xyz_mm), np.bool_)
        torn[self._neighbours[off > self.settings.stretch * self._apart_mm]] = True
        return torn[target]

    def _expected(self, known: Hypotheses, chosen: Indices) -> Expected:
        chosen = np.sort(chosen)  # so are their targets
        return self.field.expect(known.target[chosen], known.displacement_mm[chosen])


def _far(known: Hypotheses, expected: Expected) -> Array:
    """(H,) χ² of every hypothesis against the expected position of its target."""
    off = known.displacement_mm - expected.displacement_mm[known.target]
    variance = known.variance_mm2 + expected.sigma_mm[known.target, np.newaxis] ** 2
    return (off * off / variance).sum(axis=1)


def _undoubted(known: Hypotheses, far: Array, free: Indices, margin: float) -> list[int]:
    """Best hypotheses whose runner-up for the same target is clearly worse; each blob once."""
    order = free[np.argsort(far[free], kind="stable")]
    best: dict[int, int] = {}
    doubtful: set[int] = set()
    for index in order.tolist():
        first = best.setdefault(int(known.target[index]), index)
        if first != index and far[index] - far[first] < margin:
            doubtful.add(first)
    chosen: list[int] = []
    taken: set[tuple[str, int]] = set()
    for index in best.values():
        own = {("left", int(known.left[index])), ("right", int(known.right[index]))}
        if index not in doubtful and not own & taken:
            chosen.append(index)
            taken |= own
    return chosen


def _worth(known: Hypotheses, chosen: Indices) -> tuple[int, float]:
    """Rank by number of targets, then by smaller displacements."""
    return len(chosen), -float((known.displacement_mm[chosen] ** 2).sum())


def _median(values: Array) -> float:
    """Upper median (of four values the second largest); np.median would import numpy.ma."""
    return float(np.sort(values)[len(values) // 2]) if len(values) else np.inf


def _between(xyz_mm: Array) -> Array:
    return np.linalg.norm(xyz_mm[:, np.newaxis] - xyz_mm, axis=2)


def _lengths(xyz_mm: Array, pairs: Indices) -> Array:
    return np.linalg.norm(xyz_mm[pairs[:, 0]] - xyz_mm[pairs[:, 1]], axis=1)
