"""Stillness of the wall: the common movement of its targets, beyond what noise explains."""

from collections.abc import Sequence

import numpy as np

from grabberd_liner.analysis import Estimate
from grabberd_liner.chain.analysis.field_points import FieldPoints
from grabberd_liner.chain.guided_tests.outcome import Array, estimate

_SEEN_IN = 0.5
"""Share of the fields in which a target has to be seen to count."""


def unrest_mm(fields: Sequence[FieldPoints]) -> Estimate:
    """Standard deviation over time of the targets' mean movement towards the cameras, less that of noise.

    Args:
        fields: of one capture; NaN comes of fewer than three.
    """
    z_mm, sigma_mm = _heights(fields) if fields else (np.empty(0), np.empty(0))
    if len(z_mm) < 3 or not z_mm.size:
        return estimate(np.nan, np.nan)
    with np.errstate(invalid="ignore"):
        from_mean = z_mm - np.nanmean(z_mm, axis=0)
        seen = np.isfinite(z_mm).sum(axis=1)
        common_mm = np.nanmean(from_mean, axis=1)
        noise = np.sqrt(np.nansum(np.square(sigma_mm), axis=1)) / seen
    beyond = max(float(np.nanvar(common_mm, ddof=1) - np.nanmean(np.square(noise))), 0.0)
    # σ of a standard deviation, of what is left of it and of what was taken off.
    sigma = float(np.nanstd(common_mm, ddof=1)) / np.sqrt(2 * (len(common_mm) - 1))
    return estimate(np.sqrt(beyond), sigma)


def _heights(fields: Sequence[FieldPoints]) -> tuple[Array, Array]:
    """(F, N) heights of the targets that are seen often enough, and their σ; NaN where one is not seen."""
    targets = np.unique(np.concatenate([one.timed.points.target for one in fields]))
    z_mm = np.full((len(fields), len(targets)), np.nan)
    sigma_mm = z_mm.copy()
    for row, one in enumerate(fields):
        at = np.searchsorted(targets, one.timed.points.target)
        z_mm[row, at] = one.timed.points.xyz_mm[:, 2]
        sigma_mm[row, at] = np.sqrt(one.timed.points.covariance_mm2[:, 2, 2])
    often = np.isfinite(z_mm).mean(axis=0) >= _SEEN_IN
    seen = np.isfinite(z_mm[:, often]).any(axis=1)
    return z_mm[seen][:, often], sigma_mm[seen][:, often]
