"""Illumination of a grey field, view by view, for setting lamp and lens."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.field import Field, quantise
from grabberd.measurement import LocationSettings, measure
from grabberd.processes.locating import whole

CLIPPED_LEVEL = 250
"""A camera's white is a little below 255."""
QUICK = LocationSettings(method="centroid", line_jitter_px=0.0, line_shifts=False)
"""Number and size of the targets do not depend on the locator, so the fastest one does."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewLight:
    """Illumination of one view of one field.

    Attributes:
        histogram: (256,) int64 number of pixels of each grey value.
        targets: number of blobs of a target's size that lie wholly in the view, at the threshold.
        diameter_px: mean diameter in frame pixels of discs of the same area; None without targets.
        background: median of the pixels outside targets; `brightest`: exceeded by one pixel in a thousand.
        clipped: share of the targets' pixels at the camera's white level; 0 without targets.
    """

    histogram: NDArray[np.int64]
    targets: int
    diameter_px: float | None
    background: int
    brightest: int
    clipped: float


def light_of(field: Field, threshold: int, views: Mapping[str, tuple[int, int]]) -> dict[str, ViewLight]:
    """Illumination of a field in every view.

    Args:
        field: field of 8 bits with its original lines.
        threshold: grey value above which pixels belong to targets.
        views: first and end column of each view.
    """
    blobs = measure(quantise(field, 1, threshold), None, QUICK)
    lights = {}
    for name, (first, end) in views.items():
        seen = blobs.select(whole(blobs, first, end))
        counts = np.bincount(field.luma[:, first:end].ravel(), minlength=256)
        lights[name] = _light(counts, threshold, seen.area_px)
    return lights


def _light(counts: NDArray[np.int64], threshold: int, area_px: NDArray[np.float64]) -> ViewLight:
    above = counts[threshold + 1 :].sum()
    return ViewLight(
        histogram=counts,
        targets=len(area_px),
        diameter_px=float(2 * np.sqrt(area_px / np.pi).mean()) if len(area_px) else None,
        background=_level(counts[: threshold + 1], 0.5),
        brightest=_level(counts, 0.999),
        clipped=float(counts[CLIPPED_LEVEL:].sum() / above) if above else 0.0,
    )


def _level(counts: NDArray[np.int64], share: float) -> int:
    """Quantile: the least grey value that at least this share of the pixels do not exceed."""
    total = counts.cumsum()
    return int(np.searchsorted(total, share * total[-1]))
