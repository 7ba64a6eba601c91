"""What is believed of an identification."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """When an identification is believed.

    Attributes:
        handedness: of the left and of the right view, +1 or −1; None: found from the picture.
        least_targets: a view with fewer identified targets determines nothing.
        least_share: of a view's blobs that the winner has to explain.
        sigma_px: standard deviation of an image coordinate in all, what a rough model leaves included.
        most_rms_px: of the identified targets' residuals; more belongs to another calibration frame.
        margin: by how much the runner-up's −2 ln(likelihood) has to exceed the winner's.
        relative: share by which the base and the distance may differ from nominal.
        relative_deg: angle by which the views' relative orientation may differ from nominal.
    """

    handedness: tuple[int | None, int | None] = (None, None)
    least_targets: int = 12
    least_share: float = 0.8
    sigma_px: float = 0.5
    most_rms_px: float = 0.5
    margin: float = 60.0
    relative: float = 0.3
    relative_deg: float = 20.0
