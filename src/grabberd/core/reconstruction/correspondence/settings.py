"""Settings of correspondence: the limits within which it is accepted."""

from dataclasses import dataclass, field

from grabberd.core.reconstruction.correspondence.displacement_field import Smoothness


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
