"""Illumination of a grey field, view by view, for setting lamp and lens."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.focus import edge_sharpness
from grabberd.core.chain.locating import whole
from grabberd.core.field import Field, quantise
from grabberd.core.measurement import Blobs, LocationSettings, measure

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
        sharpness: of the targets' edges, 1 where only the pixels blur them; None if too few can be judged.
    """

    histogram: NDArray[np.int64]
    targets: int
    diameter_px: float | None
    background: int
    brightest: int
    clipped: float
    sharpness: float | None


def light_of(
    field: Field,
    threshold: int,
    views: Mapping[str, tuple[int, int]],
    location: LocationSettings = QUICK,
) -> dict[str, ViewLight]:
    """Illumination of a field in every view.

    Args:
        field: field of 8 bits with its original lines.
        threshold: grey value above which pixels belong to targets.
        views: first and end column of each view.
        location: settings of target location, for the limits of a target's size.
    """
    quick = replace(QUICK, min_diameter_px=location.min_diameter_px, max_diameter_px=location.max_diameter_px)
    blobs = measure(quantise(field, 1, threshold), None, quick)
    lights = {}
    for name, (first, end) in views.items():
        seen = blobs.select(whole(blobs, first, end))
        counts = np.bincount(field.luma[:, first:end].ravel(), minlength=256)
        lights[name] = _light(field, counts, threshold, seen)
    return lights


def _light(field: Field, counts: NDArray[np.int64], threshold: int, seen: Blobs) -> ViewLight:
    area_px, above = seen.area_px, counts[threshold + 1 :].sum()
    diameter_px = float(2 * np.sqrt(area_px / np.pi).mean()) if len(area_px) else None
    sharpness = None if diameter_px is None else edge_sharpness(field, seen.xy_px, diameter_px, CLIPPED_LEVEL)
    return ViewLight(
        histogram=counts,
        targets=len(area_px),
        diameter_px=diameter_px,
        background=_level(counts[: threshold + 1], 0.5),
        brightest=_level(counts, 0.999),
        clipped=float(counts[CLIPPED_LEVEL:].sum() / above) if above else 0.0,
        sharpness=sharpness,
    )


def _level(counts: NDArray[np.int64], share: float) -> int:
    """Quantile: the least grey value that at least this share of the pixels do not exceed."""
    total = counts.cumsum()
    return int(np.searchsorted(total, share * total[-1]))
