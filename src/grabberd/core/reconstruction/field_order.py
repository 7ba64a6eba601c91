"""Field order by the points: do fields follow one another in time as they are numbered?

Field n is numbered n, but may have been exposed at the time n + a (-1)^n: a is 0 if the order is right, 1 or
-1 if the two fields of each frame change places, and 1/2 or -1/2 if both show one instant. Seen from the
fields around it, of the other parity, field n then lies d = 2 a (-1)^n fields later than its number says.

For each of these five values, the place of a target d fields later is interpolated from the other parity,
whose fields are in sequence in any order, and compared with where field n shows it. What is left is

    z(n) = 2 (a - a0) (-1)^n v(n) + (-1)^n c + noise

where v is the velocity at that time and a0 the assumed value. So z, taken with the parity's sign, is adjusted
to v: the verdict is the only value about which nothing significant remains. A constant offset c between the
parities, as pointing may have it, is removed and no evidence. v is antisymmetric in the places that both are
taken from and z symmetric, so that the noise of one is independent of that of the other.

Where a target moves too suddenly to be interpolated, nothing follows from it, and it is left out: a wall that
snaps over between two frames looks as if both fields of each were of one instant.
"""

from collections import deque
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.reconstruction.points import Points

BLOCK = 100
"""Fields evaluated together, two seconds: within them the offset between the parities is constant."""
PAUSE = 400
"""Fields left out after a block once the order is known: a device hardly ever changes it."""
REACH = 5
"""Fields before and after a field that its place is interpolated from."""
KEPT = 300
"""Fields with movement that count, the newest: half a minute of a milking."""
LEAST_FIELDS = 12
"""Least number of fields with movement, weighted by it."""
LEAST_TARGETS = 3
"""Moving targets of such a field; pointing may let one or two seem to move."""
LEAST_MM = 0.05
"""Least movement from field to field; slower, a reversed order does little harm, and pointing's much."""
ENOUGH_MM = 0.3
"""Movement from field to field beyond which more hardly counts: it is interpolated worse."""
CLEAR_OF_NOISE = 4.0
SUDDEN = 1.0
"""Largest third difference of a smooth movement, in units of its first difference."""
SIGNIFICANT = 4.0
MODEL_SIGMA = 0.02
"""σ of the shift from movements that four places describe only nearly."""
_OVERLAP = 4
"""Consecutive fields share most of their neighbours: four of them count as one."""
_THIRD_VARIANCE = 20.0
_VELOCITY_VARIANCE = 2 * (27**2 + 1) / 48**2

_OFFSETS = (-5, -3, -1, 1, 3, 5)
"""Fields of the other parity around a field."""
_BETWEEN, _SLOPE = np.array([-1, 9, 9, -1]) / 16, np.array([1, -27, 27, -1]) / 48
"""Place and velocity in the middle of four places that lie two fields apart."""
_THIRD = np.array([-1, 3, -3, 1])


def _stencil(first: int, weights: Array) -> Array:
    stencil = np.zeros(len(_OFFSETS))
    stencil[first : first + len(weights)] = weights
    return stencil


_LATER = (-2, -1, 0, 1, 2)
"""The values of d, in fields."""
_PLACES = np.array(
    [
        _stencil(0, _BETWEEN),
        _stencil(2, np.ones(1)),
        _stencil(1, _BETWEEN),
        _stencil(3, np.ones(1)),
        _stencil(2, _BETWEEN),
    ]
)
_VELOCITIES = np.array(
    [
        _stencil(0, _SLOPE),
        _stencil(1, np.array([-1, 0, 1]) / 4),
        _stencil(1, _SLOPE),
        _stencil(2, np.array([-1, 0, 1]) / 4),
        _stencil(2, _SLOPE),
    ]
)
_THIRDS = np.array([_stencil(first, _THIRD) for first in range(3)])
_FIRSTS = np.array([_stencil(first, np.array([-1, 1])) for first in (1, 2, 3)])


class Order(StrEnum):
    """Field order as pictures or points show it."""

    RIGHT = "right"
    REVERSED = "reversed"
    SAME_INSTANT = "same_instant"
    NO_MOVEMENT = "no_movement"
    UNCLEAR = "unclear"


KNOWN = frozenset({Order.RIGHT, Order.REVERSED, Order.SAME_INSTANT})
"""Verdicts that tell the order."""


@dataclass(frozen=True, slots=True)
class FieldOrderFit:
    """Field order by the points.

    Attributes:
        order: Verdict in one word.
        shift_fields: Time by which each second field is displaced against its number, in fields: 0 if the
            order is right, 1/2 for fields of one instant, 1 if it is reversed; NaN if nothing is known.
        sigma_fields: Its standard deviation.
        zigzag_mm: Root mean square distance, over the moving targets, between the points of a field and the
            path through the fields around it that the shift causes; NaN if nothing is known.
        fields: Number of fields with movement that it was determined from.
    """

    order: Order
    shift_fields: float
    sigma_fields: float
    zigzag_mm: float
    fields: int


class FieldOrderCheck:
    """Field order by the points of a stream of fields, lost ones left out.

    Args:
        target: Ids of the object model's targets, ascending.
        kept: Number of fields with movement that count, the newest.
    """

    def __init__(self, target: NDArray[np.int32], kept: int = KEPT) -> None:
        self._target = target
        self._xyz_mm = np.full((BLOCK + 2 * REACH, len(target), 3), np.nan)
        self._variance_mm2 = np.full(self._xyz_mm.shape[:2], np.nan)
        self._first_n: int | None = None
        self._last_n = -1
        self._resume_n: int | None = None
        self._evidence: deque[Array] = deque(maxlen=kept)

    def add(self, n: int, points: Points) -> bool:
        """Add a field's points.

        Args:
            n: The field's number, as even or odd as its parity. A number that goes back begins a new stream.
            points: Its points, possibly none.

        Returns:
            True if a block of fields has been evaluated, so that a new fit may say something else.
        """
        if self._pauses(n):
            return False
        evaluated = self._is_full(n)
        if evaluated:
            self._evaluate()
            if self.fit().order in KNOWN:
                self._first_n, self._resume_n = None, n + PAUSE
                return True
        row = self._row(n)
        at = np.searchsorted(self._target, points.target)
        self._xyz_mm[row, at] = points.xyz_mm
        xx, yy, zz = points.covariance_mm2.reshape(-1, 9)[:, ::4].T
        self._variance_mm2[row, at] = xx + yy + zz  # np.trace takes as long as all else
        return evaluated

    def fit(self) -> FieldOrderFit:
        """Field order by the blocks evaluated so far."""
        return _fit(np.array(self._evidence).reshape(-1, len(_EVIDENCE), len(_LATER)))

    def finish(self) -> FieldOrderFit:
        """Field order by all fields added; the next one begins a new stream."""
        self._end_stream()
        self._last_n = -1
        return self.fit()

    def _pauses(self, n: int) -> bool:
        goes_on = n > self._last_n
        self._last_n = n
        if not goes_on:
            self._end_stream()
        return self._resume_n is not None and n < self._resume_n

    def _end_stream(self) -> None:
        if self._first_n is not None:
            self._evaluate()
        self._first_n = self._resume_n = None

    def _is_full(self, n: int) -> bool:
        return self._first_n is not None and n >= self._first_n + len(self._xyz_mm)

    def _row(self, n: int) -> int:
        """The field's row, in a block that goes on from the last one where it can."""
        if self._first_n is None or self._is_full(n):
            follows = self._first_n is not None and n == self._first_n + len(self._xyz_mm)
            kept = 2 * REACH if follows else 0
            for one in (self._xyz_mm, self._variance_mm2):
                one[:kept] = one[len(one) - kept :]
                one[kept:] = np.nan
            self._first_n = n - kept
        return n - self._first_n

    def _evaluate(self) -> None:
        """Add a row for each field with movement; whatever is NaN does not move."""
        assert self._first_n is not None
        around = np.stack([self._at(offset) for offset in _OFFSETS])
        moving = _is_moving(around[1:5], self._variance_mm2[REACH:-REACH])
        field, target = np.nonzero(moving & (moving.sum(axis=1) >= LEAST_TARGETS)[:, np.newaxis])
        around, place = around[:, field, target], self._at(0)[field, target]
        smooth = _is_smooth(around, place, self._variance_mm2[REACH:-REACH][field, target])
        if smooth.any():
            field, target = field[smooth], target[smooth]
            even = (self._first_n + REACH + field) % 2 == 0
            self._evidence.extend(_evidence(around[:, smooth], place[smooth], even, field, target))

    def _at(self, offset: int) -> Array:
        return self._xyz_mm[REACH + offset : len(self._xyz_mm) - REACH + offset]


def _is_moving(around: Array, variance_mm2: Array) -> Mask:
    """(F, T) True where the velocity is clear of its noise."""
    velocity = np.tensordot(_SLOPE, around, 1)
    clear = np.maximum(LEAST_MM**2, CLEAR_OF_NOISE**2 * _VELOCITY_VARIANCE * variance_mm2)
    return _squared(velocity) > clear


def _is_smooth(around: Array, place: Array, variance_mm2: Array) -> Mask:
    """(K,) True where the places are known and allow interpolation."""
    third, first = (
        _squared(np.tensordot(stencils, around, 1)).max(axis=0) for stencils in (_THIRDS, _FIRSTS)
    )
    noise = CLEAR_OF_NOISE**2 * _THIRD_VARIANCE * variance_mm2
    return (third <= SUDDEN**2 * first + noise) & np.isfinite(place[:, 0])


_EVIDENCE = ("product", "square", "targets")
"""Rows of a field's evidence: departure times velocity, velocity squared, moving targets; for each shift."""


def _evidence(around: Array, place: Array, even: Mask, field: Indices, target: Indices) -> Array:
    """(fields with movement, 3, 5) sums over the moving targets of each field.

    Args:
        around: (6, K, 3) places of K moving targets in the fields around theirs.
        place: (K, 3) places in their own field.
        even: (K,) True for fields of the even parity.
        field: (K,) index of the field, ascending.
        target: (K,) index of the target.
    """
    sign = np.where(even, 1.0, -1.0)[:, np.newaxis]
    # A value of a stands for d = 2 a in even fields, and for d = -2 a in odd ones.
    later = np.where(even, 1, -1) * np.array(_LATER)[:, np.newaxis] + len(_LATER) // 2
    own = np.arange(len(place))
    departure = (place - np.tensordot(_PLACES, around, 1)[later, own]) * sign
    velocity = np.tensordot(_VELOCITIES, around, 1)[later, own]
    departure, velocity = _without_means(departure, target), _without_means(velocity, target)
    sums = np.stack(
        [(departure * velocity).sum(axis=2), np.square(velocity).sum(axis=2), np.ones(later.shape)]
    )
    starts = np.flatnonzero(np.diff(field, prepend=-1))
    return np.add.reduceat(sums, starts, axis=2).transpose(2, 0, 1)


def _squared(vectors: Array) -> Array:
    return np.square(vectors).sum(axis=-1)


def _without_means(vectors: Array, target: Indices) -> Array:
    """Subtract each target's mean from (5, K, 3)."""
    sums = np.zeros((target.max() + 1, len(vectors), 3))
    np.add.at(sums, target, vectors.transpose(1, 0, 2))
    means = sums / np.maximum(np.bincount(target), 1)[:, np.newaxis, np.newaxis]
    return vectors - means[target].transpose(1, 0, 2)


def _fit(evidence: Array) -> FieldOrderFit:
    nothing = FieldOrderFit(Order.NO_MOVEMENT, np.nan, np.nan, np.nan, len(evidence))
    if not len(evidence):
        return nothing
    product, square, targets = evidence.transpose(1, 0, 2)
    weight = 1 / (1 + square / targets / ENOUGH_MM**2)
    product, square = product * weight, square * weight
    if (square.sum(axis=0) ** 2 <= LEAST_FIELDS * np.square(square).sum(axis=0)).any():
        return replace(nothing, order=Order.UNCLEAR)
    left = product.sum(axis=0) / (2 * square.sum(axis=0))
    misfit = product - 2 * left * square
    spread = np.sqrt(_OVERLAP * np.square(misfit).sum(axis=0)) / (2 * square.sum(axis=0))
    sigma = np.hypot(spread, MODEL_SIGMA)
    found = _SHIFTS + left
    fitting = (found - SIGNIFICANT * sigma > _LEAST) & (found + SIGNIFICANT * sigma < _MOST)
    best = int(np.argmin(np.abs(left) + SIGNIFICANT * sigma))
    shift = abs(float(found[best]))
    speed = float(np.sqrt(evidence[:, 1, 2].sum() / evidence[:, 2, 2].sum()))
    order = _BY_SHIFT[np.argmax(fitting)] if fitting.sum() == 1 else Order.UNCLEAR
    return FieldOrderFit(order, shift, float(sigma[best]), 2 * shift * speed, len(evidence))


_BY_SHIFT = (Order.REVERSED, Order.SAME_INSTANT, Order.RIGHT, Order.SAME_INSTANT, Order.REVERSED)
_SHIFTS = np.array(_LATER) / 2
_LEAST = np.array([-1.6, -0.75, -0.25, 0.25, 0.75])
_MOST = -_LEAST[::-1]
"""The five values of a, and the limits of each; movements hard to follow exaggerate the outermost."""
