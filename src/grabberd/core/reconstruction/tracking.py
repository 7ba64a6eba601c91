"""Tracking: the same targets from field to field (paper 3.7), predicted, found again, or identified anew.

Every target has a predicted position, seen or not: neighbours carry each other along, so a target that
reappears from behind the curve is expected where it does. The nearest blob to its predicted image is accepted
if left and right agree with one another, and the position with the neighbours.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Mask
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction.correspondence.agreement import CorrespondenceSettings, Sighting
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.points import ImageNoise, Miss, Points, ViewBlobs

_VAGUE = 0.1
"""Share of the pitch beyond which the uncertainty of a target's movement makes a prediction vague."""
_CLEARLY = 1.05
"""Ratio of numbers of targets beyond which a followed sighting is preferred to an identified one."""
OFTEN_S, SHORTEST_S = 0.02, 0.002
"""Time between fields below which predictions become no less vague, and the shortest reckoned with."""
_OTHERWISE = 0.5
"""Share of `TrackingSettings.astray_mm` beyond which targets found predict the rest instead of the track."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """M targets after a field; immutable, each step makes a new one.

    Attributes:
        target: (M,) int32, ids, ascending: all of the object model.
        xyz_mm: (M, 3) positions, smoothed over the object; those of unseen targets are predicted by the
            others.
        sigma_mm: (M,) standard deviation of a position in each coordinate.
        velocity_mm_s: (M, 3).
        speed_sigma_mm_s: Standard deviation of a velocity in each coordinate.
        unseen_s: (M,) time since a target was last seen; infinite if it never was.
        age_s: Time since the field of these positions and velocities; infinite if nothing has been tracked.
        found: Number of targets found in that field.
        sighting: What was found in the field just measured, and why the rest was not; None if nothing was
            found.
    """

    target: NDArray[np.int32]
    xyz_mm: Array
    sigma_mm: Array
    velocity_mm_s: Array
    speed_sigma_mm_s: float
    unseen_s: Array
    age_s: float
    found: int
    sighting: Sighting | None = None

    @classmethod
    def start(cls, model: ObjectModel) -> "Track":
        """Make the track before the first field: nominal positions, nothing seen."""
        count = len(model)
        return cls(
            target=model.target,
            xyz_mm=model.xyz_mm,
            sigma_mm=np.full(count, np.inf),
            velocity_mm_s=np.zeros((count, 3)),
            speed_sigma_mm_s=np.inf,
            unseen_s=np.full(count, np.inf),
            age_s=np.inf,
            found=0,
        )

    @classmethod
    def of_numbers(
        cls, target: NDArray[np.int32], numbers: Array, sighting: Sighting | None = None
    ) -> "Track":
        """Make it from its `numbers`."""
        count = len(target)
        xyz_mm, velocity_mm_s = (numbers[at * count :][: 3 * count].reshape(count, 3) for at in (0, 4))
        sigma_mm, unseen_s = (numbers[at * count :][:count] for at in (3, 7))
        speed_sigma_mm_s, age_s, found = numbers[8 * count :].tolist()
        return cls(
            target, xyz_mm, sigma_mm, velocity_mm_s, speed_sigma_mm_s, unseen_s, age_s, int(found), sighting
        )

    @property
    def numbers(self) -> Array:
        """(8·M + 3,) all that the next field depends on, as the kernel reads and writes it."""
        rest = np.array([self.speed_sigma_mm_s, self.age_s, self.found])
        parts = (self.xyz_mm, self.sigma_mm, self.velocity_mm_s, self.unseen_s, rest)
        return np.concatenate([part.ravel() for part in parts])


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """Settings of an object's movement, and of when it counts as lost.

    Attributes:
        speed_mm_s: Standard deviation of a velocity after identification, when nothing is known about it,
            where fields are 20 ms or more apart; nearer ones leave a prediction as vague in mm as those.
        acceleration_mm_s2: Standard deviation of the acceleration, likewise.
        longest_gap_s: Time without a followed field after which targets are identified anew.
        least_share: Targets are also identified anew if fewer are found than this share of those before, or
            of the blobs.
        astray_mm: Likewise, keeping their velocities, if the root mean square of their distances from the
            predicted positions exceeds this, as for a wall that stops abruptly.
        firm: A target not seen recently is reported at once only if the others predict it better than this
            share of the targets' pitch; otherwise when it is seen a second time.
        correspondence: Gates, and the object's deformation.
    """

    speed_mm_s: float = 50.0
    acceleration_mm_s2: float = 1250.0
    longest_gap_s: float = 0.07
    least_share: float = 0.35
    astray_mm: float = 0.4
    firm: float = 0.1
    correspondence: CorrespondenceSettings = field(default_factory=CorrespondenceSettings)


class Limits(NamedTuple):
    """Lengths beyond which predictions are vague, targets moved otherwise, and one is not predicted well."""

    vague_mm: float
    otherwise_mm: float
    firm_mm: float


class Tracker:
    """Tracks one object seen by one rig; all state is in the `Track`."""

    def __init__(
        self, rig: Rig, model: ObjectModel, noise: ImageNoise, settings: TrackingSettings | None = None
    ) -> None:
        self.rig = rig
        self.model = model
        self.noise = noise
        self.settings = settings or TrackingSettings()
        self.correspondence = Correspondence(rig, model, noise, self.settings.correspondence)
        pitch_mm, known = self.correspondence.agreement.pitch_mm, self.settings
        self.limits = Limits(_VAGUE * pitch_mm, _OTHERWISE * known.astray_mm, known.firm * pitch_mm)

    def start(self) -> Track:
        """Make the track before the first field."""
        return Track.start(self.model)

    def step(self, track: Track, left: ViewBlobs, right: ViewBlobs, dt_s: float) -> tuple[Track, Points]:
        """Step one field further.

        Args:
            track: Track after the previous field.
            left: Blobs of the left view in this field, targets and others, in any order.
            right: Blobs of the right view.
            dt_s: Time since the previous field, lost ones included.

        Returns:
            The track after this field, and the points of the targets found in it; none if neither following
            nor identifying finds enough.
        """
        elapsed_s = track.age_s + dt_s
        unseen_s = track.unseen_s + dt_s
        fewest = max(self.settings.least_share * min(len(left), len(right), len(self.model)), 1.0)
        if elapsed_s <= self.settings.longest_gap_s:
            sighting = self._follow(track, left, right, elapsed_s)
            if len(sighting) >= max(fewest, self.settings.least_share * track.found):
                points = _reported(sighting, self._believed(track, sighting))
                return self._continued(track, sighting, unseen_s, elapsed_s), points
        sighting = self.correspondence.identify(left, right)
        if len(sighting) >= fewest:
            return self._begun(sighting, unseen_s, dt_s), _reported(sighting, _in_place(sighting))
        return replace(track, unseen_s=unseen_s, age_s=elapsed_s, sighting=None), Points.none()

    def _believed(self, track: Track, sighting: Sighting) -> Mask:
        """(K,) True for points to report: seen recently, or well predicted by the others.

        Any other may be a false blob in the wide gate of a poorly predicted target; two in a row are not.
        """
        lately = track.unseen_s[sighting.target] <= self.settings.longest_gap_s
        predicted = sighting.expected.sigma_mm[sighting.target] <= self.limits.firm_mm
        return (lately | predicted) & _in_place(sighting)

    def _follow(self, track: Track, left: ViewBlobs, right: ViewBlobs, elapsed_s: float) -> Sighting:
        """Search where the targets have moved to; again where those found predict the rest, if that was vague
        or they have moved otherwise; and without any prediction if they have moved quite otherwise.
        """
        places_mm, sigma_mm = self._moved(track, elapsed_s)
        sighting = self.correspondence.near(places_mm, sigma_mm, left, right)
        if not len(sighting):
            return sighting
        vague_mm = track.speed_sigma_mm_s * elapsed_s
        astray_mm = _surprise(sighting, places_mm, sigma_mm) * vague_mm
        if vague_mm > self.limits.vague_mm or astray_mm > self.limits.otherwise_mm:
            sighting = self.correspondence.near(
                *self.correspondence.expected_places(sighting.expected), left, right
            )
        if astray_mm > self.settings.astray_mm:
            return _better(sighting, self.correspondence.identify(left, right))
        return sighting

    def _moved(self, track: Track, elapsed_s: float) -> tuple[Array, Array]:
        """Positions (M, 3) in mm after that time, and their standard deviations (M,)."""
        # The liner's wall moves up to 2 mm a field at 50 Hz, .3 of the pitch: too far without velocity.
        xyz_mm = track.xyz_mm + track.velocity_mm_s * elapsed_s
        return xyz_mm, np.hypot(track.sigma_mm, track.speed_sigma_mm_s * elapsed_s)

    def _begun(self, sighting: Sighting, unseen_s: Array, dt_s: float) -> Track:
        """Make the track after identification, at rest until the next field shows more."""
        at_rest = np.zeros_like(self.model.xyz_mm)
        speed_sigma_mm_s = self.settings.speed_mm_s * max(1.0, OFTEN_S / max(dt_s, SHORTEST_S))
        return self._after(sighting, self._settled(sighting), unseen_s, at_rest, speed_sigma_mm_s)

    def _continued(self, track: Track, sighting: Sighting, unseen_s: Array, elapsed_s: float) -> Track:
        settled = self._settled(sighting)
        velocity_mm_s = (settled[0] - track.xyz_mm) / elapsed_s
        before, now = track.unseen_s == 0.0, np.zeros(len(self.model), np.bool_)
        now[sighting.target] = True
        if (changed := before ^ now).any() and (same := before & now).any():
            # From a predicted place to a measured one is no movement, and would lose the target again.
            velocity_mm_s[changed] = velocity_mm_s[same].mean(axis=0)
        speed_sigma_mm_s = self.settings.acceleration_mm_s2 * _unsteady_s(elapsed_s)
        return self._after(sighting, settled, unseen_s, velocity_mm_s, speed_sigma_mm_s)

    def _after(
        self,
        sighting: Sighting,
        settled: tuple[Array, Array],
        unseen_s: Array,
        velocity_mm_s: Array,
        speed_sigma_mm_s: float,
    ) -> Track:
        seconds, found = unseen_s.copy(), len(sighting)
        seconds[sighting.target] = 0.0
        return Track(
            self.model.target, *settled, velocity_mm_s, speed_sigma_mm_s, seconds, 0.0, found, sighting
        )

    def _settled(self, sighting: Sighting) -> tuple[Array, Array]:
        """Positions (M, 3) of all targets, and their standard deviations (M,)."""
        return sighting.settled or (self._smoothed(sighting), self._sigma(sighting))

    def _smoothed(self, sighting: Sighting) -> Array:
        """Combine measured positions with the others' prediction, weighted by its certainty."""
        target, noise_mm = sighting.target, self.correspondence.agreement.field.noise_mm
        displacement, sigma_mm = sighting.expected.displacement_mm.copy(), sighting.expected.sigma_mm[target]
        measured = sighting.points.xyz_mm - self.model.xyz_mm[target]
        share = noise_mm**2 / (sigma_mm**2 + noise_mm**2)
        displacement[target] = measured - share[:, np.newaxis] * (measured - displacement[target])
        return self.model.xyz_mm + displacement

    def _sigma(self, sighting: Sighting) -> Array:
        """Standard deviations: as predicted, but for seen targets no worse than that of their own depth."""
        sigma = sighting.expected.sigma_mm.copy()
        depth = np.sqrt(np.diagonal(sighting.points.covariance_mm2, axis1=1, axis2=2).max(axis=1))
        sigma[sighting.target] = np.minimum(sigma[sighting.target], depth)
        return sigma


def _in_place(sighting: Sighting) -> Mask:
    """(K,) True for targets whose images nothing draws from their places."""
    if sighting.misses is None:
        return np.ones(len(sighting), np.bool_)
    return sighting.misses[sighting.target] == Miss.FOUND


def _reported(sighting: Sighting, believed: Mask) -> Points:
    return sighting.points if believed.all() else sighting.points.select(believed)


def _unsteady_s(elapsed_s: float) -> float:
    """Time for which the acceleration changes a velocity that was measured over `elapsed_s`.

    A closing wall accelerates many times as much as usual. At 50 fields a second its targets leave their
    gates and are identified anew. At 120, gates of the usual acceleration would be a sixth as wide: too
    narrow for such a wall, and for anybody to notice.
    """
    return max(elapsed_s, OFTEN_S**2 / max(elapsed_s, SHORTEST_S))


def _better(followed: Sighting, identified: Sighting) -> Sighting:
    """Choose the followed sighting if it agrees with the identified one about blobs and is clearly larger.

    Few more would rather be false: the identified one needed no prediction.
    """
    both, ours, theirs = np.intersect1d(
        followed.target, identified.target, assume_unique=True, return_indices=True
    )
    same = followed.left[ours] == identified.left[theirs]
    same &= followed.right[ours] == identified.right[theirs]
    agree = len(both) > 0 and bool(same.all())
    return followed if agree and len(followed) > _CLEARLY * len(identified) else identified


def _surprise(sighting: Sighting, places_mm: Array, sigma_mm: Array) -> float:
    """Root mean square distance from the predicted places, in standard deviations of each coordinate."""
    if not len(sighting):
        return 0.0
    if sighting.surprise is not None:
        return sighting.surprise
    off = sighting.points.xyz_mm - places_mm[sighting.target]
    own = np.diagonal(sighting.points.covariance_mm2, axis1=1, axis2=2)
    return float(np.sqrt((off * off / (own + sigma_mm[sighting.target, np.newaxis] ** 2)).mean()))
