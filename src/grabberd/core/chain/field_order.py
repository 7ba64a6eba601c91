"""Check of the field order: do fields follow one another in time as delivered, judged by a moving object?

Where discs are seen, their paths tell; elsewhere, as before a moved hand, the differences of the pictures.

Field order by the differences of pictures, for scenes without discs, such as a moved hand.

The mean squared difference of two pictures grows with the square of the time between them, as long as the
movement is small compared with the moving details. So the difference from each field to the next, of the
other parity, is compared with the difference over two fields of one parity, which are two steps apart in any
order:

    right          top to bottom 1 step, bottom to top 1 step      1 : 1 in units of one step squared
    reversed       1 step and 3 steps                              1 : 9, less where the movement is fast
    same instant   no step and 2 steps                             0 : 4

Noise and the parities' different lines add the same amount to each of them at any time. The evidence is
therefore how the differences rise and fall together with the movement. Each half of the picture's bands is
compared with the movement in the other half (an instrumental variable), which keeps common noise out.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.chain.discs import LEAST_FIELDS, DiscMovement, DiscPaths, Share
from grabberd.core.field import BOTTOM, TOP, Field
from grabberd.core.reconstruction.field_order import Order

# Means over 4 x 2 pixels suppress noise and line jitter.
_MEAN_COLUMNS, _MEAN_ROWS = 4, 2
_BAND_ROWS = 12
_BLOCKS = 10
"""Blocks of time that the jackknife leaves out in turn."""
_SIGNIFICANT = 3.0
_CLEAR_OF_NOISE = 4.0
_OVERLAP = 3
"""Fields after which differences over two fields are independent of one another."""

_STEPS = (1, 2, 4)
"""Fields over which differences are taken."""

Picture = NDArray[np.float32]
_UNKNOWN: Array = np.full(2, np.nan)


class Ratio(NamedTuple):
    """A number with its standard deviation."""

    value: float
    sigma: float

    def is_within(self, low: float, high: float) -> bool:
        """True if the ratio lies significantly between the two limits."""
        reach = _SIGNIFICANT * self.sigma
        return low < self.value - reach and self.value + reach < high

    def __str__(self) -> str:
        return f"{self.value:.2f} ± {self.sigma:.2f}"


@dataclass(frozen=True, slots=True)
class FieldOrderFinding:
    """Result of a field order check.

    Attributes:
        order: verdict; `evidence`: the reason as a sentence.
        fields: number of fields examined.
        top_to_bottom: squared movement from a top field to the bottom field after it, in units of one field
            step squared; `bottom_to_top` likewise. None if too little moves.
    """

    order: Order
    evidence: str
    fields: int
    top_to_bottom: Ratio | None = None
    bottom_to_top: Ratio | None = None


class PictureDifferences:
    """Differences of a sequence of fields, of which only the newest are kept."""

    def __init__(self) -> None:
        self._newest: deque[tuple[Picture, int]] = deque(maxlen=_STEPS[-1] + 1)
        self._parities: list[int] = []
        self._over: dict[int, list[Array]] = {steps: [] for steps in _STEPS}

    def add(self, field: Field) -> None:
        """Take the next field; across two of one parity in a row there are no differences."""
        picture = _smoothed(field)
        if self._newest and self._newest[-1][1] == field.parity:
            self.interrupt()
        self._newest.append((picture, field.parity))
        self._parities.append(field.parity)
        for steps, found in self._over.items():
            follows = len(self._newest) > steps
            found.append(_difference(picture, self._newest[-1 - steps][0]) if follows else _UNKNOWN)

    def interrupt(self) -> None:
        """Pass over a gap of unknown length."""
        self._newest.clear()

    def finding(self) -> FieldOrderFinding:
        """Finding of the differences so far."""
        differences, count = self._differences(), len(self._parities)
        if min(len(one.near) for one in differences) < _BLOCKS:
            evidence = "too few fields follow one another without a gap"
            return FieldOrderFinding(Order.UNCLEAR, evidence, count)
        if _variation(np.concatenate([one.two_steps for one in differences])) < _CLEAR_OF_NOISE:
            order, evidence = _without_variation(np.concatenate([one.growth for one in differences]))
            return FieldOrderFinding(order, evidence, count)
        top, bottom = map(_Estimate, differences)
        ratios = top.power, bottom.power
        contrast = Ratio(4 * abs(top.whole - bottom.whole), 4 * _jackknife(top.without - bottom.without))
        order = _order(contrast, min(ratios))
        steps = f"top to bottom {ratios[0]}, bottom to top {ratios[1]} of one field step squared"
        return FieldOrderFinding(order, f"{steps}: {_MEANING[order]}", count, *ratios)

    def _differences(self) -> "list[_Differences]":
        """Differences of the steps from top to bottom, and of those from bottom to top."""
        # From field i on, though they were found at the later field.
        one, two, four = (
            np.array(self._over[steps][steps:] + steps * [_UNKNOWN]).reshape(-1, 2) for steps in _STEPS
        )
        i = np.arange(1, max(1, len(self._parities) - 4))
        # The two differences over two fields that contain this step: their mean is centred on it.
        around = (two[i - 1] + two[i]) / 2
        growth = (four[i] - (two[i] + two[i + 2]) / 2).sum(axis=1)
        whole = ~np.isnan(growth + around.sum(axis=1))
        of = np.asarray(self._parities, np.intp)[i]
        return [
            _Differences(one[i][chosen], around[chosen], growth[chosen])
            for chosen in (whole & (of == parity) for parity in (TOP, BOTTOM))
        ]


def _smoothed(field: Field) -> Picture:
    """Interpolate both parities to the same lines, half a frame line below the top rows, and smooth them."""
    grey = field.luma.astype(np.float32)
    beyond = grey[2:] if field.parity == TOP else grey[:-2]
    # The rows of a parity are two frame lines apart: half a line towards the next is a quarter of the way.
    between = 0.75 * grey[1:-1] + 0.25 * beyond
    size = (max(1, field.columns // _MEAN_COLUMNS), max(1, len(between) // _MEAN_ROWS))
    means = cv2.resize(between, size, interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(means, (0, 0), sigmaX=1.0).astype(np.float32, copy=False)


class _Differences(NamedTuple):
    """Mean squared differences, one row for each field of a parity whose neighbours are all present.

    Attributes:
        near: (fields, 2) difference to the next field, in each half of the picture's bands.
        two_steps: (fields, 2) difference over two fields around that step.
        growth: (fields,) difference over four steps minus difference over two.
    """

    near: Array
    two_steps: Array
    growth: Array


def _difference(picture: Picture, earlier: Picture) -> Array:
    """(2,) mean squared difference in each half of the bands."""
    rows = np.square(picture - earlier).mean(axis=1)
    bands = np.arange(len(rows)) // _BAND_ROWS % 2
    return np.array([rows[bands == band].mean() for band in (0, 1)])


class _Estimate:
    """Share of a step in the movement over two steps: from all fields, and without each block in turn.

    It is estimated from each half of the bands with the movement in the other half.
    """

    def __init__(self, differences: _Differences) -> None:
        near, two_steps = (one - one.mean(axis=0) for one in (differences.near, differences.two_steps))
        elsewhere = two_steps[:, ::-1]
        share, variation = (_blocks((one * elsewhere).sum(axis=1)) for one in (near, two_steps))
        self.whole = float(share.sum() / variation.sum())
        self.without = _without_each(share) / _without_each(variation)

    @property
    def power(self) -> Ratio:
        """The share in units of one field step squared."""
        # Two steps squared are four units.
        return Ratio(4 * self.whole, 4 * _jackknife(self.without))


def _order(contrast: Ratio, lesser: Ratio) -> Order:
    """Contrast is 0 for right, 4 for the same instant, 8 or less for reversed; lesser 1, 0 and 1."""
    if contrast.is_within(-2, 2):
        return Order.RIGHT
    if contrast.is_within(5, np.inf):
        return Order.REVERSED
    one_instant = contrast.is_within(3, 5) and lesser.is_within(-0.5, 0.5)
    return Order.SAME_INSTANT if one_instant else Order.UNCLEAR


_MEANING = {
    Order.RIGHT: "each field follows the one before (1 and 1)",
    Order.REVERSED: "the fields of a frame change places (1 and 9, less in fast movement)",
    Order.SAME_INSTANT: "both fields of a frame are of one instant (0 and 4)",
    Order.UNCLEAR: "not clearly 1 and 1, 1 and 9, or 0 and 4: move the object more slowly, or for longer",
}


def _blocks(values: Array) -> Array:
    """Sums over blocks of time, since neighbouring fields are not independent."""
    return np.array([block.sum() for block in np.array_split(values, _BLOCKS)])


def _without_each(blocks: Array) -> Array:
    return blocks.sum() - blocks


def _jackknife(without: Array) -> float:
    """Standard deviation of an estimate from those without each block in turn."""
    return float(np.sqrt((len(without) - 1) * np.var(without)))


def _variation(two_steps: Array) -> float:
    """Significance, in σ, with which differences in both halves of the bands vary together."""
    halves = two_steps - two_steps.mean(axis=0)
    power = float(np.sqrt(np.square(halves).sum(axis=0).prod()))
    covariation = float(halves.prod(axis=1).sum())
    return covariation / power * np.sqrt(len(halves) / _OVERLAP) if power > 0 else 0.0


def _without_variation(growth: Array) -> tuple[Order, str]:
    sigma = float(growth.std()) * np.sqrt(_OVERLAP / len(growth))
    if growth.mean() > _CLEAR_OF_NOISE * sigma:
        return Order.UNCLEAR, "the movement is too steady: move the object, pause, and move it again"
    return Order.NO_MOVEMENT, "too little movement: no pictures differ by more than their noise"


_LEAST_FIELDS = 60
_OF_DISCS = 0.5
"""Share of the fields that show discs, from which on these are what counts."""
_NO_ZIGZAG, _STEADY_NO_ZIGZAG = 0.18, 0.15
"""Zigzag of a right order, of all movement and of steady one. Both fields of one instant have 0.25."""
_LIKE_ONE_INSTANT = (0.17, 0.33)
_BACK_AND_FORTH = 0.45
"""Zigzag that no movement in the right order has."""


class OrderCheck:
    """Check of the order of fields as delivered. Nothing of a field is kept but its discs and differences."""

    def __init__(self) -> None:
        self._paths, self._differences = DiscPaths(), PictureDifferences()
        self._fields = self._following = 0
        self._parity: int | None = None
        self.offset_px: float | None = None
        """With the finding: frame lines by which discs lie lower in top fields than in bottom ones, 0 unless
        the parities have the wrong names; None if no discs show it."""

    def add(self, field: Field | None) -> None:
        """Take the next field; None for a gap of unknown length. Two of one parity in a row are one, too."""
        if field is None:
            self._paths.interrupt()
            self._differences.interrupt()
            self._parity = None
            return
        self._fields += 1
        self._following += self._parity is not None and field.parity != self._parity
        self._parity = field.parity
        self._paths.add(field)
        self._differences.add(field)

    def finding(self) -> FieldOrderFinding:
        """Finding of the fields so far; a verdict only if it is significant (3 σ)."""
        count, movement = self._fields, self._paths.movement()
        self.offset_px = movement.offset_px
        if self._following + 1 < _LEAST_FIELDS:
            evidence = f"{count} fields, too few of alternating parity: {_LEAST_FIELDS} are needed"
            return FieldOrderFinding(Order.UNCLEAR, evidence, count)
        if movement.fields < _OF_DISCS * count:
            return self._differences.finding()
        order = _order_of_paths(movement)
        ratios = _squared(movement.from_top), _squared(movement.from_bottom)
        return FieldOrderFinding(order, _evidence(order, movement, ratios), count, *ratios)


def check(fields: Iterable[Field | None]) -> FieldOrderFinding:
    """Checks the order of fields as delivered, on a few seconds of an object that moves.

    Nothing of a field is kept, so a driver may write over it when the next is requested. None is a gap.
    """
    order = OrderCheck()
    for field in fields:
        order.add(field)
    return order.finding()


def _order_of_paths(movement: DiscMovement) -> Order:
    if movement.zigzag.fields < LEAST_FIELDS and not movement.is_always_steady:
        return Order.NO_MOVEMENT
    zigzag, steady = movement.zigzag, movement.steady
    if zigzag.is_above(_BACK_AND_FORTH):
        return Order.REVERSED
    is_steadily_right = steady.is_below(_STEADY_NO_ZIGZAG) and zigzag.is_below(_BACK_AND_FORTH)
    if zigzag.is_below(_NO_ZIGZAG) or is_steadily_right:
        return Order.RIGHT
    least, most = _LIKE_ONE_INSTANT
    alike = steady.is_above(least) and steady.is_below(most) and least < zigzag.value < _BACK_AND_FORTH
    return Order.SAME_INSTANT if alike else Order.UNCLEAR


def _squared(step: Share) -> Ratio | None:
    """Steps of one field, squared, by the share of a step in the movement over two."""
    if step.fields < LEAST_FIELDS:
        return None
    length = 2 * step.value
    return Ratio(length**2, 2 * abs(length) * 2 * step.sigma)


_MEANING_OF_PATHS = {
    Order.RIGHT: "each field follows the one before (1 and 1, farther apart in sudden movement)",
    Order.REVERSED: "the fields of a frame change places (1 and 9)",
    Order.SAME_INSTANT: "both fields of a frame are of one instant (0 and 4)",
}


def _evidence(order: Order, movement: DiscMovement, ratios: tuple[Ratio | None, Ratio | None]) -> str:
    if order is Order.NO_MOVEMENT:
        seldom = f"discs move in only {movement.zigzag.fields} of {movement.fields} fields"
        still = seldom if movement.zigzag.fields else "no disc moves clearly from one field to the next"
        return f"too little movement: {still}"
    if order is Order.UNCLEAR:
        return _why_unclear(movement)
    zigzag = f"in {movement.zigzag.fields} fields the paths of discs zigzag by {movement.zigzag.value:.2f}"
    if None in ratios:
        return f"{zigzag} of the movement over two fields, squared: {_MEANING_OF_PATHS[order]}"
    return (
        f"top to bottom {ratios[0]}, bottom to top {ratios[1]} of one field step squared, and {zigzag} "
        f"of that over two: {_MEANING_OF_PATHS[order]}"
    )


def _why_unclear(movement: DiscMovement) -> str:
    if movement.is_always_steady:
        return "the movement is too steady: move the object, pause, and move it again"
    zigzag = Ratio(movement.zigzag.value, movement.zigzag.sigma)
    return (
        f"the paths of discs zigzag by {zigzag} of the movement over two fields, squared: not clearly 0 "
        "(right), 0.25 (both fields of one instant) or 1 (reversed): move it more slowly, or for longer"
    )
