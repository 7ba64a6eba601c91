"""The same targets from field to field (paper 3.7): predicted, found again, or identified anew.

Every target has a predicted place, seen or not: with the velocity of the smooth field of displacements, which
neighbours carry along, so a target that comes back from behind the curve is expected where it comes. Near its
predicted image in either view the nearest blob is its own, if both agree with one another and with the neighbours.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry import Rig, linearise
from grabberd.reconstruction.correspondence import Correspondence, CorrespondenceSettings, Matches
from grabberd.reconstruction.displacement import Expected
from grabberd.reconstruction.image_noise import ImageNoise
from grabberd.reconstruction.intersection import intersect
from grabberd.reconstruction.object_model import ObjectModel
from grabberd.reconstruction.points import Points
from grabberd.reconstruction.view_blobs import ViewBlobs

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """How an object moves, and when it is lost.

    Attributes:
        speed_mm_s: standard deviation of a velocity of which nothing is known: just identified.
        acceleration_mm_s2: standard deviation of the acceleration.
        longest_gap_s: after longer without a field that could be followed, targets are identified anew.
        least_share: so are they where fewer are found than this share of those that were, or of the blobs.
        correspondence: gates, and the object's deformation.
    """

    speed_mm_s: float = 50.0
    acceleration_mm_s2: float = 1250.0
    longest_gap_s: float = 0.07
    least_share: float = 0.5
    correspondence: CorrespondenceSettings = field(default_factory=CorrespondenceSettings)


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """What is known of M targets after a field; never changed, each step makes a new one.

    Attributes:
        target: (M,) int32, ids, ascending: all of the object model.
        xyz_mm: (M, 3) places, smoothed over the object; of unseen targets as their neighbours say.
        sigma_mm: (M,) standard deviation of a place in each coordinate.
        velocity_mm_s: (M, 3).
        speed_sigma_mm_s: standard deviation of a velocity in each coordinate.
        unseen_s: (M,) since a target was last seen; infinite where it never was.
        age_s: since the field that places and velocities belong to; infinite where nothing is tracked.
        found: how many targets were found in that field.
    """

    target: NDArray[np.int32]
    xyz_mm: Array
    sigma_mm: Array
    velocity_mm_s: Array
    speed_sigma_mm_s: float
    unseen_s: Array
    age_s: float
    found: int


class Tracker:
    """The rules by which one object is tracked before one rig; all that changes is in the `Track`."""

    def __init__(
        self,
        rig: Rig,
        model: ObjectModel,
        noise: ImageNoise,
        settings: TrackingSettings | None = None,
    ) -> None:
        self.rig = rig
        self.model = model
        self.noise = noise
        self.settings = settings or TrackingSettings()
        self.correspondence = Correspondence(rig, model, noise, self.settings.correspondence)

    def start(self) -> Track:
        """Nothing seen yet."""
        return Track(
            target=self.model.target,
            xyz_mm=self.model.xyz_mm,
            sigma_mm=np.full(len(self.model), self.settings.correspondence.smoothness.sigma_mm),
            velocity_mm_s=np.zeros((len(self.model), 3)),
            speed_sigma_mm_s=self.settings.speed_mm_s,
            unseen_s=np.full(len(self.model), np.inf),
            age_s=np.inf,
            found=0,
        )

    def step(self, track: Track, left: ViewBlobs, right: ViewBlobs, dt_s: float) -> tuple[Track, Points]:
        """One field further.

        Args:
            track: after the field before.
            left: the blobs of the left view in this field, targets and others, in any order.
            right: those of the right view.
            dt_s: time since the field before, lost ones included.

        Returns:
            the track after this field, and the points of the targets that were found in it; none of them where
            neither following nor identifying finds enough.
        """
        elapsed_s = track.age_s + dt_s
        unseen_s = track.unseen_s + dt_s
        fewest = self.settings.least_share * min(len(left), len(right), len(self.model))
        if elapsed_s <= self.settings.longest_gap_s:
            sighting = self._follow(track, left, right, elapsed_s)
            if len(sighting.points) >= max(fewest, self.settings.least_share * track.found, 1):
                return self._continued(track, sighting, unseen_s, elapsed_s), sighting.points
        sighting = self._identify(left, right)
        if len(sighting.points) >= max(fewest, 1):
            return self._begun(sighting, unseen_s), sighting.points
        return replace(track, unseen_s=unseen_s, age_s=elapsed_s), Points.none()

    def windows(self, track: Track, dt_s: float) -> Array | None:
        """Where to look for blobs in the field that comes `dt_s` after the last.

        Returns:
            (2 M, 4) float64 x0, y0, x1, y1 in frame pixels: where a blob's centre may be, of all targets in the left
            view and then in the right, as far as they lie inside the view's half; None where nothing is tracked
            and a target may be anywhere.
        """
        elapsed_s = track.age_s + dt_s
        if elapsed_s > self.settings.longest_gap_s:
            return None
        return self._predict(track, elapsed_s, _UNKNOWN_PX).windows(self.rig.views)

    def _predict(self, track: Track, elapsed_s: float, sigma_px: Array | float) -> Prediction:
        places = track.xyz_mm + track.velocity_mm_s * elapsed_s
        sigma_mm = np.hypot(track.sigma_mm, track.speed_sigma_mm_s * elapsed_s)
        return Prediction.of(self.rig, places, sigma_mm, sigma_px, self.settings.correspondence.gate)

    def _follow(self, track: Track, left: ViewBlobs, right: ViewBlobs, elapsed_s: float) -> Sighting:
        blobs = (self.correspondence.blurred(left), self.correspondence.blurred(right))
        sigma_px = np.array([_typical(view.sigma_px) for view in blobs]).T[:, :, np.newaxis]
        predicted = self._predict(track, elapsed_s, sigma_px)
        nearest = np.array([predicted.nearest(index, view.xy_px) for index, view in enumerate(blobs)])
        target = np.flatnonzero((nearest >= 0).all(axis=0))
        matches = Matches(target, *nearest[:, target])
        return self._sight(matches, left, right, predicted.places_mm[target])

    def _identify(self, left: ViewBlobs, right: ViewBlobs) -> Sighting:
        matches = self.correspondence.identify(left, right)
        return self._sight(matches, left, right, None)

    def _sight(self, matches: Matches, left: ViewBlobs, right: ViewBlobs, start_mm: Array | None) -> Sighting:
        """The points of matches, without those that disagree: their rays with one another, they with the rest."""
        left, right = left.select(matches.left), right.select(matches.right)
        points = intersect(self.rig, self.model.target[matches.target], left, right, self.noise, start_mm)
        blurring = self._blurring(left, right)
        known = Hypotheses(
            *matches,
            points.xyz_mm - self.model.xyz_mm[matches.target],
            np.diagonal(points.covariance_mm2, axis1=1, axis2=2) * blurring[:, np.newaxis],
        )
        across = np.hypot(left.sigma_px[:, 1], right.sigma_px[:, 1]) * np.sqrt(blurring / 8.0)
        meeting = np.flatnonzero(points.residual_px <= self.settings.correspondence.gate * across)
        chosen, expected = self.correspondence.consistent(known, meeting)
        return Sighting(points.select(chosen), known.select(chosen), expected)
