"""A quantity that repeats with the cycle: a Fourier series of the phase, with covariance.

    w(φ) = c0 + Σk ck cos 2πkφ + sk sin 2πkφ,  k = 1 … K;   coefficients c0, c1 … cK, s1 … sK

A priori its harmonics fall off as 1/k², as for any movement without jumps; up to a corner only as 1/k, as for
one whose flanks are so steep that they look like jumps.
"""

from typing import NamedTuple

import numpy as np

from grabberd_liner.arrays import Array

# Phases at which extremes and crossings are looked for: a quarter of a millisecond in a cycle of a second.
_FINE = 4096
_PLATEAU = 0.01


def basis(phase: Array, count: int) -> Array:
    """(..., 2 count + 1) terms of the series at phases (...,) in cycles."""
    angle = 2 * np.pi * phase[..., None] * np.arange(1, count + 1)
    return np.concatenate([np.ones_like(phase)[..., None], np.cos(angle), np.sin(angle)], axis=-1)


def basis_slope(phase: Array, count: int) -> Array:
    """(..., 2 count + 1) their derivatives by the phase, per cycle."""
    waves = 2 * np.pi * np.arange(1, count + 1)
    angle = phase[..., None] * waves
    zero = np.zeros_like(phase)[..., None]
    return np.concatenate([zero, -waves * np.sin(angle), waves * np.cos(angle)], axis=-1)


def prior_precision(count: int, variance: float, corner: float = 0.0) -> Array:
    """(2 count + 1,) prior precision of the coefficients of a series of this variance; the mean is free."""
    waves = np.arange(1, count + 1, dtype=np.float64)
    falling = 1.0 / (waves**2 * (waves**2 + corner**2))
    each = variance / falling.sum() * falling
    return 1 / np.concatenate([[1e4 * variance], each, each])


def rotated(coefficients: Array, phase: float) -> Array:
    """(2K + 1, …) coefficients of w(φ + phase); only rows are mixed, so a covariance is rotated twice."""
    count = (len(coefficients) - 1) // 2
    angle = 2 * np.pi * phase * np.arange(1, count + 1)
    shape = (count,) + (1,) * (coefficients.ndim - 1)
    cosine, sine = np.cos(angle).reshape(shape), np.sin(angle).reshape(shape)
    even, odd = coefficients[1 : count + 1], coefficients[count + 1 :]
    return np.concatenate([coefficients[:1], even * cosine + odd * sine, odd * cosine - even * sine])


class Waveform(NamedTuple):
    """A periodic quantity.

    Attributes:
        coefficients: (2K + 1,) as above; `covariance`: (2K + 1, 2K + 1).
    """

    coefficients: Array
    covariance: Array

    @property
    def harmonics(self) -> int:
        """Number K of harmonics."""
        return (len(self.coefficients) - 1) // 2

    def value(self, phase: Array) -> Array:
        """(...,) at phases (...,) in cycles."""
        return basis(phase, self.harmonics) @ self.coefficients

    def slope(self, phase: Array) -> Array:
        """(...,) its derivative, per cycle."""
        return basis_slope(phase, self.harmonics) @ self.coefficients

    def sigma(self, phase: Array) -> Array:
        """(...,) σ of its value."""
        terms = basis(phase, self.harmonics)
        variance: Array = np.einsum("...i,ij,...j->...", terms, self.covariance, terms)
        return np.sqrt(np.maximum(variance, 0.0))

    def extremes(self) -> tuple[float, float]:
        """Phases of the least and of the greatest value."""
        phase = np.arange(_FINE) / _FINE
        values = self.value(phase)
        return float(phase[values.argmin()]), float(phase[values.argmax()])

    def level_terms(self) -> Array:
        """(2, 2K + 1) terms whose products with the coefficients are the lowest and the highest level.

        Each is the mean of the values within 1 % of the stroke of the extreme: for a plateau its level rather
        than the peak of its noise.
        """
        phase = np.arange(_FINE) / _FINE
        terms = basis(phase, self.harmonics)
        values = terms @ self.coefficients
        room = _PLATEAU * np.ptp(values)
        low, high = values <= values.min() + room, values >= values.max() - room
        return np.stack([terms[low].mean(axis=0), terms[high].mean(axis=0)])

    def levels(self) -> tuple[float, float]:
        """The lowest and the highest level."""
        low, high = self.level_terms() @ self.coefficients
        return float(low), float(high)

    def crossings(self, level: float) -> tuple[Array, Array]:
        """Phases at which the quantity rises and falls through a level, each ascending in [0, 1)."""
        phase = np.arange(_FINE + 1) / _FINE
        above = self.value(phase) - level
        at = np.flatnonzero((above[:-1] < 0) != (above[1:] < 0))
        exact = phase[at] + above[at] / (above[at] - above[at + 1]) / _FINE
        rising = above[at] < 0
        return np.mod(exact[rising], 1.0), np.mod(exact[~rising], 1.0)

    def turned(self, phase: float) -> "Waveform":
        """The same quantity with its phase counted from `phase`."""
        covariance = rotated(rotated(self.covariance, phase).T, phase).T
        return Waveform(rotated(self.coefficients, phase), covariance)
