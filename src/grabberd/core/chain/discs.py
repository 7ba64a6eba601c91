"""Bright discs of an unknown size in fields of unknown origin, and which of them are one target from field to
field.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from grabberd.core.chain.thresholds import field_threshold
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

Array = NDArray[np.float64]
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


def pairs(one: Array, other: Array, within_px: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
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
