"""Values with their standard deviations or whole covariance; named quantities with unit, definition and
source, and what was found of them.
"""

from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array


class Estimate(NamedTuple):
    """Values and their σ.

    Attributes:
        value: values of any shape; the unit is in the name of the field or function that returns them.
        sigma: (same shape) one standard deviation, in the same unit; NaN where the value is NaN.
    """

    value: Array
    sigma: Array

    @classmethod
    def of(cls, value: float, sigma: float) -> "Estimate":
        """A single value."""
        return cls(np.asarray(value, np.float64), np.asarray(sigma, np.float64))


class Joint(NamedTuple):
    """N values whose errors go together.

    Attributes:
        value: (N,) values; the unit is in the name of the field or function that returns them.
        covariance: (N, N) in the square of that unit.
    """

    value: Array
    covariance: Array

    @property
    def estimate(self) -> Estimate:
        """(N,) the values one by one."""
        return Estimate(self.value, np.sqrt(np.diagonal(self.covariance)))

    def summed(self, weights: Array) -> Estimate:
        """Sums of the values with weights (…, N), with the σ of each sum."""
        variance = ((weights @ self.covariance) * weights).sum(axis=-1)
        return Estimate(weights @ self.value, np.sqrt(np.maximum(variance, 0.0)))

    def mixed(self, other: "Joint", share: float) -> "Joint":
        """Mean and covariance if the other values are right with a probability, and these otherwise."""
        apart = other.value - self.value
        within = (1 - share) * self.covariance + share * other.covariance
        between = share * (1 - share) * np.outer(apart, apart)
        return Joint(self.value + share * apart, within + between)


class Quantity(NamedTuple):
    """Meaning of a number.

    Attributes:
        name: as in tables and documents.
        title: for people.
        unit: "1" for a ratio.
        definition: one sentence.
        source: where the term is from, and how it is had here if that differs.
    """

    name: str
    title: str
    unit: str
    definition: str
    source: str


class Finding(NamedTuple):
    """Result for a quantity.

    Attributes:
        quantity: which one.
        value: in its unit; NaN if nothing was found.
        sigma: one standard deviation.
        reason: why nothing was found; empty if something was.
        verdict: by the limit that a standard sets; empty if there is none.
        common: part of `sigma` that captures analysed with the same liner values, gauges and model share;
            averaging captures does not lessen it. NaN if nothing was found.
    """

    quantity: Quantity
    value: float
    sigma: float
    reason: str = ""
    verdict: str = ""
    common: float = 0.0

    @classmethod
    def of(cls, quantity: Quantity, found: Estimate, common: float = 0.0) -> "Finding":
        """A finding."""
        return cls(quantity, float(found.value), float(found.sigma), common=common)

    @classmethod
    def shared(cls, quantity: Quantity, found: Estimate) -> "Finding":
        """A finding whose σ cannot be split, so that captures are taken to share all of it."""
        return cls.of(quantity, found, float(found.sigma))

    @classmethod
    def missing(cls, quantity: Quantity, reason: str) -> "Finding":
        """Nothing, with the reason."""
        return cls(quantity, float("nan"), float("nan"), reason, common=float("nan"))

    @property
    def estimate(self) -> Estimate:
        """Value with σ; NaN if nothing was found."""
        return Estimate.of(self.value, self.sigma)
