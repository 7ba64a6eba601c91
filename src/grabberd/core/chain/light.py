"""Illumination and sharpness of a grey field, view by view, for setting lamp and lens.

The threshold for coming fields, from one field: for their bits and lines, and for its targets' size.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.chain.locating import whole
from grabberd.core.field import Field, quantise
from grabberd.core.measurement import (
    Blobs,
    LocationSettings,
    ThresholdRule,
    choose_threshold,
    measure,
    threshold_map,
    with_seen_size,
)
from grabberd.errors import MeasurementError

IDEAL = 2 / 3
"""Sum of the squared steps of an edge that only the pixels blur, the mean over its places in a pixel."""
MARGIN_PX = 4.0
"""Distance from a target's edge within which its blur lies."""
OUTSIDE_PX = 3
"""Columns beyond that show the background."""
LEAST_CONTRAST = 25.0
"""Grey values between target and background below which noise decides."""
LEAST_TARGETS = 5
MEDIAN_SQUARE = 0.455
"""Median of the square of a normal variable of variance 1."""


def edge_sharpness(field: Field, xy_px: Array, diameter_px: float, white_level: int) -> float | None:
    """Sharpness of the edges of bright targets along the lines: 1 where they are as sharp as pixels can be.

    An edge rises from background to target by steps from pixel to pixel, which as shares of the whole rise
    sum up to 1. The sum of their squares is 2/3 for an edge that lies within a pixel or two, 1 / n for one
    that takes n pixels, whatever the brightness of target and background. The expected share of the noise is
    taken off. Only steps along a line are used: lines of a field are two frame lines apart, and jitter
    against each other.
    A target that is as bright as the camera gets has lost the top of its edge, and is left out.

    Args:
        field: Field of 8 bits with its original lines.
        xy_px: (N, 2) centroids of the targets in frame pixels.
        diameter_px: Their mean diameter.
        white_level: Grey value from which a pixel may be clipped.

    Returns:
        The median over the targets; None if fewer than five are to be judged.
    """
    inner = math.ceil(diameter_px / 2 + MARGIN_PX)
    lines = _lines(field, xy_px, inner + OUTSIDE_PX)
    if len(lines) < LEAST_TARGETS:
        return None
    outer = np.concatenate([lines[:, :OUTSIDE_PX], lines[:, -OUTSIDE_PX:]], axis=1)
    background, brightest = np.median(outer, axis=1), lines.max(axis=1)
    contrast = brightest - background
    kept = (contrast >= LEAST_CONTRAST) & (brightest < white_level)
    if np.count_nonzero(kept) < LEAST_TARGETS:
        return None
    steps = np.diff(lines[kept], axis=1)
    noise = np.median(np.diff(lines[kept][:, :OUTSIDE_PX], axis=1) ** 2) / MEDIAN_SQUARE
    squares = (steps[:, OUTSIDE_PX - 1 : -(OUTSIDE_PX - 1)] ** 2 - noise).sum(axis=1)
    shares = squares / (2 * contrast[kept] ** 2)
    return float(np.clip(np.median(shares) / IDEAL, 0.0, 1.0))


def _lines(field: Field, xy_px: Array, reach: int) -> Array:
    """(M, 2 reach + 1) grey values of the row through the middle of each target that is far enough inside."""
    columns = np.rint(xy_px[:, 0]).astype(np.intp)
    rows = np.rint((xy_px[:, 1] - field.y0) / field.y_step).astype(np.intp)
    inside = (columns >= reach) & (columns < field.columns - reach) & (rows >= 0) & (rows < field.rows)
    along = np.arange(-reach, reach + 1)
    return field.luma[rows[inside, None], columns[inside, None] + along].astype(np.float64)


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
    field: Field, threshold: int, views: Mapping[str, tuple[int, int]], location: LocationSettings = QUICK
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


LARGEST_TARGET_PX = 16.0
"""Larger targets get the threshold of this size: it matters little to them, and predicting it is slow."""


def field_threshold(field: Field, rule: ThresholdRule, bits: int, *, doubled: bool) -> int:
    """The threshold for fields like this one.

    Args:
        field: field of 8 bits with its original lines.
        rule: rule of the threshold; the targets' size is taken from the field if it shows any.
        bits: bits per pixel to which the fields will be quantised.
        doubled: True if missing lines will be interpolated first.

    Returns:
        The threshold, 0 to 254.

    Raises:
        MeasurementError: the threshold is automatic and no targets are visible.
    """
    histogram = np.bincount(field.luma.ravel(), minlength=256)
    return choose_threshold(histogram, _for_seen_size(rule, field), bits, _kept_lines(field, doubled))


def field_threshold_map(field: Field, rule: ThresholdRule, *, doubled: bool) -> NDArray[np.uint8]:
    """The threshold of every pixel of fields like this one, at 1 bit, where the light is uneven.

    Args:
        field: field of 8 bits with its original lines.
        rule: rule of the threshold; the targets' size is taken from the field if it shows any.
        doubled: True if missing lines will be interpolated first.

    Returns:
        (rows, columns) uint8 thresholds, for the doubled field if `doubled`.

    Raises:
        MeasurementError: the threshold is automatic and no targets are visible.
    """
    y_step, apart = _kept_lines(field, doubled)
    found = threshold_map(field.luma, _for_seen_size(rule, field), 1, (y_step, apart))
    return np.repeat(found, field.y_step // y_step, axis=0)


def _kept_lines(field: Field, doubled: bool) -> tuple[int, int]:
    """Frame lines from row to row at quantisation, and from one delivered line to the next."""
    return 1 if doubled else field.y_step, field.lines_apart


def _for_seen_size(rule: ThresholdRule, field: Field) -> ThresholdRule:
    # A field without visible targets has no size to go by: the one in the rule stands.
    with suppress(MeasurementError):
        rule = with_seen_size(rule, field)
    return replace(rule, target_px=min(rule.target_px, LARGEST_TARGET_PX))
