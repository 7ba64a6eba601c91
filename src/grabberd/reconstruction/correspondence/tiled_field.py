"""The displacement field of an object of many targets, by parts: the cost grows with them, not their square.

Near targets hide what far ones would say (kriging's screening). So every part of the object asks only those
who are in it or round it, and a few from everywhere, for where a large area is hidden. From field to field
only the parts in which somebody comes or goes are worked out anew.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.reconstruction.correspondence.displacement_field import DisplacementField, Expected, Smoothness
from grabberd.reconstruction.object_model import ObjectModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MOST_AT_ONCE = 512
"""Of an object of more targets the field is taken by parts."""
PART = 64
"""Targets of a part, at most."""
ROUND = 96
"""Targets round a part."""
EVERYWHERE = 32
"""Targets from all over the object, about."""


class _Part(NamedTuple):
    """Whom a part asks, (A,) indices, of which its own targets are the first; and their field."""

    asked: Indices
    own: int
    field: DisplacementField


class _Told(NamedTuple):
    """By whom a part's targets are told, indices both, and with which weights."""

    targets: Indices
    seen: Indices
    weights: Array


class _Say(NamedTuple):
    """What the targets of a set, by its bytes, say of all: `sigma_mm` (M,)."""

    key: bytes
    parts: list[_Told]
    sigma_mm: Array


class TiledField:
    """The field of an object of M targets, as `DisplacementField`, by parts."""

    def __init__(self, nominal_mm: Array, smoothness: Smoothness) -> None:
        self.nominal_mm = nominal_mm
        self.noise_mm = smoothness.noise_mm
        targets = np.arange(len(nominal_mm))
        regions = _parted(nominal_mm, targets, -(-len(targets) // EVERYWHERE))
        everywhere = np.array([region[len(region) // 2] for region in regions])
        parts = _parted(nominal_mm, targets, PART)
        self._parts = [_part(nominal_mm, np.sort(one), everywhere, smoothness) for one in parts]
        self._last: _Say | None = None

    def expect(self, seen: NDArray[np.bool_], displacement_mm: Array) -> Expected:
        """As `DisplacementField.expect`."""
        say, key = self._last, seen.tobytes()
        if say is None or say.key != key:
            say = self._last = self._say(key, seen)
        expected_mm = np.empty_like(self.nominal_mm)
        for part in say.parts:
            expected_mm[part.targets] = part.weights @ displacement_mm[part.seen]
        return Expected(expected_mm, say.sigma_mm)

    def _say(self, key: bytes, seen: NDArray[np.bool_]) -> _Say:
        told, sigma_mm = [], np.empty(len(self.nominal_mm))
        for part in self._parts:
            there = seen[part.asked]
            own, targets = part.field.say(np.flatnonzero(there)), part.asked[: part.own]
            weights = np.asfortranarray(own.weights[: part.own])
            told.append(_Told(targets, part.asked[there], weights))
            sigma_mm[targets] = own.sigma_mm[: part.own]
        sigma_mm.setflags(write=False)
        return _Say(key, told, sigma_mm)


def field_of(model: ObjectModel, smoothness: Smoothness) -> "DisplacementField | TiledField":
    """The field of an object: of few targets as a whole, of many by parts."""
    if len(model) <= MOST_AT_ONCE:
        return DisplacementField.of(model, smoothness)
    return TiledField(model.xyz_mm, smoothness)


def _parted(nominal_mm: Array, targets: Indices, most: int) -> list[Indices]:
    """Halved across the longest side until no part has more."""
    if len(targets) <= most:
        return [targets]
    places = nominal_mm[targets]
    side = int(np.ptp(places, axis=0).argmax())
    order = targets[places[:, side].argsort(kind="stable")]
    halves = np.split(order, [len(order) // 2])
    return [part for half in halves for part in _parted(nominal_mm, half, most)]


def _part(nominal_mm: Array, targets: Indices, everywhere: Indices, smoothness: Smoothness) -> _Part:
    own = nominal_mm[targets]
    beyond = nominal_mm - nominal_mm.clip(own.min(axis=0), own.max(axis=0))
    away = (beyond * beyond).sum(axis=1)
    away[targets] = np.inf
    near = away.argsort(kind="stable")[:ROUND]
    others = np.setdiff1d(np.union1d(near, everywhere), targets)
    asked = np.concatenate([targets, others])
    return _Part(asked, len(targets), DisplacementField.through(nominal_mm[asked], smoothness, most_kept=1))
