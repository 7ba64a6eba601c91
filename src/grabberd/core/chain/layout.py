"""Pictures that are not what their size suggests: two fields or the same picture twice in one, or half of it
missing. Only what the pictures themselves prove is said.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Mask
from grabberd.core.chain.discs import DiscFinder, disc_level, pairs, spacing_px
from grabberd.core.field import Field
from grabberd.core.measurement import Blobs

Picture = NDArray[np.uint8]


class LayoutKind(StrEnum):
    """Ways in which a picture is neither a frame, nor a field, nor progressive."""

    STACKED = "fields_one_above_the_other"
    BESIDE = "fields_side_by_side"
    TWICE_BELOW = "same_picture_below"
    TWICE_BESIDE = "same_picture_beside"
    LINES_TWICE = "lines_twice"
    INTERPOLATED = "lines_interpolated"
    DOUBLED = "lines_interpolated_alternately"
    FIELD_MISSING = "field_missing"
    HALF_MISSING = "half_missing"
    TURNED = "frames_turned_by_a_quarter"


@dataclass(frozen=True, slots=True)
class Layout:
    """A layout that was recognised.

    Attributes:
        kind: What it is.
        part: Of fields, which one is in the upper or left half, `top` or `bottom`; the field whose lines are
            missing or interpolated; of doubled fields, the one that the first picture was made of; the half
            that is missing: `upper`, `lower`, `left` or `right`. Empty if that cannot be told.
    """

    kind: LayoutKind
    part: str = ""


class Sample(NamedTuple):
    """A picture, as a progressive field unless its parity is known, and its number in the recording."""

    number: int
    field: Field


_FLAT = 1.35
"""Width over height from which on discs are not round: half of their lines are elsewhere."""
_PARITIES = ("top", "bottom")
_LEAST_DISCS = 6
_MATCHED = 0.75
"""Share of the discs that two fields of one frame have in common, while the object moves."""
_EQUAL = 0.9
"""Share of the discs that the same picture has in common, and of the pictures that are alike."""
_GATE = 0.3
"""Share of the distance between discs within which a disc of the other half is the same one."""
_SAME_PX = 0.25
_SPREAD_PX = 0.6
"""Largest deviation of the discs' distances: two views of an object have others from disc to disc."""
_HALF_LINE = 0.25
"""Deviation from half a line, by which the fields of a frame lie apart."""
_COPIED = 0.1
"""Share of the usual difference below which a line is made of its neighbours."""
_FLAT_BLACK, _NOISY = 0.3, 0.6
"""Standard deviations, in grey levels, of what a device fills in, and of a camera's background."""
_OTHER_BLACK = 3.0
_BRIGHT = 40.0
_MARGIN = 16
_ALL = 0.9
"""Share of the pictures in which something is so."""


def recognise(samples: Sequence[Sample]) -> tuple[Layout | None, bool]:
    """The layout of pictures of one size, if they prove a known one; and True if discs are far from round."""
    finder = DiscFinder()
    found = [blobs for one in samples if (blobs := finder.find(one.field)) is not None]
    ratios = [blobs.width_px / np.maximum(blobs.height_px, 1.0) for blobs in found if len(blobs)]
    is_flat = bool(ratios) and bool(np.median(np.concatenate(ratios)) > _FLAT)
    layout = _of_lines(samples) or _half_missing(samples) or _of_halves(found, samples, is_flat=is_flat)
    return layout, is_flat


def _of_lines(samples: Sequence[Sample]) -> Layout | None:
    """Layouts that alternate from line to line."""
    rows_lit = [_rows_lit(one.field) for one in samples]
    lit = [(one, rows) for one, rows in zip(samples, rows_lit, strict=True) if rows.sum() >= _LEAST_DISCS]
    if not lit:
        return None
    for parity, name in enumerate(_PARITIES):
        if not any(rows[parity::2].any() for _, rows in lit):
            return Layout(LayoutKind.FIELD_MISSING, name)
    pictures = [one.field.luma for one, _ in lit]
    if all(_twice(picture) < _COPIED for picture in pictures):
        return Layout(LayoutKind.LINES_TWICE)
    made = [one for picture in pictures if (one := _interpolated(picture)) is not None]
    if len(made) < len(pictures):
        return None
    numbers = [one.number % 2 for one, _ in lit]
    if len(set(made)) == 1 and len(set(numbers)) == 2:
        return Layout(LayoutKind.INTERPOLATED, _PARITIES[made[0]])
    first = {one ^ number for one, number in zip(made, numbers, strict=True)}
    return Layout(LayoutKind.DOUBLED, _PARITIES[1 - first.pop()]) if len(first) == 1 else None


def _rows_lit(field: Field) -> Mask:
    level = disc_level(field)
    return np.zeros(field.rows, bool) if level is None else np.asarray((field.luma > level).any(axis=1))


def _twice(picture: Picture) -> float:
    """Mean squared difference of the lines 0 and 1, 2 and 3 …, over that of those between, or the inverse."""
    steps = np.square(np.diff(picture.astype(np.int32), axis=0)).mean(axis=1)
    return _share(float(steps[0::2].mean()), float(steps[1::2].mean()))


def _interpolated(picture: Picture) -> int | None:
    """Parity of the lines that are the means of their neighbours; None if neither is, or both."""
    luma = picture.astype(np.float32)
    left = np.square(luma[1:-1] - (luma[:-2] + luma[2:]) / 2).mean(axis=1)
    odd, even = float(left[0::2].mean()), float(left[1::2].mean())
    return None if _share(odd, even) >= _COPIED else int(odd < even)


def _share(one: float, other: float) -> float:
    """The lesser over the greater."""
    return min(one, other) / max(one, other) if max(one, other) > 0 else 1.0


_HALVES = {"upper": (0, 0), "lower": (0, 1), "left": (1, 0), "right": (1, 1)}
"""Axis along which each half of a picture is cut off, and its place there."""


def _half_missing(samples: Sequence[Sample]) -> Layout | None:
    """A half that a device filled in: a view is never without noise or targets.

    An object may well be in the upper half alone, and few bits show no noise: then the halves differ in how
    black they are.
    """
    for name, (axis, place) in _HALVES.items():
        cut = [np.split(one.field.luma, [one.field.luma.shape[axis] // 2], axis) for one in samples]
        inner = [[half[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN] for half in halves] for halves in cut]
        both = [(halves[place], halves[1 - place]) for halves in inner]
        if all(_is_filled_in(one, other) and (axis or _is_blacker(one, other)) for one, other in both):
            return Layout(LayoutKind.HALF_MISSING, name)
    return None


def _is_filled_in(half: Picture, other: Picture) -> bool:
    """True if a half is all of one grey, and there is something in the other one."""
    if not half.size or not other.size or float(half.std()) >= _FLAT_BLACK:
        return False
    return float(other.max()) - float(np.median(other)) > _BRIGHT


def _is_blacker(half: Picture, other: Picture) -> bool:
    dark = other[other <= np.quantile(other, 0.9)]
    apart = abs(float(np.median(other)) - float(np.median(half)))
    return float(dark.std()) > _NOISY or apart >= _OTHER_BLACK


class _Alike(NamedTuple):
    """Discs of the one half found in the other: their share, median distance, and its spread, pixels."""

    share: float
    off_px: Array
    spread_px: float

    @property
    def is_same(self) -> bool:
        """True if nothing but noise distinguishes the halves."""
        near = bool((np.abs(self.off_px) < _SAME_PX).all())
        return self.share >= _EQUAL and near and self.spread_px < _SPREAD_PX / 2


def _of_halves(found: Sequence[Blobs], samples: Sequence[Sample], *, is_flat: bool) -> Layout | None:
    """Layouts whose halves show the same discs: equal, or half a line apart."""
    lines, columns = samples[0].field.luma.shape
    for axis, length, twice, fields in (
        (1, lines, LayoutKind.TWICE_BELOW, LayoutKind.STACKED),
        (0, columns, LayoutKind.TWICE_BESIDE, LayoutKind.BESIDE),
    ):
        alike = [one for blobs in found if (one := _compared(blobs, axis, length / 2)) is not None]
        if length % 2 or len(alike) < _ALL * len(samples):
            continue
        if np.mean([one.is_same for one in alike]) >= _EQUAL:
            return Layout(twice)
        if np.median([one.share for one in alike]) < _MATCHED or not is_flat:
            continue
        # The object moves from field to field: what stands still shows how the lines lie.
        stillest = sorted(alike, key=lambda one: one.spread_px)[: max(1, len(alike) // 3)]
        off = np.median([one.off_px for one in stillest], axis=0)
        if stillest[-1].spread_px < _SPREAD_PX and np.abs(off).max() < _LEAST_DISCS:
            return Layout(fields, _upper_field(float(off[1])))
    return None


def _upper_field(lower_px: float) -> str:
    """The field in the upper or left half, by the rows by which discs lie lower in the other half."""
    if abs(abs(lower_px) - 0.5) > _HALF_LINE:
        return ""
    return "top" if lower_px < 0 else "bottom"


def _compared(blobs: Blobs, axis: int, half_px: float) -> _Alike | None:
    xy = blobs.xy_px
    first, second = xy[xy[:, axis] < half_px - 0.5], xy[xy[:, axis] >= half_px - 0.5]
    if min(len(first), len(second)) < _LEAST_DISCS:
        return None
    second = second - np.eye(2)[axis] * half_px
    i, j = pairs(first, second, _GATE * spacing_px(first))
    if len(i) < _LEAST_DISCS:
        return None
    off = second[j] - first[i]
    middle = np.median(off, axis=0)
    spread = float(np.median(np.abs(off - middle), axis=0).max()) / 0.6745
    return _Alike(2 * len(i) / (len(first) + len(second)), middle, spread)
