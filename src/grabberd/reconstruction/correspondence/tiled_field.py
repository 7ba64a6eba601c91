"""Tiled displacement field for objects of many targets: computed by parts, at linear instead of quadratic
cost.

Near targets screen the influence of far ones (kriging's screening effect). So every part of the object uses
only the targets in and around it, and a few from everywhere, in case a large area is hidden. From field to
field only parts in which a target appears or disappears are recomputed. On a grid of 864 targets that moves
predictions by a tenth of their σ (docs/decisions/0014).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.reconstruction.correspondence.displacement_field import DisplacementField, Expected, Smoothness
from grabberd.reconstruction.object_model import ObjectModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MOST_AT_ONCE = 512
"""Greatest number of targets whose field is computed as a whole."""
PART = 64
"""Greatest number of targets in a part."""
ROUND = 96
"""Number of targets used around a part."""
EVERYWHERE = 32
"""Approximate number of targets used from all over the object."""


class _Part(NamedTuple):
    """Targets used by a part, (A,) indices starting with its `own` ones, and their field."""

    asked: Indices
    own: int
    field: DisplacementField


class _Told(NamedTuple):
    """Weights that predict a part's targets from seen ones, both given as indices."""

    targets: Indices
    seen: Indices
    weights: Array


class _Say(NamedTuple):
    """Predictor of all targets from a set of seen ones, which `key` holds as bytes; `sigma_mm` (M,)."""

    key: bytes
    parts: list[_Told]
    sigma_mm: Array


class TiledField:
    """Field of an object of M targets, like `DisplacementField`, by parts."""

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
        """Predict as `DisplacementField.expect`."""
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
    """Make the field of an object: as a whole for few targets, by parts for many."""
    if len(model) <= MOST_AT_ONCE:
        return DisplacementField.of(model, smoothness)
    return TiledField(model.xyz_mm, smoothness)


def _parted(nominal_mm: Array, targets: Indices, most: int) -> list[Indices]:
    """Halve across the longest side until no part has more than `most` targets."""
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
