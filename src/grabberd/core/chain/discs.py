"""Bright discs of an unknown size in fields of unknown origin, and which of them are one target from field to
field.

Field order by the paths of bright discs: where do fields lie that should follow one another in time?

From the places x of a disc in three successive fields follow its movement over two fields of one parity,
D = x(n+1) - x(n-1), which are two steps apart in any order, and its distance from the middle of the two,
z = x(n) - (x(n-1) + x(n+1)) / 2. In steps of one field:

    right          1, 1, 1, 1 …      z = 0       zigzag z² / D² = 0
    same instant   0, 2, 0, 2 …      z = ±1      zigzag 1/4
    reversed       3, -1, 3, -1 …    z = ±2      zigzag 1

A wall that snaps over within a field or two accelerates, so its zigzag lies between 0 and 1/4 in the right
order; nothing but a reversed order goes back after each step. Both fields are said to be of one instant only
by movement that is steady over five fields. An offset between the parities, from pointing or from a parity
of the wrong name, is constant; it is measured where nothing moves, else by its independence of the movement.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.chain.light import field_threshold
from grabberd.core.field import Field, quantise
from grabberd.core.measurement import ANY_DISC, Blobs, ThresholdRule, measure
from grabberd.errors import MeasurementError

_LOCATE = replace(ANY_DISC, method="template", line_shifts=False)
"""The centroid of small discs on the same lines differs from parity to parity by as much as they move."""
_LIKE = 2.0
"""Factor by which a target's diameter may differ from the usual one."""
_BRIGHTEST = 0.9
"""Share of a target's pixels that are darker than its middle."""
_LEVEL_HOLDS = 25
"""Fields after which the light is looked at again."""
_MOST = 2000
"""More spots than an object has targets: noise, or no discs at all."""
_GATE = 0.4
"""Share of the distance between neighbouring discs within which a disc is looked for."""
_ALIKE = 0.8
"""Least share of the discs that a field and the one before have in common."""

Ids = NDArray[np.int64]


def background(field: Field) -> float:
    """Grey level of most pixels."""
    return float(np.median(field.luma))


def peak(field: Field, level: int) -> float:
    """Grey level of the brightest pixels of what is above a level."""
    above = field.luma[field.luma > level]
    return float(np.quantile(above, _BRIGHTEST)) if len(above) else float(level)


def disc_level(field: Field) -> int | None:
    """The level half way up the discs, where blur makes them neither wider nor narrower; None without any."""
    try:
        threshold = field_threshold(field, ThresholdRule(), 8, doubled=False)
    except MeasurementError:
        return None
    return round((peak(field, threshold) + background(field)) / 2)


def diameters(blobs: Blobs) -> Array:
    """(N,) diameters of discs of the blobs' areas, frame pixels."""
    return np.asarray(np.sqrt(4 / np.pi * blobs.area_px))


def alike(blobs: Blobs) -> Blobs:
    """The blobs of the usual size: that of the one in whose disc the median bright pixel lies."""
    if not len(blobs):
        return blobs
    size = diameters(blobs)
    order = np.argsort(size)
    pixels = np.cumsum(blobs.area_px[order])  # by pixels, since specks of noise outnumber discs
    share = size / size[order][np.searchsorted(pixels, pixels[-1] / 2)]
    return blobs.select((share < _LIKE) & (share > 1 / _LIKE))


class DiscFinder:
    """Finder of the discs in a sequence of fields, whose light may change slowly."""

    def __init__(self) -> None:
        self._level: int | None = None
        self._fields = 0

    def find(self, field: Field) -> Blobs | None:
        """The discs that are seen whole, of whatever shape; None if there is nothing of the kind."""
        if self._fields % _LEVEL_HOLDS == 0 or self._level is None:
            self._level = disc_level(field) or self._level
        self._fields += 1
        if self._level is None:
            return None
        blobs = measure(quantise(field, 8, self._level), None, _LOCATE)
        return alike(blobs.select(~blobs.at_border)) if 0 < len(blobs) <= _MOST else None


def spacing_px(xy_px: Array) -> float:
    """Usual distance from a disc of (N, 2) to the nearest other one, frame pixels; NaN for fewer than two."""
    if len(xy_px) < 2:
        return np.nan
    return float(np.median(np.asarray(cKDTree(xy_px).query(xy_px, k=2)[0])[:, 1]))


def pairs(one: Array, other: Array, within_px: float) -> tuple[Indices, Indices]:
    """Indices of places (N, 2) and (M, 2) that are each other's nearest, and no farther apart than given."""
    if not len(one) or not len(other):
        nothing = np.zeros(0, np.intp)
        return nothing, nothing
    distance, there = (np.asarray(found) for found in cKDTree(other).query(one))
    back = np.asarray(cKDTree(one).query(other)[1])
    chosen = np.flatnonzero((distance <= within_px) & (back[there] == np.arange(len(one))))
    return chosen, there[chosen].astype(np.intp)


class _Chain:
    """Discs of the newest field of one parity: ids, places, and the movement that led there."""

    def __init__(self, ids: Ids, xy_px: Array, moved_px: Array) -> None:
        self.ids, self.xy_px, self.moved_px = ids, xy_px, moved_px


class DiscTracks:
    """Identities of discs from field to field, in whatever order the fields of a frame come.

    Fields of one parity follow one another in time in any order, so a disc is followed from one to the next
    by its movement; only where it appears is it looked for in the other parity.
    """

    def __init__(self) -> None:
        self._chains: dict[int, _Chain] = {}
        self._next = 0

    def restart(self) -> None:
        """Begin anew: what comes next is no continuation."""
        self._chains = {}

    def add(self, parity: int, xy_px: Array) -> Ids:
        """Ids of a field's discs (N, 2); discs that cannot be recognised get new ones."""
        ids, moved = np.full(len(xy_px), -1), np.zeros_like(xy_px)
        gate = _GATE * np.nan_to_num(spacing_px(xy_px), nan=0.0)
        own = self._chains.get(parity)
        if own is not None:
            before, now = pairs(own.xy_px + own.moved_px, xy_px, gate)
            # A grid that moves by its own pitch seems to stand still, but for its ends.
            if len(now) < _ALIKE * min(len(own.ids), len(xy_px)) - 1:
                self.restart()
            else:
                ids[now], moved[now] = own.ids[before], xy_px[now] - own.xy_px[before]
        other = self._chains.get(1 - parity)
        if other is not None:
            new, free = np.flatnonzero(ids < 0), np.flatnonzero(~np.isin(other.ids, ids))
            before, now = pairs(other.xy_px[free], xy_px[new], gate / 2)
            ids[new[now]] = other.ids[free[before]]
        new = np.flatnonzero(ids < 0)
        ids[new] = self._next + np.arange(len(new))
        self._next += len(new)
        self._chains[parity] = _Chain(ids, xy_px, moved)
        return ids


LEAST_DISCS = 3
"""Discs in a field that make it one of discs; moving ones that make it count: one or two may seem to move."""
LEAST_FIELDS = 6
"""Fields with movement below which nothing is said."""
_LEAST_PX = 0.2
"""Least movement from field to field."""
_ENOUGH_PX = 1.2
"""Movement from field to field beyond which more hardly counts."""
_CLEAR_OF_NOISE = 4.0
_STEADY = 0.4
"""Largest change of a steady movement from one step to the next."""
_LEAST_NOISE_PX = 0.03
_LEAST_OWN = 10
"""Third differences of a disc's path that show its own noise."""
_LEAST_AT_REST = 100
"""Places of discs at rest, or of discs at all, that show the offset between the parities."""
_RESTING = 0.25
"""Share of such places from which on an object is one that rests between its movements."""
_BLOCK = 100
_MARGIN = 2
"""Fields before and after a field that its evidence is taken from."""
_BLOCKS = 10
"""Blocks of time that the jackknife leaves out in turn."""
_SIGNIFICANT = 3.0
_LEAST_CHANGE = 0.1
"""Share of the movement that differs from its mean, from which on an offset is told apart from it."""


class Share:
    """A share of sums over blocks of time, judged by a jackknife: neighbouring fields share places.

    Args:
        evidence: (fields, 3) sums: what is judged, its unit, and discs.

    Attributes:
        fields: Number of fields that it was determined from; fewer than `LEAST_FIELDS` say nothing.
    """

    def __init__(self, evidence: Array) -> None:
        evidence = evidence[evidence[:, 2] > 0]
        size = np.maximum(evidence[:, :2].max(axis=1), 0) / evidence[:, 2]
        weight = 1 / (1 + size / (2 * _ENOUGH_PX) ** 2)
        weighted = evidence[:, :2] * weight[:, np.newaxis]
        self._sums = np.array([one.sum(axis=0) for one in np.array_split(weighted, _BLOCKS)])
        self.fields = len(evidence)

    @property
    def value(self) -> float:
        """The share; NaN if nothing is known."""
        judged, unit = self._sums.sum(axis=0)
        return float(judged / unit) if self.fields >= LEAST_FIELDS and unit > 0 else np.nan

    @property
    def sigma(self) -> float:
        """Standard deviation of the share."""
        return self._sigma(self.value) / float(self._sums[:, 1].sum())

    def is_below(self, limit: float) -> bool:
        """True if the share is significantly below a limit."""
        return self._significance(limit) < -_SIGNIFICANT

    def is_above(self, limit: float) -> bool:
        """True if the share is significantly above a limit."""
        return self._significance(limit) > _SIGNIFICANT

    def _significance(self, limit: float) -> float:
        """Distance of the share from a limit, in σ: of the share, or of what exceeds the limit where that is
        known better, as where a few blocks have nearly all movement.
        """
        judged, unit = self._sums.sum(axis=0)
        if not np.isfinite(self.value):
            return 0.0
        sigma = min(self._sigma(self.value), self._sigma(limit))
        return float((judged - limit * unit) / max(sigma, 1e-9 * unit))

    def _sigma(self, share: float) -> float:
        """Standard deviation of what is judged less a share of the unit: few blocks leave a ratio none."""
        left = self._sums[:, 0] - share * self._sums[:, 1]
        return float(np.sqrt((_BLOCKS - 1) * np.var(left.sum() - left)))


@dataclass(frozen=True, slots=True)
class DiscMovement:
    """Movement that the paths of discs show.

    Attributes:
        zigzag: Mean squared zigzag in units of the movement over two fields squared; `steady`: that of steady
            movement alone. NaN where too little moves.
        from_top: Step from a top field to the bottom field after it, in steps of one field; `from_bottom`
            likewise.
        offset_px: Lines by which discs lie lower in top fields than in bottom ones; None if unknown.
        fields: Fields with at least `LEAST_DISCS` discs.
        is_always_steady: True if discs move, but always alike: an offset between the parities looks the same.
    """

    zigzag: Share
    steady: Share
    from_top: Share
    from_bottom: Share
    offset_px: float | None
    fields: int
    is_always_steady: bool


class DiscPaths:
    """Paths of the discs in a sequence of fields. They are evaluated by blocks: fields are not kept."""

    def __init__(self) -> None:
        self._finder, self._tracks = DiscFinder(), DiscTracks()
        self._block: list[tuple[int, Ids, Array]] = []
        self._n = -1
        self._parity: int | None = None
        self._evidence: list[Array] = []
        self._offsets: list[float] = []
        self._fields = self._steady_fields = 0

    def add(self, field: Field) -> None:
        """Take the next field; two of one parity in a row mean that one was lost."""
        blobs = self._finder.find(field)
        xy = np.zeros((0, 2)) if blobs is None else blobs.xy_px
        self._fields += len(xy) >= LEAST_DISCS
        self._n = field.parity if self._parity is None else self._n + 1 + (field.parity == self._parity)
        self._parity = field.parity
        if self._block and self._n >= self._block[0][0] + _BLOCK + 2 * _MARGIN:
            self._evaluate()
            begin = self._block[0][0] + _BLOCK
            self._block = [one for one in self._block if one[0] >= begin]
        self._block.append((self._n, self._tracks.add(field.parity, xy), xy))

    def interrupt(self) -> None:
        """Pass over a gap of unknown length."""
        self._evaluate()
        self._block, self._parity = [], None
        self._tracks.restart()

    def movement(self) -> DiscMovement:
        """Movement that the paths show; fields added later are not among them."""
        self.interrupt()
        evidence = np.concatenate([np.zeros((0, 4, 3)), *self._evidence])
        offset_px = float(np.median(self._offsets)) if self._offsets else None
        zigzag, steady, from_top, from_bottom = (Share(evidence[:, kind]) for kind in range(4))
        is_always_steady = self._steady_fields > len(evidence)
        return DiscMovement(zigzag, steady, from_top, from_bottom, offset_px, self._fields, is_always_steady)

    def _evaluate(self) -> None:
        if len(self._block) <= 2 * _MARGIN:
            return
        block = _Block(*_matrix(self._block))
        offset = block.offset_px()
        if offset is None:
            self._steady_fields += int(block.moving.any(axis=1).sum())
            return
        if np.isfinite(block.across).sum() > 2 * _LEAST_AT_REST:
            self._offsets.append(2 * float(offset[1]))
        self._evidence.append(block.evidence(offset))


def _matrix(block: Sequence[tuple[int, Ids, Array]]) -> tuple[Array, int]:
    """(fields, discs, 2) places, NaN where a disc is not seen, and the number of the first field."""
    first, last = block[0][0], block[-1][0]
    known = np.unique(np.concatenate([ids for _, ids, _ in block]))
    places = np.full((last - first + 1, len(known), 2), np.nan)
    for n, ids, xy in block:
        places[n - first, np.searchsorted(known, ids)] = xy
    return places, first


class _Block:
    """Movement of F fields, each with its neighbours, and T discs; NaN compares as no movement.

    Args:
        places: (F + 2 margins, T, 2), top fields first by an even number.
        first_n: Number of the first field.

    Attributes:
        across: (F, T, 2) movement over two fields.
        moving: (F, T) True where it, or that of a neighbouring field, is clear of its noise.
    """

    def __init__(self, places: Array, first_n: int) -> None:
        self._places = places
        self._sign = np.where((np.arange(len(places)) + first_n) % 2 == 0, 1.0, -1.0).reshape(-1, 1, 1)
        self._variance = _variance(places)
        before, after = places[2:-2] - places[:-4], places[4:] - places[2:-2]
        self.across = places[3:-1] - places[1:-3]
        clear = np.maximum((2 * _LEAST_PX) ** 2, _CLEAR_OF_NOISE**2 * 4 * self._variance)
        moves = [_squared(one) > clear for one in (before, self.across, after)]
        self.moving = moves[0] | moves[1] | moves[2]
        change = _STEADY**2 * _squared(self.across) + 72 * self._variance
        is_steady = [_squared(one - self.across) < change for one in (before, after)]
        self._steady = moves[1] & is_steady[0] & is_steady[1]

    def offset_px(self) -> Array | None:
        """(2,) half of the constant offset between the parities; None if movement hides it."""
        off = _off_middle(self._places) * self._sign[_MARGIN:-_MARGIN] / 2
        seen = np.isfinite(off[..., 0])
        rest = off[seen & ~self.moving]
        is_shown = len(rest) >= _LEAST_AT_REST
        # Of an object that hardly ever rests, what seems to rest moves slowly.
        if is_shown and len(rest) >= _RESTING * seen.sum():
            return np.asarray(np.median(rest, axis=0))
        moving = seen & self.moving & np.isfinite(self.across[..., 0])
        off, across = off[moving], self.across[moving]
        if not len(off):
            return np.asarray(np.median(rest, axis=0)) if len(rest) else np.zeros(2)
        change = across - across.mean(axis=0) * (0, 1)  # no parity lies beside the other
        if np.square(change).sum() < _LEAST_CHANGE * np.square(across).sum():
            return np.asarray(np.median(rest, axis=0)) if is_shown else None
        slope = (off * change).sum() / np.square(change).sum()
        return np.asarray((off - slope * across).mean(axis=0) * (0, 1))

    def evidence(self, offset_px: Array) -> Array:
        """(fields with movement, 4, 3) sums: what is judged, its unit, and discs; of the zigzag of all
        movement and of steady one, and of the steps from either parity to the other.
        """
        places = self._places - self._sign * offset_px
        off = _off_middle(places)
        step = places[3:-1] - places[2:-2]
        around = (self.across + (places[4:] - places[2:-2])) / 2
        top = self._sign[_MARGIN:-_MARGIN, :, 0] > 0
        zigzag = _squared(off) - 3 * self._variance, _squared(self.across) - 4 * self._variance
        steps = (step * around).sum(axis=2) - 2 * self._variance, _squared(around) - 2 * self._variance
        sums = np.array(
            [
                _sums(self.moving, *zigzag),
                _sums(self._steady, *zigzag),
                _sums(self.moving & top, *steps),
                _sums(self.moving & ~top, *steps),
            ]
        )
        return np.asarray(sums.transpose(2, 0, 1)[sums[0, 2] > 0])


def _variance(places: Array) -> Array:
    """(T,) variance of a place in one coordinate: each disc's own, and at least the usual one."""
    third = _squared(places[6:] - 3 * places[4:-2] + 3 * places[2:-4] - places[:-6])
    known = np.isfinite(third)
    if not known.any():
        return np.full(places.shape[1], _LEAST_NOISE_PX**2)
    usual = float(np.median(third[known]))
    own = [
        float(np.median(one[of])) if of.sum() >= _LEAST_OWN else usual
        for one, of in zip(third.T, known.T, strict=True)
    ]
    # The median of the squares' sum is 1.39 of their mean variance, which is 20 times that of a place.
    return np.maximum(np.maximum(own, usual) / 1.39 / 20, _LEAST_NOISE_PX**2)


def _off_middle(places: Array) -> Array:
    """(F, T, 2) distance of a disc from the middle of its places in the fields before and after."""
    return places[2:-2] - (places[1:-3] + places[3:-1]) / 2


def _squared(vectors: Array) -> Array:
    return np.asarray(np.square(vectors).sum(axis=-1))


def _sums(chosen: Mask, judged: Array, unit: Array) -> Array:
    """(3, F) sums over the discs of each field, nothing where there are too few."""
    chosen = chosen & np.isfinite(judged) & np.isfinite(unit)
    discs = chosen.sum(axis=1)
    sums = np.array([np.where(chosen, judged, 0).sum(axis=1), np.where(chosen, unit, 0).sum(axis=1), discs])
    return sums * (discs >= LEAST_DISCS)
