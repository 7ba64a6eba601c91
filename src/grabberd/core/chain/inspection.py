"""Inspection of pictures of unknown origin: how their lines belong together, where the views are, what the
targets look like.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.field_order import FieldOrderFinding, check
from grabberd.core.chain.thresholds import field_threshold
from grabberd.core.field import PROGRESSIVE, TOP, Field, quantise, split_frame
from grabberd.core.measurement import Blobs, LocationSettings, ThresholdRule, measure
from grabberd.core.reconstruction.field_order import Order
from grabberd.errors import MeasurementError

Picture = NDArray[np.uint8]

MOST_BLOBS_AT = 12
"""Pictures in which targets are looked for, evenly among all."""
_FIND = LocationSettings(method="centroid", min_diameter_px=2.0, max_diameter_px=200.0, line_jitter_px=0.0)
"""Anything from a dot to a coin: what size targets have is the question."""
_MIDDLE = (0.3, 0.7)
"""Shares of the width between which the views meet."""
_LEAST_SHARE = 0.35
"""Share of the targets that either view has at least: both see the same object."""
_CLEAR = 1.5
"""Factor by which the gap between the views exceeds those between columns of targets."""
_ROUND = 2.0
"""Ratio of width to height beyond which a bright spot is no disc."""
_BRIGHTEST = 0.9
"""Share of a target's pixels that are darker than its middle."""
_LIKE = 2.0
"""Factor by which a target's diameter may differ from the median."""


class Interlacing(StrEnum):
    """Ways in which the lines of pictures belong together."""

    PROGRESSIVE = "progressive"
    TOP_FIRST = "top_first"
    BOTTOM_FIRST = "bottom_first"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Targets:
    """Looks of the targets.

    Attributes:
        count: Mean number in a picture.
        diameter_px: Median diameter above the threshold, frame pixels.
        contrast: Grey levels between background and targets.
        background: Grey level of the background.
        clipped: Share of the targets' pixels that are white.
    """

    count: float
    diameter_px: float
    contrast: float
    background: float
    clipped: float


@dataclass(frozen=True, slots=True)
class Split:
    """Place where the left view ends and the right one begins.

    Attributes:
        column: First column of the right view.
        sure: True if the pictures show it; else it is the middle.
        left, right: Share of the targets in either.
    """

    column: int
    sure: bool
    left: float
    right: float


@dataclass(frozen=True, slots=True)
class Inspection:
    """Findings of an inspection.

    Attributes:
        columns, lines: Their size.
        interlacing: How their lines belong together; `order` has the evidence.
        order: The check of the field order; None for pictures that are known to be fields.
        targets: None if there are none to be seen.
        split: None without targets.
    """

    columns: int
    lines: int
    interlacing: Interlacing
    order: FieldOrderFinding | None
    targets: Targets | None
    split: Split | None


_BY_ORDER = {
    Order.RIGHT: Interlacing.TOP_FIRST,
    Order.REVERSED: Interlacing.BOTTOM_FIRST,
    Order.SAME_INSTANT: Interlacing.PROGRESSIVE,
}


def inspect(pictures: Sequence[Picture]) -> Inspection:
    """Inspect whole pictures, frames of two fields or progressive ones.

    Args:
        pictures: (lines, columns) uint8 each, all of one size, in the order of time.
    """
    lines, columns = pictures[0].shape
    order = None if lines % 2 else check(field for one in pictures for field in split_frame(one, TOP))
    told = order.order if order else Order.SAME_INSTANT  # an odd number of lines is that of no frame
    interlacing = _BY_ORDER.get(told, Interlacing.UNKNOWN)
    # A field alone is sharp whatever moves; of progressive pictures every line counts.
    fields = [
        Field.progressive(one) if interlacing is Interlacing.PROGRESSIVE else Field.intact(one[::2], TOP)
        for one in pictures
    ]
    targets, split = _targets_and_split(fields)
    return Inspection(columns, lines, interlacing, order, targets, split)


def inspect_fields(fields: Sequence[Field], order: FieldOrderFinding | None = None) -> Inspection:
    """Inspect fields whose parity is known.

    Args:
        fields: All of one size.
        order: What is known of their order.
    """
    first = fields[0]
    told = order.order if order else Order.UNCLEAR
    if first.parity == PROGRESSIVE:
        told = Order.SAME_INSTANT
    interlacing = _BY_ORDER.get(told, Interlacing.UNKNOWN)
    targets, split = _targets_and_split(fields)
    return Inspection(first.columns, first.rows * first.y_step, interlacing, order, targets, split)


def _targets_and_split(fields: Sequence[Field]) -> tuple[Targets | None, Split | None]:
    chosen = fields[:: max(1, len(fields) // MOST_BLOBS_AT)]
    found = [one for field in chosen if (one := _discs(field)) is not None]
    if not found:
        return None, None
    targets = Targets(
        count=float(np.mean([len(blobs) for _, blobs, _ in found])),
        diameter_px=float(np.median(np.concatenate([_diameters(blobs) for _, blobs, _ in found]))),
        contrast=float(np.median([_peak(field, level) - _background(field) for field, _, level in found])),
        background=float(np.median([_background(field) for field, _, _ in found])),
        clipped=float(np.mean([_clipped(field, level) for field, _, level in found])),
    )
    return targets, _split([blobs for _, blobs, _ in found], fields[0].columns)


def _discs(field: Field) -> tuple[Field, Blobs, int] | None:
    """The spots of a field that are round and alike, and the level that shows them; None without any."""
    try:
        threshold = field_threshold(field, ThresholdRule(), 8, doubled=False)
    except MeasurementError:
        return None
    # At half of their height blur makes discs neither wider nor narrower.
    level = round((_peak(field, threshold) + _background(field)) / 2)
    blobs = measure(quantise(field, 8, level), None, _FIND)
    ratio = blobs.width_px / np.maximum(blobs.height_px, 1.0)
    blobs = blobs.select(~blobs.at_border & (ratio < _ROUND) & (ratio > 1 / _ROUND))
    if not len(blobs):
        return None
    share = _diameters(blobs) / np.median(_diameters(blobs))
    blobs = blobs.select((share < _LIKE) & (share > 1 / _LIKE))
    return field, blobs, level


def _diameters(blobs: Blobs) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(4 / np.pi * blobs.area_px))


def _background(field: Field) -> float:
    return float(np.median(field.luma))


def _peak(field: Field, level: int) -> float:
    """Grey level of the targets' brightest pixels."""
    above = field.luma[field.luma > level]
    return float(np.quantile(above, _BRIGHTEST)) if len(above) else float(level)


def _clipped(field: Field, level: int) -> float:
    above = field.luma > level
    return float((field.luma[above] == np.iinfo(np.uint8).max).mean()) if above.any() else 0.0


def _split(found: Sequence[Blobs], columns: int) -> Split:
    """The widest run of columns near the middle in which no target was ever seen."""
    x = np.concatenate([blobs.xy_px[:, 0] for blobs in found])
    half = np.concatenate([blobs.width_px for blobs in found]) / 2
    seen = np.zeros(columns + 1, np.int64)
    np.add.at(seen, np.clip(np.floor(x - half), 0, columns).astype(np.int64), 1)
    np.add.at(seen, np.clip(np.ceil(x + half) + 1, 0, columns).astype(np.int64), -1)
    gaps = _gaps(np.cumsum(seen)[:columns] == 0)
    near = [gap for gap in gaps if _MIDDLE[0] * columns <= (gap[0] + gap[1]) / 2 <= _MIDDLE[1] * columns]
    near = [gap for gap in near if _LEAST_SHARE <= (x < gap[0]).mean() <= 1 - _LEAST_SHARE]
    if not near:
        return _at(columns // 2, x, sure=False)
    widest = max(near, key=lambda gap: gap[1] - gap[0])
    inner = [end - first for first, end in gaps if first > 0 and end < columns and (first, end) != widest]
    sure = widest[1] - widest[0] > _CLEAR * max(inner, default=0)
    return _at(round(sum(widest) / 2), x, sure=sure) if sure else _at(columns // 2, x, sure=False)


def _at(column: int, x: NDArray[np.float64], *, sure: bool) -> Split:
    left = float((x < column).mean())
    return Split(column, sure, left, 1 - left)


def _gaps(empty: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and end of every run of empty columns."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], empty, [False]]).astype(np.int8)))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]
