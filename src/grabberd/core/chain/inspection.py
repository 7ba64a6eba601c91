"""Inspection of pictures of unknown origin: how their lines belong together, where the views are, what the
targets look like. Pictures are looked at one after the other; of each, little is kept.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from grabberd.core.arrays import Mask
from grabberd.core.chain.discs import alike, background, diameters, disc_level, peak
from grabberd.core.chain.field_order import FieldOrderFinding, OrderCheck
from grabberd.core.chain.layout import Layout, LayoutKind, Picture, Sample, recognise
from grabberd.core.field import BOTTOM, PROGRESSIVE, TOP, VIDEO_LINES, Field, quantise, split_frame
from grabberd.core.measurement import ANY_DISC, Blobs, measure
from grabberd.core.reconstruction.field_order import Order

_MOST_PAIRS = 12
"""Pairs of pictures in which targets are looked for, evenly among all."""
_MIDDLE = (0.3, 0.7)
"""Shares of the width between which the views meet."""
_LEAST_SHARE = 0.35
"""Share of the targets that either view has at least: both see the same object."""
_CLEAR = 1.5
"""Factor by which the gap between the views exceeds those between columns of targets."""
_ROUND = 2.0
"""Ratio of width to height beyond which a bright spot is no disc."""
_WIDE = 2.0
"""Columns over lines from which on pictures may be single fields."""
_FIELD_LINES = (240, 243, 288)
_SURE_PX = 0.3
"""Deviation in lines from what a parity gives, which is one line."""


class Interlacing(StrEnum):
    """Ways in which the lines of pictures belong together."""

    PROGRESSIVE = "progressive"
    TOP_FIRST = "top_first"
    BOTTOM_FIRST = "bottom_first"
    FIELDS = "fields"
    DOUBLED = "doubled"
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
        columns, lines: Their size; of single fields, that of the frame that two of them make.
        interlacing: How their lines belong together; `order` has the evidence.
        order: The check of the field order; None for pictures that have no fields, or one each.
        targets: None if there are none to be seen.
        split: None without targets.
        first_parity: The field that single fields, or doubled ones, begin with, "top" or "bottom"; None if
            that is unknown, or there are none.
        layout: What the pictures are, if nothing that can be measured as it is.
        is_flat: True if the targets are far from round in pictures that should have all lines, or in which
            half of the lines never appear.
    """

    columns: int
    lines: int
    interlacing: Interlacing
    order: FieldOrderFinding | None
    targets: Targets | None
    split: Split | None
    first_parity: str | None = None
    layout: Layout | None = None
    is_flat: bool = False


_BY_ORDER = {
    Order.RIGHT: Interlacing.TOP_FIRST,
    Order.REVERSED: Interlacing.BOTTOM_FIRST,
    Order.SAME_INSTANT: Interlacing.PROGRESSIVE,
}


class _Samples:
    """A few pairs of successive fields, evenly among all that have come."""

    def __init__(self) -> None:
        self.kept: list[Sample] = []
        self._every = 2

    def add(self, number: int, field: Field) -> None:
        """Keep a copy of the field, if it is its turn."""
        if number % self._every > 1:
            return
        self.kept.append(Sample(number, replace(field, luma=field.luma.copy())))
        if len(self.kept) > 2 * _MOST_PAIRS:
            self._every *= 2
            self.kept = [one for one in self.kept if one.number % self._every < 2]


class _Checks:
    """Checks of the field order for each way in which pictures may consist of fields.

    Attributes:
        frames: As frames of two fields.
        singles: As single fields, the top one first.
        turned: As frames turned by a quarter.
    """

    def __init__(self) -> None:
        self.frames, self.singles, self.turned = OrderCheck(), OrderCheck(), OrderCheck()

    def add(self, number: int, picture: Picture | None) -> None:
        """Take the next picture, or None for one that is missing."""
        if picture is None:
            for check in (self.frames, self.singles, self.turned):
                check.add(None)
            return
        lines, columns = picture.shape
        for field in () if lines % 2 else split_frame(picture, TOP):
            self.frames.add(field)
        if columns >= _WIDE * lines:
            self.singles.add(Field.intact(picture, (TOP, BOTTOM)[number % 2]))
        if columns in VIDEO_LINES:
            for field in split_frame(np.ascontiguousarray(picture.T), TOP):
                self.turned.add(field)


def inspect(pictures: Iterable[Picture | None]) -> Inspection:
    """Inspect whole pictures: frames of two fields, single fields, or progressive ones.

    Args:
        pictures: (lines, columns) uint8 each, at least one, all of one size, in the order of time; None for
            each that is missing. They are copied, if at all, before the next is requested.
    """
    samples, checks = _Samples(), _Checks()
    lines, columns = 0, 0
    for number, picture in enumerate(pictures):
        checks.add(number, picture)
        if picture is not None:
            lines, columns = picture.shape
            samples.add(number, Field.progressive(picture))
    layout, is_flat = recognise(samples.kept)
    if layout is None and checks.turned.finding().order in (Order.RIGHT, Order.REVERSED):
        layout = Layout(LayoutKind.TURNED)
    # Whatever half of a picture a field is in, nothing but its discs shows it: they are half as high.
    if layout is None and columns >= _WIDE * lines and (is_flat or lines in _FIELD_LINES):
        return _of_singles(samples.kept, checks.singles, is_flat=is_flat)
    order = checks.frames.finding() if lines % 2 == 0 else None
    told = order.order if order else Order.SAME_INSTANT  # an odd number of lines is that of no frame
    interlacing, first = _BY_ORDER.get(told, Interlacing.UNKNOWN), None
    if layout is not None and layout.kind is LayoutKind.DOUBLED:
        interlacing, first, layout, order = Interlacing.DOUBLED, layout.part, None, None
    elif layout is not None:
        interlacing = Interlacing.UNKNOWN
    # A field alone is sharp whatever moves; of progressive pictures every line counts.
    whole = interlacing in (Interlacing.PROGRESSIVE, Interlacing.DOUBLED)
    fields = [one.field if whole else Field.intact(one.field.luma[::2], TOP) for one in samples.kept]
    looks = _targets_and_split(fields)
    return Inspection(columns, lines, interlacing, order, *looks, first, layout, is_flat and layout is None)


def _of_singles(kept: Sequence[Sample], singles: OrderCheck, *, is_flat: bool) -> Inspection:
    """Inspection of pictures that may be single fields, by what was found with the top one first."""
    lines, columns = kept[0].field.luma.shape
    order, off_px = singles.finding(), singles.offset_px
    if off_px is not None and abs(off_px + 1) < _SURE_PX:
        looks = _targets_and_split([one.field for one in kept])
        return Inspection(columns, lines, Interlacing.PROGRESSIVE, None, *looks, is_flat=is_flat)
    first = None
    if off_px is not None and abs(off_px) < _SURE_PX:
        first = "top"
    elif off_px is not None and abs(off_px + 2) < 2 * _SURE_PX:
        first = "bottom"  # with the parities exchanged, each field lies two lines wrong against the other one
    looks = _targets_and_split([Field.intact(one.field.luma, (TOP, BOTTOM)[one.number % 2]) for one in kept])
    return Inspection(columns, 2 * lines, Interlacing.FIELDS, order, *looks, first)


def inspect_fields(fields: Iterable[Field | None]) -> Inspection:
    """Inspect fields whose parity is known.

    Args:
        fields: At least one, all of one size; None for a gap. Each is copied, if at all, before the next is
            requested.
    """
    order, samples = OrderCheck(), _Samples()
    for number, field in enumerate(fields):
        if field is None or field.parity != PROGRESSIVE:
            order.add(field)
        if field is not None:
            samples.add(number, field)
    first = samples.kept[0].field
    found = None if first.parity == PROGRESSIVE else order.finding()
    interlacing = _BY_ORDER.get(found.order if found else Order.SAME_INSTANT, Interlacing.UNKNOWN)
    looks = _targets_and_split([one.field for one in samples.kept])
    return Inspection(first.columns, first.rows * first.y_step, interlacing, found, *looks)


def _targets_and_split(fields: Sequence[Field]) -> tuple[Targets | None, Split | None]:
    found = [one for field in fields if (one := _discs(field)) is not None]
    if not found:
        return None, None
    targets = Targets(
        count=float(np.mean([len(blobs) for _, blobs, _ in found])),
        diameter_px=float(np.median(np.concatenate([diameters(blobs) for _, blobs, _ in found]))),
        contrast=float(np.median([peak(field, level) - background(field) for field, _, level in found])),
        background=float(np.median([background(field) for field, _, _ in found])),
        clipped=float(np.mean([_clipped(field, level) for field, _, level in found])),
    )
    return targets, _split([blobs for _, blobs, _ in found], fields[0].columns)


def _discs(field: Field) -> tuple[Field, Blobs, int] | None:
    """The spots of a field that are round and alike, and the level that shows them; None without any."""
    level = disc_level(field)
    if level is None:
        return None
    blobs = measure(quantise(field, 8, level), None, ANY_DISC)
    ratio = blobs.width_px / np.maximum(blobs.height_px, 1.0)
    blobs = alike(blobs.select(~blobs.at_border & (ratio < _ROUND) & (ratio > 1 / _ROUND)))
    return (field, blobs, level) if len(blobs) else None


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
    column, sure = columns // 2, False
    if near:
        widest = max(near, key=lambda gap: gap[1] - gap[0])
        inner = [end - first for first, end in gaps if first > 0 and end < columns and (first, end) != widest]
        sure = widest[1] - widest[0] > _CLEAR * max(inner, default=0)
        column = round(sum(widest) / 2) if sure else column
    left = float((x < column).mean())
    return Split(column, sure, left, 1 - left)


def _gaps(empty: Mask) -> list[tuple[int, int]]:
    """First and end of every run of empty columns."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], empty, [False]]).astype(np.int8)))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]
