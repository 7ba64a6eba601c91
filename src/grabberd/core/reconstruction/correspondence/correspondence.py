"""Correspondence of blobs in the left and right view with targets, decided by prior knowledge (paper 3.7).

On a regular grid the epipolar geometry alone is ambiguous, so the object model decides. Identification starts
from the most certain hypothesis and grows over the object: targets already identified predict the others,
with σ, because neighbours move alike. Doubtful targets are left out; a wrong target is worse than a missing
one. From field to field the blobs near predicted images are assigned; targets that one view alone sees have
an image, but no point.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import Rig, linearise
from grabberd.core.kernel import KERNEL, Kernel
from grabberd.core.reconstruction.correspondence.agreement import (
    Agreement,
    CorrespondenceSettings,
    Hypotheses,
    Sighting,
    hypotheses,
    line_mm,
    meeting_share,
)
from grabberd.core.reconstruction.correspondence.compiled_search import Identification, Nearby, takes
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField, Expected
from grabberd.core.reconstruction.correspondence.facing import Facing
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.points import (
    ImageNoise,
    Miss,
    Points,
    SingleViewImages,
    ViewBlobs,
    intersect,
)

NO_BLOB_NEAR, BLOB_TAKEN = -1, -2
"""In place of a blob: none is near, or the nearest serves another target."""
FEW_PAIRS = 1 << 15
"""Number of target–blob pairs up to which comparing all is faster than finding those near each other."""


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Predicted images of M targets in V views.

    Attributes:
        image_px: (2, V, M) predicted images, frame pixels x and y; infinite behind a camera.
        reach_px: (2, V, M) greatest distance from there at which they may appear.
        unseen: (V, M) of `Facing.unseen`; None where every view may show them all.
    """

    image_px: Array
    reach_px: Array
    unseen: Indices | None = None

    @classmethod
    def of(
        cls,
        rig: Rig,
        places_mm: Array,
        sigma_mm: Array,
        sigma_px: Array | float,
        gate: float,
        facing: Facing | None = None,
    ) -> "Prediction":
        """Predict images from positions and their uncertainty.

        Args:
            rig: The views.
            places_mm: (M, 3) predicted positions.
            sigma_mm: (M,) their standard deviation in each coordinate.
            sigma_px: Standard deviation of a blob's image; broadcasts against (2, V, M).
            gate: Greatest deviation of a target, in standard deviations.
            facing: Tells which targets a view cannot show; None if there is nothing to tell it by.
        """
        image, slopes = linearise(rig, places_mm)
        reach = gate * np.hypot(np.sqrt((slopes * slopes).sum(axis=2)) * sigma_mm, sigma_px)
        before = np.isfinite(image)
        unseen = None if facing is None else facing.unseen(places_mm, image)
        return cls(np.where(before, image, np.inf), np.where(before, reach, 1.0), unseen)

    def select(self, chosen: Indices) -> "Prediction":
        """Select targets by indices."""
        unseen = None if self.unseen is None else self.unseen[:, chosen]
        return Prediction(self.image_px[:, :, chosen], self.reach_px[:, :, chosen], unseen)

    def misses(self, of_left: Indices, of_right: Indices) -> Indices:
        """(M,) `Miss` of each target by its blobs in both views, as `nearest` gives them."""
        misses = (of_left < 0) * int(Miss.NO_BLOB_LEFT) + (of_right < 0) * int(Miss.NO_BLOB_RIGHT)
        misses[np.minimum(of_left, of_right) == BLOB_TAKEN] = Miss.TAKEN
        if self.unseen is None:
            return misses
        unseen = self.unseen.max(axis=0)
        return np.where((unseen > Miss.CROWDED) | (misses == Miss.FOUND), unseen, misses)

    def nearest(self, view: int, xy_px: Array) -> Indices:
        """Assign a blob to each target: (M,) indices, −1 for none, −2 where the nearest serves another.

        A blob is assigned to a target if it lies within reach of the predicted image and each is the other's
        nearest, measured in units of the reach.

        Args:
            view: Index of the view.
            xy_px: (N, 2) blobs of that view.
        """
        image, reach = self.image_px[:, view], self.reach_px[:, view]
        if self.unseen is not None:
            # Merged ones, too, keep others from their blobs.
            image = np.where(np.isin(self.unseen[view], (Miss.TURNED_AWAY, Miss.HIDDEN)), np.inf, image)
        if not (len(xy_px) and image.shape[1]):
            return np.full(image.shape[1], NO_BLOB_NEAR)
        return (_of_all if image.shape[1] * len(xy_px) <= FEW_PAIRS else _of_those_beside)(
            image, reach, xy_px.T
        )


def _of_all(image: Array, reach: Array, blobs: Array) -> Indices:
    """Compare every target (2, M) with every blob (2, N)."""
    off = blobs[:, np.newaxis] - image[:, :, np.newaxis]
    off *= 1.0 / reach[:, :, np.newaxis]
    off *= off
    away = off[0] + off[1]
    targets = np.arange(image.shape[1])
    blob = away.argmin(axis=1)
    within, own = away[targets, blob] <= 1.0, away.argmin(axis=0)[blob] == targets
    return np.where(within & own, blob, np.where(within, BLOB_TAKEN, NO_BLOB_NEAR))


def _of_those_beside(image: Array, reach: Array, blobs: Array) -> Indices:
    """Do the same in time linear in the number of targets."""
    target, blob = _beside(image, reach, blobs)
    off = (blobs[:, blob] - image[:, target]) * (1.0 / reach[:, target])
    away = (off * off).sum(axis=0)
    within = np.flatnonzero(away <= 1.0)
    target, blob, away = target[within], blob[within], away[within]
    both = _least(away, target, blob), _least(away, blob, target)
    mutual = np.intersect1d(*both, assume_unique=True)
    assigned = np.full(image.shape[1], NO_BLOB_NEAR)
    assigned[target] = BLOB_TAKEN
    assigned[target[mutual]] = blob[mutual]
    return assigned


def _beside(image: Array, reach: Array, blobs: Array) -> tuple[Indices, Indices]:
    """Targets (P,) and blobs (P,) of all pairs that may be within reach, and some more.

    Blobs are sorted into cells the size of the farthest reach, so that a target's candidates are in nine
    cells.

    Args:
        image: (2, M) predicted images of the targets.
        reach: (2, M) their reach.
        blobs: (2, N) their positions, frame pixels.
    """
    targets = np.flatnonzero(np.isfinite(image).all(axis=0))
    if not (len(targets) and blobs.shape[1]):
        return np.empty(0, np.intp), np.empty(0, np.intp)
    first = blobs.min(axis=1, keepdims=True)
    extent = np.maximum(np.ptp(blobs, axis=1, keepdims=True), 1.0)
    # Not below a 1024th of the extent, or a tiny reach would make millions of cells.
    cell = np.maximum(reach[:, targets].max(axis=1, keepdims=True), extent / 1024)
    columns, rows = (int(one) + 1 for one in (extent / cell)[:, 0])
    x, y = ((blobs - first) / cell).astype(np.int64)
    order = (y * columns + x).argsort(kind="stable")
    key = (y * columns + x)[order]
    at = np.floor((image[:, targets] - first) / cell).clip(-2, [[columns + 1], [rows + 1]]).astype(np.int64)
    parts = []
    for row in (at[1] - 1, at[1], at[1] + 1):
        low, high = (at[0] - 1).clip(0, columns), (at[0] + 1).clip(-1, columns - 1)
        inside = (row >= 0) & (row < rows) & (low <= high)
        begin = key.searchsorted(row * columns + low)
        number = np.where(inside, key.searchsorted(row * columns + high, side="right") - begin, 0)
        index = np.arange(int(number.sum())) - np.repeat(number.cumsum() - number - begin, number)
        parts.append((np.repeat(targets, number), order[index]))
    target, blob = (np.concatenate(some) for some in zip(*parts, strict=True))
    return target, blob


def _least(away: Array, own: Indices, other: Indices) -> Indices:
    """Nearest pair for each `own`; among equally near ones that with the first `other`."""
    order = np.lexsort((other, away, own))
    is_first = np.append(True, own[order][1:] != own[order][:-1])[: len(order)]
    return order[is_first]


class Correspondence:
    """Correspondence of blobs and targets, for one object seen by one rig.

    Attributes:
        rig: Left and right view.
        model: The object.
        noise: Line jitter, and the scale at the object.
        settings: Limits of acceptance.
        agreement: Judge of hypotheses where nothing else tells targets apart.
        following: Judge of hypotheses near positions predicted from earlier fields.
        identification: Identification by the kernel; None if it does not cover the rig or the object.
    """

    def __init__(
        self,
        rig: Rig,
        model: ObjectModel,
        noise: ImageNoise,
        settings: CorrespondenceSettings | None = None,
        kernel: Kernel | None = KERNEL,
    ) -> None:
        self.rig = rig
        self.model = model
        self.noise = noise
        self.settings = settings or CorrespondenceSettings()
        self.agreement = Agreement(model, self.settings, kernel=kernel)
        self.following = Agreement(model, self.settings, self.settings.following, kernel)
        self._facing = Facing(rig, model, noise.radius_lines)
        self._nearby: dict[Agreement, Nearby] = {}
        self.identification: Identification | None = None
        if kernel and takes(rig):
            if isinstance(self.agreement.field, DisplacementField):
                self.identification = Identification(kernel, rig, self.agreement, noise)
            self._nearby = {
                judge: Nearby(kernel, rig, judge, noise) for judge in (self.agreement, self.following)
            }

    def identify(self, left: ViewBlobs, right: ViewBlobs) -> Sighting:
        """Identify the targets seen in both views, independently of earlier fields.

        Args:
            left: Blobs of the left view, targets and others, in any order.
            right: Blobs of the right view.

        Returns:
            All targets identified beyond doubt; none if nothing agrees with the object model.
        """
        blurred = self._blurred(left), self._blurred(right)
        expected = (self.identification or self).expected(*blurred)
        if expected is None:
            none = np.empty(0, np.intp)
            return self._sight(self.agreement, none, none, none, left, right)
        sighting = self._near(self.agreement, *self.expected_places(expected), left, right)
        # What is cautious about telling targets apart would be rash about where to look for the others.
        return replace(sighting, expected=self._foreseen(sighting), settled=None)

    def expected(self, left: ViewBlobs, right: ViewBlobs) -> Expected | None:
        """Prediction of all targets from the largest set of pairs of blobs that agree; None if none do.

        Args:
            left: Blobs of the left view, with all their uncertainty in σ.
            right: Blobs of the right view, likewise.
        """
        known = hypotheses(self.rig, self.model, (left, right), self.noise, self.settings)
        grown = self.agreement.largest(known)
        return self.agreement.consistent(known, grown)[1] if len(grown) else None

    def near(self, places_mm: Array, sigma_mm: Array, left: ViewBlobs, right: ViewBlobs) -> Sighting:
        """Find the targets seen in both views near their expected positions.

        Args:
            places_mm: (M, 3) expected position of every target of the model.
            sigma_mm: (M,) its standard deviation in each coordinate.
            left: Blobs of the left view, targets and others, in any order.
            right: Blobs of the right view.
        """
        return self._near(self.following, places_mm, sigma_mm, left, right)

    def _foreseen(self, sighting: Sighting) -> Expected:
        """Prediction of all targets from those of a sighting, for the next field."""
        displacement_mm = sighting.points.xyz_mm - self.model.xyz_mm[sighting.target]
        return self.following.field.expect(sighting.target, displacement_mm)

    def _near(
        self, judge: Agreement, places_mm: Array, sigma_mm: Array, left: ViewBlobs, right: ViewBlobs
    ) -> Sighting:
        if judge in self._nearby:
            return self._nearby[judge].near(places_mm, sigma_mm, left, right)
        predicted = self.predict(places_mm, sigma_mm, self._typical_px(left, right))
        of_left, of_right = (predicted.nearest(i, view.xy_px) for i, view in enumerate((left, right)))
        misses = predicted.misses(of_left, of_right)
        target = np.flatnonzero((misses == Miss.FOUND) | (misses == Miss.CROWDED))
        found = self._sight(
            judge, target, of_left[target], of_right[target], left, right, places_mm[target], misses
        )
        return replace(found, misses=misses, predicted_px=predicted.image_px.transpose(1, 2, 0))

    def meeting(
        self, places_mm: Array, sigma_mm: Array, left: ViewBlobs, right: ViewBlobs
    ) -> tuple[Indices, Array]:
        """Find blobs near the expected positions whose rays meet, whether they agree with the others or not.

        Args:
            places_mm: (M, 3) expected position of every target of the model.
            sigma_mm: (M,) its standard deviation in each coordinate.
            left: Blobs of the left view.
            right: Blobs of the right view.

        Returns:
            (K,) indices of their targets in the object model, and (K, 3) the points where the rays meet.
        """
        if self.following in self._nearby:
            return self._nearby[self.following].meeting(places_mm, sigma_mm, left, right)
        predicted = self.predict(places_mm, sigma_mm, self._typical_px(left, right))
        of_left, of_right = (predicted.nearest(i, view.xy_px) for i, view in enumerate((left, right)))
        misses = predicted.misses(of_left, of_right)
        target = np.flatnonzero((misses == Miss.FOUND) | (misses == Miss.CROWDED))
        left, right = left.select(of_left[target]), right.select(of_right[target])
        points = intersect(self.rig, self.model.target[target], left, right, self.noise, places_mm[target])
        meeting = points.residual_px <= self._across_px(left, right)
        return target[meeting], points.xyz_mm[meeting]

    def meeting_share(self, left: ViewBlobs, right: ViewBlobs) -> float:
        """Share of the blobs of the view with fewer whose rays meet any of the other view."""
        gate_mm = self.settings.gate * line_mm(self.model, self.noise)
        return meeting_share(self.rig, (self._blurred(left), self._blurred(right)), gate_mm)

    def expected_places(self, expected: Expected) -> tuple[Array, Array]:
        """Expected positions (M, 3) in mm, and their standard deviations (M,)."""
        return self.model.xyz_mm + expected.displacement_mm, expected.sigma_mm

    def predict(self, places_mm: Array, sigma_mm: Array, sigma_px: Array | float) -> Prediction:
        """Predict the images of targets expected at these positions (M, 3)."""
        return Prediction.of(self.rig, places_mm, sigma_mm, sigma_px, self.settings.gate, self._facing)

    def _sight(
        self,
        judge: Agreement,
        target: Indices,
        of_left: Indices,
        of_right: Indices,
        left: ViewBlobs,
        right: ViewBlobs,
        start_mm: Array | None = None,
        misses: Indices | None = None,
    ) -> Sighting:
        """Intersect targets, dropping those whose rays miss each other or that contradict the others.

        The reasons are entered in `misses` (M,).
        """
        left, right = left.select(of_left), right.select(of_right)
        points = intersect(self.rig, self.model.target[target], left, right, self.noise, start_mm)
        blurring = self._blurring(left, right)
        meeting = np.flatnonzero(points.residual_px <= self._across_px(left, right))
        variance = np.diagonal(points.covariance_mm2, axis1=1, axis2=2) * blurring[:, np.newaxis]
        displacement = points.xyz_mm - self.model.xyz_mm[target]
        known = Hypotheses(target, of_left, of_right, displacement, variance)
        chosen, expected = judge.consistent(known, meeting)
        if misses is not None:
            own = misses[target[chosen]]
            misses[target] = Miss.RAYS_APART
            misses[target[meeting]] = Miss.OFF_PLACE
            misses[target[chosen]] = own
        return Sighting(points.select(chosen), target[chosen], of_left[chosen], of_right[chosen], expected)

    def _across_px(self, left: ViewBlobs, right: ViewBlobs) -> Array:
        """(N,) greatest residual of N pairs whose rays meet."""
        # A parallax p leaves p/2 in either view, whose root mean square over four coordinates is p/√8.
        across_px = np.hypot(left.sigma_px[:, 1], right.sigma_px[:, 1])
        return self.settings.gate * across_px * np.sqrt(self._blurring(left, right) / 8.0)

    def _blurred(self, blobs: ViewBlobs) -> ViewBlobs:
        """Blobs with the unmodelled error included in their σ."""
        return replace(blobs, sigma_px=np.hypot(blobs.sigma_px, self.settings.unmodelled_px))

    def _blurring(self, left: ViewBlobs, right: ViewBlobs) -> Array:
        """(N,) factor by which the unmodelled error enlarges the variance of N pairs."""
        located = (left.sigma_px**2).sum(axis=1) + (right.sigma_px**2).sum(axis=1)
        return 1.0 + 4.0 * self.settings.unmodelled_px**2 / located

    def _typical_px(self, left: ViewBlobs, right: ViewBlobs) -> Array:
        """(2, 2, 1) typical standard deviation of x and y in either view, common to all its blobs."""
        variance = [(view.sigma_px**2).sum(axis=0) / max(len(view), 1) for view in (left, right)]
        typical: Array = np.sqrt(np.array(variance) + self.settings.unmodelled_px**2).T
        return typical[:, :, np.newaxis]


_SAME_PX = 0.5
"""Distance within which a blob is the image of a point: the point may be of an earlier run."""


class SingleViewSearch:
    """The search, for one object seen by one rig."""

    def __init__(self, correspondence: Correspondence) -> None:
        self._correspondence = correspondence

    def images(self, points: Points, left: ViewBlobs, right: ViewBlobs) -> SingleViewImages:
        """Identify the images of targets that have no point in this field.

        Args:
            points: The points of the field.
            left: All blobs of the left view.
            right: All blobs of the right view.

        Returns:
            The images beyond doubt. A target with a blob near its predicted image in *both* views is left
            out: had they been of one target, it would have a point.
        """
        lacking, places_mm, sigma_mm = self._lacking(points)
        free = [view.select(_unused(view, points.image_px[:, k])) for k, view in enumerate((left, right))]
        predicted = self._correspondence.predict(places_mm, sigma_mm, self._typical_px(free)).select(lacking)
        blob = np.stack([predicted.nearest(k, view.xy_px) for k, view in enumerate(free)])
        alone = np.flatnonzero((blob >= 0).sum(axis=0) == 1)
        of_view = blob[:, alone].argmax(axis=0)
        image_px, sigma_px = np.empty((2, len(alone), 2))
        for k, view in enumerate(free):
            own = view.select(blob[k, alone[of_view == k]])
            image_px[of_view == k], sigma_px[of_view == k] = own.xy_px, self._sigma_px(own)
        return SingleViewImages(
            self._correspondence.model.target[lacking[alone]], of_view, image_px, sigma_px
        )

    def _lacking(self, points: Points) -> tuple[Indices, Array, Array]:
        """Indices (L,) of targets without a point; predicted places (M, 3) of all, and σ of these (M,).

        Only those that the points predict well enough to tell a target from its neighbours.
        """
        model, judge = self._correspondence.model, self._correspondence.agreement
        seen = np.isin(model.target, points.target)
        expected = judge.field.expect(np.flatnonzero(seen), points.xyz_mm - model.xyz_mm[seen])
        places_mm, sigma_mm = self._correspondence.expected_places(expected)
        lacking = np.flatnonzero(~seen & (sigma_mm <= judge.settings.trust * judge.pitch_mm))
        return lacking, places_mm, sigma_mm

    def _typical_px(self, views: Sequence[ViewBlobs]) -> float:
        """Typical σ of an image in either view, with what the calibration does not describe."""
        variance = np.concatenate([view.sigma_px.ravel() for view in views]) ** 2
        located = float(variance.mean()) if len(variance) else 0.0
        return float(np.sqrt(located + self._correspondence.settings.unmodelled_px**2))

    def _sigma_px(self, blobs: ViewBlobs) -> Array:
        """(N, 2) σ of the images, with that of the lines on which they lie."""
        jitter_px = self._correspondence.noise.blob_jitter_px if blobs.common_px is None else blobs.common_px
        return np.column_stack([np.hypot(blobs.sigma_px[:, 0], jitter_px), blobs.sigma_px[:, 1]])


def _unused(blobs: ViewBlobs, images_px: Array) -> Mask:
    """(N,) True for blobs that are not the image of a point."""
    off = blobs.xy_px[:, np.newaxis] - images_px
    return ~((off * off).sum(axis=2) <= _SAME_PX**2).any(axis=1)
