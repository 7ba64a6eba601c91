"""How far an object's targets are from their nominal places: a smooth field over the object.

Neighbouring targets move alike, and that is all that is assumed: the displacements are a Gaussian random
field with a Matérn 5/2 covariance over the targets' nominal distances, the same in X, Y and Z. What some
targets show then says where the others are, and how surely (kriging). This is the prior knowledge that
decides correspondence where the epipolar geometry cannot.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.reconstruction.object_model import ObjectModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_KEPT = 32
"""For so many sets of seen targets it is kept what they say, some 100 kB each."""


@dataclass(frozen=True, slots=True)
class Smoothness:
    """What is known of an object's deformation beforehand.

    Attributes:
        sigma_mm: standard deviation of a displacement in each of X, Y, Z.
        reach_mm: correlation length: targets much nearer than this move alike.
        noise_mm: standard deviation of a measured displacement around the smooth field.
    """

    sigma_mm: float = 3.0
    reach_mm: float = 30.0
    noise_mm: float = 0.15


class Expected(NamedTuple):
    """What the *other* seen targets say of each target, its own measurement left out.

    Attributes:
        displacement_mm: (M, 3) the displacement that they make it have.
        sigma_mm: (M,) its standard deviation in each coordinate, without the noise of the target's own
            measurement.
    """

    displacement_mm: Array
    sigma_mm: Array


class Say(NamedTuple):
    """What K seen targets of M say of all: `sigma_mm` (M,), and `weights` (M, K) of their displacements.

    These lie column by column in memory.
    """

    weights: Array
    sigma_mm: Array


@dataclass(frozen=True, slots=True, eq=False)
class DisplacementField:
    """The field of an object of M targets.

    Attributes:
        nominal_mm: (M, 3) the targets' nominal places.
        precision: (M, M), inverse of the covariance of measured displacements, in 1/mm².
        noise_mm: see `Smoothness`.
        most_kept: for how many sets of seen targets it is kept what they say.
    """

    nominal_mm: Array
    precision: Array
    noise_mm: float
    most_kept: int = _KEPT
    _kept: "dict[bytes, Say]" = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, model: ObjectModel, smoothness: Smoothness) -> "DisplacementField":
        """The field of this object."""
        return cls.through(model.xyz_mm, smoothness)

    @classmethod
    def through(
        cls, nominal_mm: Array, smoothness: Smoothness, most_kept: int = _KEPT
    ) -> "DisplacementField":
        """The field of the targets at these nominal places (M, 3)."""
        apart = np.linalg.norm(nominal_mm[:, np.newaxis] - nominal_mm, axis=2) / smoothness.reach_mm
        scaled = np.sqrt(5.0) * apart
        covariance = smoothness.sigma_mm**2 * (1.0 + scaled + scaled * scaled / 3.0) * np.exp(-scaled)
        covariance[np.diag_indices(len(nominal_mm))] += smoothness.noise_mm**2
        return cls(nominal_mm, np.linalg.inv(covariance), smoothness.noise_mm, most_kept)

    def expect(self, seen: NDArray[np.bool_], displacement_mm: Array) -> Expected:
        """What the seen targets say of all: of an unseen one all of them, of a seen one all but itself.

        Args:
            seen: (M,) which targets have been measured.
            displacement_mm: (M, 3) their displacements; what stands at unseen ones is not looked at.
        """
        say = self.say(np.flatnonzero(seen))
        return Expected(say.weights @ displacement_mm[seen], say.sigma_mm)

    def say(self, inside: Indices) -> Say:
        """What some targets (K,), ascending, say of all.

        From field to field mostly the same are seen: what was worked out for them is kept.
        """
        key = inside.tobytes()
        say = self._kept.get(key)
        if say is None:
            if len(self._kept) >= self.most_kept:
                self._kept.clear()
            unseen = np.ones(len(self.precision), np.bool_)
            unseen[inside] = False
            say = self._kept[key] = self._say_of(inside, np.flatnonzero(unseen))
        return say

    def _say_of(self, inside: Indices, outside: Indices) -> "Say":
        own = self.precision[inside[:, np.newaxis], inside]
        cross = self.precision[outside[:, np.newaxis], inside]
        hidden = np.linalg.inv(self.precision[outside[:, np.newaxis], outside])
        guess = -(hidden @ cross)
        pull = own + cross.T @ guess
        weights, variance = np.empty((len(inside), len(self.precision))).T, np.empty(len(self.precision))
        variance[inside], variance[outside] = 1.0 / np.diag(pull), np.diag(hidden)
        weights[inside] = np.eye(len(inside)) - pull * variance[inside, np.newaxis]
        weights[outside] = guess
        sigma_mm = np.sqrt(np.maximum(variance - self.noise_mm**2, 0.0))
        sigma_mm.setflags(write=False)
        return Say(weights, sigma_mm)
