"""Stated covariance: what is not known of the views, whatever the tests and the weights made of it."""

from dataclasses import replace

from grabberd.core.calibration.adjustment.adjustment import Adjustment, adjust
from grabberd.core.calibration.adjustment.levenberg_marquardt import AdjustmentSettings
from grabberd.core.calibration.adjustment.unknowns import Unknowns

# After local fields σ0 is about .1, and the sum of squares has rounding errors of up to half of the change by
# which `AdjustmentSettings` tells the minimum. A hundred times as much does not alter a covariance.
_SETTLED = AdjustmentSettings(settled=1e-8)


def with_stated_covariance(adjusted: Adjustment, unknowns: Unknowns) -> Adjustment:
    """Copy with the covariance of all unknowns, those included that tests have dropped.

    A term that is not significant is not known to be zero: without it the covariance of the others came out
    too small. Nor do residuals smaller than the given σ make these smaller, since positions of targets hardly
    have any redundancy: a σ0 below 1 is no reason to trust the calibration frame's certificate more.

    Args:
        adjusted: The solution, whose views and positions stay as they are.
        unknowns: All unknowns before any test.

    Raises:
        MeasurementError: As `adjust`.
    """
    whole = adjust(adjusted.network.starting_from(adjusted.views), unknowns, _SETTLED)
    trusted = min(whole.sigma0, 1.0) ** 2
    return replace(
        whole,
        views=adjusted.views,
        xyz_mm=adjusted.xyz_mm,
        covariance=whole.covariance / trusted,
        place_covariance_mm2=whole.place_covariance_mm2 / trusted,
        place_coupling=whole.place_coupling / trusted,
        sigma0=max(whole.sigma0, 1.0),
    )
