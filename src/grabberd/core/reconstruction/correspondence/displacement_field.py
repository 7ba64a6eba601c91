"""Displacement field: a smooth field of the targets' displacements from their nominal positions.

The only assumption is that neighbouring targets move alike: the displacements are a Gaussian random field
with a Matérn 5/2 covariance over the targets' nominal distances, the same in X, Y and Z. The targets seen
then predict the others, with σ (kriging). This is the prior knowledge that decides correspondence where the
epipolar geometry cannot.

For objects of many targets it is computed by parts (*tiled*), at linear instead of quadratic cost. Near
targets screen the influence of far ones (kriging's screening effect). So every part of the object uses only
the targets in and around it, and a few from everywhere, in case a large area is hidden. From field to field
only parts in which a target appears or disappears are recomputed. On a grid of 864 targets that moves
predictions by a tenth of their σ (docs/decisions/measurement.md).

The kernel computes the same without a library of linear algebra, whose rounding depends on the number of its
threads (docs/decisions/measurement.md).
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.kernel import KERNEL, Kernel
from grabberd.core.reconstruction.object_model import ObjectModel

_KEPT = 32
"""Number of sets of seen targets whose predictors are kept, some 100 kB each."""
MOST_AT_ONCE = 512
"""Greatest number of targets whose field is computed as a whole."""
PART = 64
"""Greatest number of targets in a part."""
ROUND = 96
"""Number of targets used around a part."""
EVERYWHERE = 32
"""Approximate number of targets used from all over the object."""


@dataclass(frozen=True, slots=True)
class Smoothness:
    """Prior knowledge of an object's deformation.

    Attributes:
        sigma_mm: Standard deviation of a displacement in each of X, Y, Z.
        reach_mm: Correlation length: targets much nearer than this move alike.
        noise_mm: Standard deviation of a measured displacement around the smooth field.
    """

    sigma_mm: float = 3.0
    reach_mm: float = 30.0
    noise_mm: float = 0.15


NOMINAL_SHARE = 1 / 30
"""Share of the pitch up to which the common σ of the nominal positions widens the gates; with more, false
blobs are accepted in fast closures."""


class Expected(NamedTuple):
    """Prediction of each target from the *other* seen targets, leaving out its own measurement.

    Attributes:
        displacement_mm: (M, 3) predicted displacements.
        sigma_mm: (M,) their standard deviation in each coordinate: that of the target's own nominal position
            is in it as far as it exceeds the field's noise, the noise of its own measurement is not.
    """

    displacement_mm: Array
    sigma_mm: Array


class Say(NamedTuple):
    """Predictor of all M targets from K seen ones: `weights` (M, K) of their displacements, and `sigma_mm`
    (M,).

    The weights are stored column by column, as the kernel reads them.
    """

    weights: Array
    sigma_mm: Array


@dataclass(frozen=True, slots=True, eq=False)
class DisplacementField:
    """Field of an object of M targets.

    Attributes:
        nominal_mm: (M, 3) the targets' nominal positions.
        covariance_mm2: (M, M), of measured displacements.
        precision: (M, M), its inverse, in 1/mm².
        noise_mm: See `Smoothness`.
        most_kept: Number of sets of seen targets whose predictors are kept.
        kernel: Computes the predictors; None for numpy.
    """

    nominal_mm: Array
    covariance_mm2: Array
    precision: Array
    noise_mm: float
    most_kept: int = _KEPT
    kernel: Kernel | None = None
    _kept: "dict[bytes, Say]" = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(
        cls,
        nominal_mm: Array,
        smoothness: Smoothness,
        most_kept: int = _KEPT,
        variance_mm2: Array | float = 0.0,
        kernel: Kernel | None = KERNEL,
    ) -> "DisplacementField":
        """Make the field of targets at nominal positions (M, 3).

        Args:
            nominal_mm: (M, 3) the positions.
            smoothness: Prior knowledge of the deformation.
            most_kept: Number of sets of seen targets whose predictors are kept.
            variance_mm2: (M,) variance of each position beyond the noise that `smoothness` has for all.
            kernel: Inverts the covariance and computes the predictors; None for numpy.
        """
        apart = np.linalg.norm(nominal_mm[:, np.newaxis] - nominal_mm, axis=2) / smoothness.reach_mm
        scaled = np.sqrt(5.0) * apart
        covariance = smoothness.sigma_mm**2 * (1.0 + scaled + scaled * scaled / 3.0) * _exp(-scaled)
        covariance[np.diag_indices(len(nominal_mm))] += smoothness.noise_mm**2 + variance_mm2
        if kernel is None:
            precision = np.linalg.inv(covariance)
        else:
            kernel.precision(covariance, precision := np.empty_like(covariance))
            if not np.isfinite(precision).all():
                raise np.linalg.LinAlgError("targets in one place, whose measurements have no noise")
        return cls(nominal_mm, covariance, precision, smoothness.noise_mm, most_kept, kernel)

    def expect(self, seen: Indices, displacement_mm: Array) -> Expected:
        """Predict all targets: an unseen one from all seen ones, a seen one from all but itself.

        Args:
            seen: (K,) indices of the targets that have been measured, ascending.
            displacement_mm: (K, 3) their displacements.
        """
        say = self.say(seen)
        return Expected(say.weights @ np.ascontiguousarray(displacement_mm), say.sigma_mm)

    def say(self, inside: Indices) -> Say:
        """Make or recall the predictor of all targets from some (K,), ascending.

        From field to field mostly the same targets are seen, so predictors are kept.
        """
        key = inside.tobytes()
        say = self._kept.get(key)
        if say is None:
            if len(self._kept) >= self.most_kept:
                self._kept.clear()
            seen = np.zeros(len(self.precision), np.bool_)
            seen[inside] = True
            say = self._say_by_kernel(seen, len(inside)) if self.kernel else self._say_by_numpy(seen)
            say.sigma_mm.setflags(write=False)
            self._kept[key] = say
        return say

    def _say_by_kernel(self, seen: Mask, count: int) -> "Say":
        assert self.kernel is not None
        targets = len(self.precision)
        weights, sigma_mm = np.empty((count, targets)), np.empty(targets)
        self.kernel.predictor(self.covariance_mm2, self.precision, self.noise_mm**2, seen, weights, sigma_mm)
        return Say(weights.T, sigma_mm)

    def _say_by_numpy(self, seen: Mask) -> "Say":
        inside, outside = np.flatnonzero(seen), np.flatnonzero(~seen)
        own = self.precision[inside[:, np.newaxis], inside]
        cross = self.precision[outside[:, np.newaxis], inside]
        hidden = np.linalg.inv(self.precision[outside[:, np.newaxis], outside])
        guess = -(hidden @ cross)
        pull = own + cross.T @ guess
        weights, variance = np.empty((len(inside), len(self.precision))).T, np.empty(len(self.precision))
        variance[inside], variance[outside] = 1.0 / np.diag(pull), np.diag(hidden)
        weights[inside] = np.eye(len(inside)) - pull * variance[inside, np.newaxis]
        weights[outside] = guess
        return Say(weights, np.sqrt(np.maximum(variance - self.noise_mm**2, 0.0)))


class _Part(NamedTuple):
    """Targets used by a part, (A,) indices starting with its `own` ones, and their field."""

    asked: Indices
    own: int
    field: DisplacementField


class _Told(NamedTuple):
    """Weights that predict a part's targets, given as indices, from some `rows` of those seen."""

    targets: Indices
    rows: Indices
    weights: Array


class _Say(NamedTuple):
    """Predictor of all targets from a set of seen ones, which `key` holds as bytes; `sigma_mm` (M,)."""

    key: bytes
    parts: list[_Told]
    sigma_mm: Array


class TiledField:
    """Field of an object of M targets, like `DisplacementField`, by parts."""

    def __init__(
        self,
        nominal_mm: Array,
        smoothness: Smoothness,
        variance_mm2: Array | float = 0.0,
        kernel: Kernel | None = KERNEL,
    ) -> None:
        self.nominal_mm = nominal_mm
        self.noise_mm = smoothness.noise_mm
        targets = np.arange(len(nominal_mm))
        regions = _parted(nominal_mm, targets, -(-len(targets) // EVERYWHERE))
        everywhere = np.array([region[len(region) // 2] for region in regions])
        parts = _parted(nominal_mm, targets, PART)
        variance_mm2 = np.broadcast_to(variance_mm2, len(targets))
        self._parts = [
            _part(nominal_mm, np.sort(one), everywhere, smoothness, variance_mm2, kernel) for one in parts
        ]
        self._last: _Say | None = None

    def expect(self, seen: Indices, displacement_mm: Array) -> Expected:
        """Predict as `DisplacementField.expect`."""
        displacement_mm = np.ascontiguousarray(displacement_mm)
        say, key = self._last, seen.tobytes()
        if say is None or say.key != key:
            say = self._last = self._say(key, seen)
        expected_mm = np.empty_like(self.nominal_mm)
        for part in say.parts:
            expected_mm[part.targets] = part.weights @ displacement_mm[part.rows]
        return Expected(expected_mm, say.sigma_mm)

    def _say(self, key: bytes, seen: Indices) -> _Say:
        told, sigma_mm = [], np.empty(len(self.nominal_mm))
        for part in self._parts:
            there = np.isin(part.asked, seen)
            own, targets = part.field.say(np.flatnonzero(there)), part.asked[: part.own]
            weights = np.asfortranarray(own.weights[: part.own])
            told.append(_Told(targets, np.searchsorted(seen, part.asked[there]), weights))
            sigma_mm[targets] = own.sigma_mm[: part.own]
        sigma_mm.setflags(write=False)
        return _Say(key, told, sigma_mm)


def field_of(
    model: ObjectModel, smoothness: Smoothness, pitch_mm: float, kernel: Kernel | None = KERNEL
) -> "DisplacementField | TiledField":
    """Make the field of an object: as a whole for few targets, by parts for many."""
    common_mm = min(model.sigma_mm, NOMINAL_SHARE * pitch_mm)
    sigma_mm = np.full(len(model), common_mm) if model.own_sigma_mm is None else model.own_sigma_mm
    sigma_mm = np.where(np.isnan(sigma_mm), common_mm, sigma_mm)
    variance_mm2 = np.maximum(sigma_mm**2 - smoothness.noise_mm**2, 0.0)
    if len(model) <= MOST_AT_ONCE:
        return DisplacementField.of(model.xyz_mm, smoothness, variance_mm2=variance_mm2, kernel=kernel)
    return TiledField(model.xyz_mm, smoothness, variance_mm2, kernel)


def _exp(values: Array) -> Array:
    """The exponentials by the C library: numpy's have other last bits with other vector units."""
    return np.vectorize(math.exp, otypes=[np.float64])(values)


def _parted(nominal_mm: Array, targets: Indices, most: int) -> list[Indices]:
    """Halve across the longest side until no part has more than `most` targets."""
    if len(targets) <= most:
        return [targets]
    xyz_mm = nominal_mm[targets]
    side = int(np.ptp(xyz_mm, axis=0).argmax())
    order = targets[xyz_mm[:, side].argsort(kind="stable")]
    halves = np.split(order, [len(order) // 2])
    return [part for half in halves for part in _parted(nominal_mm, half, most)]


def _part(
    nominal_mm: Array,
    targets: Indices,
    everywhere: Indices,
    smoothness: Smoothness,
    variance_mm2: Array,
    kernel: Kernel | None,
) -> _Part:
    own = nominal_mm[targets]
    beyond = nominal_mm - nominal_mm.clip(own.min(axis=0), own.max(axis=0))
    away = (beyond * beyond).sum(axis=1)
    away[targets] = np.inf
    near = away.argsort(kind="stable")[:ROUND]
    others = np.setdiff1d(np.union1d(near, everywhere), targets)
    asked = np.concatenate([targets, others])
    field = DisplacementField.of(nominal_mm[asked], smoothness, 1, variance_mm2[asked], kernel)
    return _Part(asked, len(targets), field)
