"""Differential geometry of a surface on a doubly periodic grid, all derivatives spectral.

Points are a periodic part plus one that is linear in the two coordinates (a tube that repeats itself along
its length). A derivative is a multiplication in the Fourier series over the whole grid, exact to rounding for
everything that the grid resolves; tensors are differentiated covariantly, with Christoffel symbols. Lengths
are in mm.
"""

from functools import cached_property

import numpy as np

from grabberd_fake.optics import Array


class Sheet:
    """A surface over coordinates u = (u0, u1).

    Attributes:
        shape: (n, m) of the grid; `periods_mm`: period of each coordinate.
    """

    def __init__(self, periodic_mm: Array, secular: Array, periods_mm: tuple[float, float]) -> None:
        """The surface.

        Args:
            periodic_mm: (n, m, 3) periodic part of the points, at u_a = index · period / count.
            secular: (2, 3) contribution of the linear part to ∂S/∂u.
            periods_mm: periods of the two coordinates.
        """
        self.shape = periodic_mm.shape[:2]
        self.periods_mm = periods_mm
        self._periodic_mm, self._secular = periodic_mm, secular

    def derivative(self, values: Array, along: int) -> Array:
        """∂values/∂u_along of a periodic (n, m, …) quantity."""
        count = self.shape[along]
        waves = np.fft.rfftfreq(count, self.periods_mm[along] / count) * 2j * np.pi
        if count % 2 == 0:
            waves[-1] = 0.0  # the sine of the highest wave vanishes on the grid
        shape = [1] * values.ndim
        shape[along] = len(waves)
        spectrum = np.fft.rfft(values, axis=along) * waves.reshape(shape)
        slope: Array = np.fft.irfft(spectrum, count, axis=along)
        return slope

    def gradient(self, values: Array) -> Array:
        """(2, n, m, …) derivatives along both coordinates."""
        return np.stack([self.derivative(values, along) for along in (0, 1)])

    @cached_property
    def tangents(self) -> Array:
        """(2, n, m, 3) ∂S/∂u_a."""
        return self.gradient(self._periodic_mm) + self._secular[:, np.newaxis, np.newaxis]

    @cached_property
    def metric(self) -> Array:
        """(2, 2, n, m) g_ab = S_a · S_b."""
        form: Array = np.einsum("anmx,bnmx->abnm", self.tangents, self.tangents)
        return form

    @cached_property
    def area(self) -> Array:
        """(n, m) √det g."""
        return np.sqrt(determinant(self.metric))

    @cached_property
    def raised(self) -> Array:
        """(2, 2, n, m) g^ab."""
        return inverse(self.metric)

    @cached_property
    def normal(self) -> Array:
        """(n, m, 3) unit normal along S_0 × S_1, inward or outward as the coordinates run."""
        unit: Array = np.cross(self.tangents[0], self.tangents[1]) / self.area[..., np.newaxis]
        return unit

    @cached_property
    def _second(self) -> Array:
        """(2, 2, n, m, 3) ∂²S/∂u_a∂u_b."""
        return np.stack([self.gradient(tangent) for tangent in self.tangents])

    @cached_property
    def bending(self) -> Array:
        """(2, 2, n, m) n · ∂²S: the second fundamental form for this normal."""
        form: Array = np.einsum("abnmx,nmx->abnm", self._second, self.normal)
        return form

    @cached_property
    def _christoffel(self) -> Array:
        """(2, 2, 2, n, m) Γ^c_ab."""
        first = np.einsum("dnmx,abnmx->dabnm", self.tangents, self._second)
        symbols: Array = np.einsum("cdnm,dabnm->cabnm", self.raised, first)
        return symbols

    def double_divergence(self, tensor: Array) -> Array:
        """(n, m) ∇_a ∇_b M^ab of contravariant components (2, 2, n, m)."""
        christoffel = self._christoffel
        divergence = sum(np.stack([self.derivative(row[b], b) for row in tensor]) for b in (0, 1))
        divergence = divergence + np.einsum("abcnm,cbnm->anm", christoffel, tensor)
        divergence = divergence + np.einsum("bbcnm,acnm->anm", christoffel, tensor)
        flux = self.area * divergence
        whole: Array = (self.derivative(flux[0], 0) + self.derivative(flux[1], 1)) / self.area
        return whole

    def at(self, values: Array, u0: Array, u1: Array) -> Array:
        """(r, c, …) values of a periodic (n, m, …) quantity at u0 (r,) by u1 (c,), by its Fourier series."""
        first, second = (
            _interpolation(u, self.shape[along], self.periods_mm[along]) for along, u in enumerate((u0, u1))
        )
        read: Array = np.einsum("rn,cm,nm...->rc...", first, second, values, optimize=True)
        return read


def determinant(form: Array) -> Array:
    """Det of (2, 2, …)."""
    value: Array = form[0, 0] * form[1, 1] - form[0, 1] * form[1, 0]
    return value


def inverse(form: Array) -> Array:
    """Inverse of (2, 2, …)."""
    swapped = np.array([[form[1, 1], -form[0, 1]], [-form[1, 0], form[0, 0]]])
    return swapped / determinant(form)


def _interpolation(u: Array, count: int, period_mm: float) -> Array:
    """(r, count) weights of the grid's values in their Fourier series at u (r,)."""
    angle = 2 * np.pi * (u[:, np.newaxis] / period_mm - np.arange(count) / count)
    waves = np.arange(1, (count - 1) // 2 + 1)
    weights = 1 + 2 * np.cos(np.multiply.outer(angle, waves)).sum(axis=-1)
    if count % 2 == 0:
        weights = weights + np.cos(count / 2 * angle)
    series: Array = weights / count
    return series
