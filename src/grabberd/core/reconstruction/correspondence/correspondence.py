"""Correspondence of blobs in the left and right view with targets, decided by prior knowledge (paper 3.7).

On a regular grid the epipolar geometry alone is ambiguous, so the object model decides. Identification starts
from the most certain hypothesis and grows over the object: targets already identified predict the others,
with σ, because neighbours move alike. Doubtful targets are left out; a wrong target is worse than a missing
one.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Rig
from grabberd.core.kernel import KERNEL, Kernel
from grabberd.core.reconstruction.correspondence.agreement import Agreement, Sighting
from grabberd.core.reconstruction.correspondence.compiled_identification import Identification
from grabberd.core.reconstruction.correspondence.compiled_search import Nearby, takes
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField, Expected
from grabberd.core.reconstruction.correspondence.hypotheses import (
    Hypotheses,
    hypotheses,
    line_mm,
    meeting_share,
)
from grabberd.core.reconstruction.correspondence.prediction import Prediction
from grabberd.core.reconstruction.correspondence.settings import CorrespondenceSettings
from grabberd.core.reconstruction.intersection import intersect
from grabberd.core.reconstruction.miss import Miss
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.view_blobs import ImageNoise, ViewBlobs

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


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
        seen = np.zeros(len(self.model), np.bool_)
        displacement_mm = np.zeros_like(self.model.xyz_mm)
        seen[sighting.target] = True
        displacement_mm[sighting.target] = sighting.points.xyz_mm - self.model.xyz_mm[sighting.target]
        return self.following.field.expect(seen, displacement_mm)

    def _near(
        self, judge: Agreement, places_mm: Array, sigma_mm: Array, left: ViewBlobs, right: ViewBlobs
    ) -> Sighting:
        if judge in self._nearby:
            return self._nearby[judge].near(places_mm, sigma_mm, left, right)
        predicted = self.predict(places_mm, sigma_mm, self._typical_px(left, right))
        of_left, of_right = (predicted.nearest(i, view.xy_px) for i, view in enumerate((left, right)))
        misses = (of_left < 0) * int(Miss.NO_BLOB_LEFT) + (of_right < 0) * int(Miss.NO_BLOB_RIGHT)
        target = np.flatnonzero(misses == Miss.FOUND)
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
        target = np.flatnonzero((of_left >= 0) & (of_right >= 0))
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
        return Prediction.of(self.rig, places_mm, sigma_mm, sigma_px, self.settings.gate)

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
            misses[target] = Miss.RAYS_APART
            misses[target[meeting]] = Miss.OFF_PLACE
            misses[target[chosen]] = Miss.FOUND
        return Sighting(points.select(chosen), target[chosen], of_left[chosen], of_right[chosen], expected)

    def _across_px(self, left: ViewBlobs, right: ViewBlobs) -> Array:
        """(N,) greatest residual of N pairs whose rays meet."""
        # A parallax p leaves p/2 in either view, whose root mean square over four coordinates is p/√8.
        across_px = np.hypot(left.sigma_px[:, 1], right.sigma_px[:, 1])
        greatest: Array = self.settings.gate * across_px * np.sqrt(self._blurring(left, right) / 8.0)
        return greatest

    def _blurred(self, blobs: ViewBlobs) -> ViewBlobs:
        """Blobs with the unmodelled error included in their σ."""
        return replace(blobs, sigma_px=np.hypot(blobs.sigma_px, self.settings.unmodelled_px))

    def _blurring(self, left: ViewBlobs, right: ViewBlobs) -> Array:
        """(N,) factor by which the unmodelled error enlarges the variance of N pairs."""
        located = (left.sigma_px**2).sum(axis=1) + (right.sigma_px**2).sum(axis=1)
        blurring: Array = 1.0 + 4.0 * self.settings.unmodelled_px**2 / located
        return blurring

    def _typical_px(self, left: ViewBlobs, right: ViewBlobs) -> Array:
        """(2, 2, 1) typical standard deviation of x and y in either view, common to all its blobs."""
        variance = [(view.sigma_px**2).sum(axis=0) / max(len(view), 1) for view in (left, right)]
        typical: Array = np.sqrt(np.array(variance) + self.settings.unmodelled_px**2).T
        return typical[:, :, np.newaxis]
