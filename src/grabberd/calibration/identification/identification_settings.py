"""Settings of identification."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """Criteria for accepting an identification.

    Attributes:
        handedness: Of the left and the right view, +1 or −1; None finds it from the picture.
        least_targets: Least number of identified targets that determines a view.
        least_share: Share of a view's blobs that the winner must explain.
        sigma_px: Total standard deviation of an image coordinate, including errors of the rough model.
        most_rms_px: Greatest RMS of the identified targets' residuals; more indicates another calibration
            frame.
        margin: Least difference of −2 ln(likelihood) between runner-up and winner.
        relative: Greatest relative deviation of base and distance from nominal.
        relative_deg: Greatest deviation of the views' relative orientation from nominal.
    """

    handedness: tuple[int | None, int | None] = (None, None)
    least_targets: int = 12
    least_share: float = 0.8
    sigma_px: float = 0.5
    most_rms_px: float = 0.5
    margin: float = 60.0
    relative: float = 0.3
    relative_deg: float = 20.0
