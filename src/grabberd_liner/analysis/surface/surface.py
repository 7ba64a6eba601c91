"""The smooth surface through a field's points, with its covariance, and as a fine mesh: of flat facets for
drawing, of Taylor polynomials for ray casting.

The surface is the nominal shape plus a departure whose modes are estimated from the points: the posterior
mean under the smoothing prior. Its covariance is the posterior's, so it includes both the noise of the
points and the possible bias by smoothing, but not the calibration's part, which is common to all fields.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import factorial

import numpy as np
from scipy.linalg.blas import dtrmm

from grabberd.core.arrays import Array, Indices, Mask
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.surface.jets import HIGHEST, ORDERS, Jets, count_to, times
from grabberd_liner.analysis.surface.sections import is_within
from grabberd_liner.analysis.surface.smoothing import Domain, Modes, Smoothing

Shape = Callable[[Array, Array], Jets]
Function = Callable[..., Array]

_STEP = 1e-3
"""Step of differences, relative to the pitch: the functions are smooth, so truncation and rounding both stay
far below σ."""


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Departure along one direction that depends on the position, instead of along x, y and z.

    Attributes:
        direction: (N, 15, 3) jets of the unit vector.
    """

    direction: Shape

    def jets(self, departure: Array, u_mm: Array, v_mm: Array) -> Jets:
        """(N, p, 3) jets from those of the scalar departure (N, p, 1)."""
        count = departure.shape[1]
        matrix = times(self.direction(u_mm, v_mm))[:, :count, :count]
        return np.einsum("npqa,nq->npa", matrix, departure[:, :, 0])

    def slopes(self, slopes: Array, u_mm: Array, v_mm: Array) -> Array:
        """(N, p, 1, ...) by the departure's derivatives from (N, p, 3, ...) by the jets' first p entries."""
        count = slopes.shape[1]
        matrix = times(self.direction(u_mm, v_mm))[:, :count, :count]
        return np.einsum("npqa,npa...->nq...", matrix, slopes)[:, :, np.newaxis]


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """The outer (target) face of the wall, X(u, v), at one field.

    Attributes:
        base: jets of the nominal shape.
        modes: R modes of the departure in each of D directions: x, y, z, or those of `spread`.
        coefficients: (D, R) coefficients of the modes, at unit amplitude; `factor`: (D, R, D·R) square root
            of their covariance: cov[a, r, b, s] = Σ_k factor[a, r, k] factor[b, s, k]; upper triangular as a
            matrix.
        smoothing: parameters of the prior.
        supported: (rows, columns) of the domain's grid: True if a target was seen there, or is the only one
            missing among its neighbours.
        outward: 1.0 if X_u × X_v points outward, else −1.0.
        misfit: weighted squared residuals over their expectation: 1 if the points' σ are right.
        problems: points left out and the reasons, as sentences.
        spread: direction of the departure, if it is not along x, y, z.
    """

    base: Shape
    modes: Modes
    coefficients: Array
    factor: Array
    smoothing: Smoothing
    supported: Mask
    outward: float
    misfit: float
    problems: tuple[str, ...]
    spread: Spread | None = None

    def jets(self, u_mm: Array, v_mm: Array) -> Jets:
        """(N, 15, 3) jets of the face at N material positions, mm."""
        departure = self.modes.jets(u_mm, v_mm) @ self.coefficients.T
        if self.spread is not None:
            departure = self.spread.jets(departure, u_mm, v_mm)
        return self.base(u_mm, v_mm) + departure

    def tangents(self, u_mm: Array, v_mm: Array) -> Array:
        """(N, 3, 3) X, X_u, X_v at N material positions: faster than `jets` if no more is needed."""
        departure = self.modes.jets(u_mm, v_mm, highest=1) @ self.coefficients.T
        if self.spread is not None:
            departure = self.spread.jets(departure, u_mm, v_mm)
        return self.base(u_mm, v_mm)[:, :3] + departure

    @property
    def domain(self) -> Domain:
        """The grid of targets."""
        return self.modes.domain

    def within(self, u_mm: Array, v_mm: Array) -> Mask:
        """(N,) True for positions supported by data."""
        return is_within(self.domain, self.supported, u_mm, v_mm)

    def places_mm(self, u_mm: Array, v_mm: Array) -> Estimate:
        """(N, 3) points X, each with σ."""
        straight = np.broadcast_to(np.eye(3), (len(u_mm), 1, 3, 3))
        return Estimate(self.jets(u_mm, v_mm)[:, 0], self.sigma(straight, u_mm, v_mm))

    def propagate(
        self,
        function: Function,
        u_mm: Array,
        v_mm: Array,
        reference: "Surface | None" = None,
        highest: int = HIGHEST,
    ) -> Estimate:
        """A function of the jets at N positions, with its σ from the points' noise and the smoothing.

        First-order propagation, with derivatives by central differences on the jets.

        Args:
            function: function of the jets (..., N, 15, 3), to (..., N) or (..., N, k); with `reference`, of
                both surfaces' jets: function(jets, reference_jets).
            u_mm: (N,) material coordinates.
            v_mm: (N,) material coordinates.
            reference: a surface of other fields, whose independent errors are included.
            highest: order of the highest derivative that the function uses; a lower one saves time.

        Returns:
            Value and σ, (N,) or (N, k).
        """
        found = propagate([self], function, (u_mm, v_mm), reference, highest)
        return Estimate(found.value[0], found.sigma[0])

    def sigma(self, slopes: Array, u_mm: Array, v_mm: Array) -> Array:
        """(N,) or (N, k) σ of quantities with these derivatives by the jets at N positions.

        Args:
            slopes: (N, p, 3) or (N, p, 3, k) derivatives by the jets' first p entries.
            u_mm: (N,) material coordinates.
            v_mm: (N,) material coordinates.
        """
        if self.spread is not None:
            slopes = self.spread.slopes(slopes, u_mm, v_mm)
        places = self.modes.jets(u_mm, v_mm)[:, : slopes.shape[1]]
        several = slopes.reshape(*slopes.shape[:3], -1)
        weights = several.transpose(0, 3, 2, 1).reshape(len(u_mm), -1, slopes.shape[1])
        rows = (weights @ places).reshape(-1, slopes.shape[2] * places.shape[2])
        root = _triangular_product(rows, self.factor.reshape(-1, self.factor.shape[2]))
        sigma: Array = np.sqrt((root * root).sum(axis=1))
        return sigma.reshape(len(u_mm), *slopes.shape[3:])

    def covariance(self, weights: Array, u_mm: Array, v_mm: Array) -> Array:
        """(k, k) covariance of k sums over positions: Σ weights · jets.

        Args:
            weights: (k, N, p, 3) weights of the jets' first p derivatives.
            u_mm: (N,) material coordinates.
            v_mm: (N,) material coordinates.
        """
        if self.spread is not None:
            weights = np.moveaxis(self.spread.slopes(np.moveaxis(weights, 0, -1), u_mm, v_mm), -1, 0)
        highest = 1 if weights.shape[2] <= count_to(1) else HIGHEST
        places = self.modes.jets(u_mm, v_mm, highest)[:, : weights.shape[2]]
        gradient = np.tensordot(weights, places, axes=((1, 2), (0, 1)))
        root = gradient.reshape(len(weights), -1) @ self.factor.reshape(-1, self.factor.shape[2])
        return root @ root.T


def _triangular_product(rows: Array, upper: Array) -> Array:
    """The product of rows with an upper triangular matrix, in half the time of a full product."""
    return dtrmm(1.0, upper.T, rows.T, lower=1, overwrite_b=1).T


def propagate(
    surfaces: Sequence[Surface],
    function: Function,
    places: tuple[Array, Array],
    reference: Surface | None = None,
    highest: int = HIGHEST,
) -> Estimate:
    """A function of F surfaces' jets, as in `Surface.propagate`, but faster than one by one.

    Args:
        surfaces: F surfaces of one domain.
        function: function of the jets (..., F, N, 15, 3), to (..., F, N) or (..., F, N, k).
        places: u_mm and v_mm, (N,) each.
        reference: reference surface common to all, with errors independent of theirs.
        highest: as in `Surface.propagate`.

    Returns:
        Value and σ, (F, N) or (F, N, k).
    """
    jets = np.stack([surface.jets(*places) for surface in surfaces])
    pitch_mm = min(surfaces[0].modes.domain[2:4])
    if reference is None:
        slopes = _slopes(function, jets, highest, pitch_mm)
        return Estimate(function(jets), _sigmas(surfaces, slopes, places))
    other = reference.jets(*places)[np.newaxis]
    slopes = _slopes(lambda moved: function(moved, other), jets, highest, pitch_mm)
    opposite = _slopes(lambda moved: function(jets, moved), other, highest, pitch_mm)
    own, others = (_sigmas(each, by, places) for each, by in ((surfaces, slopes), ([reference], opposite)))
    return Estimate(function(jets, other), np.hypot(own, others))


def _sigmas(
    surfaces: Sequence[Surface],
    slopes: Array,
    places: tuple[Array, Array],
) -> Array:
    """(F, N, ...) σ from slopes (F, N, p, 3, ...), of one surface or of F."""
    each = surfaces if len(surfaces) > 1 else [surfaces[0]] * len(slopes)
    return np.stack([one.sigma(by, *places) for one, by in zip(each, slopes, strict=True)])


def _slopes(function: Function, jets: Jets, highest: int, pitch_mm: float) -> Array:
    """(F, N, p, 3, ...) derivatives of the function by the first p entries of the jets (F, N, 15, 3)."""
    count = count_to(highest)
    order = np.repeat(np.arange(highest + 1), np.arange(1, highest + 2))
    # A derivative of order n is of the size 1 / pitchⁿ⁻¹: one relative step suits all of them.
    step = np.repeat(_STEP * pitch_mm ** (1.0 - order), 3)
    moved = np.zeros((3 * count, jets.shape[-2] * 3))
    moved[np.arange(3 * count), np.arange(3 * count)] = step
    moved = moved.reshape(3 * count, 1, 1, *jets.shape[-2:])
    ahead, behind = function(jets + moved), function(jets - moved)
    slope = (ahead - behind) / (2 * step).reshape(-1, *[1] * (ahead.ndim - 1))
    return np.moveaxis(slope.reshape(count, 3, *slope.shape[1:]), (0, 1), (2, 3))


PER_PITCH = 4
"""Facets from target to target; even, so that the targets' own lines lie on their edges."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """P × Q corners that extend half a pitch beyond the outermost targets.

    Attributes:
        u_mm: (P, Q) material coordinates; `v_mm`: (P, Q).
        jets: (P, Q, 15, 3) jets of the surface at the corners.
        supported: (P − 1, Q − 1) True for facets whose middle is supported by data.
    """

    u_mm: Array
    v_mm: Array
    jets: Jets
    supported: Mask

    @classmethod
    def of(cls, surface: Surface) -> "Mesh":
        """The mesh of a surface."""
        domain = surface.domain
        u = domain.u_mm + _steps(domain.rows) * domain.u_pitch_mm
        v = domain.v_mm + _steps(domain.columns) * domain.v_pitch_mm
        u_mm, v_mm = np.meshgrid(u, v, indexing="ij")
        jets = surface.jets(u_mm.ravel(), v_mm.ravel())
        middle_u, middle_v = (middles(places) for places in (u_mm, v_mm))
        within = surface.within(middle_u.ravel(), middle_v.ravel()).reshape(middle_u.shape)
        return cls(u_mm, v_mm, jets.reshape(*u_mm.shape, *jets.shape[1:]), within)

    @property
    def xyz_mm(self) -> Array:
        """(P, Q, 3) the corners in the object's frame."""
        return self.jets[:, :, 0]

    def tangents(self, u_mm: Array, v_mm: Array) -> Array:
        """(N, 3, 3) X, X_u, X_v at N positions, from the jet at the nearest corner.

        On a liner (radius 12.5 mm, targets every 6.5 mm) that is within 1e-5 mm of the surface itself, and
        many times faster.
        """
        pitch_u, pitch_v = self.u_mm[1, 0] - self.u_mm[0, 0], self.v_mm[0, 1] - self.v_mm[0, 0]
        row = np.clip(np.round((u_mm - self.u_mm[0, 0]) / pitch_u), 0, self.u_mm.shape[0] - 1).astype(np.intp)
        column = np.clip(np.round((v_mm - self.v_mm[0, 0]) / pitch_v), 0, self.v_mm.shape[1] - 1).astype(
            np.intp
        )
        weights = _taylor(u_mm - self.u_mm[row, 0], v_mm - self.v_mm[0, column])
        return weights @ self.jets[row, column]

    def corners(self) -> Indices:
        """(F, 4) indices into the flattened corners of the supported facets, in cyclic order."""
        index = np.arange(self.u_mm.size).reshape(self.u_mm.shape)
        four = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
        return four[self.supported]


def middles(values: Array) -> Array:
    """(P − 1, Q − 1) means of the four corners (P, Q) of each facet."""
    return (values[:-1, :-1] + values[1:, :-1] + values[1:, 1:] + values[:-1, 1:]) / 4


def _steps(targets: int) -> Array:
    """Corners from half a pitch before the first target to half a pitch beyond the last, in pitches."""
    return np.arange(targets * PER_PITCH + 1) / PER_PITCH - 0.5


def _taylor(du_mm: Array, dv_mm: Array) -> Array:
    """(N, 3, 15) weights of a jet's entries in X, X_u and X_v at these distances from its position."""
    along, across = ([step**k / factorial(k) for k in range(5)] for step in (du_mm, dv_mm))
    weights = np.zeros((len(du_mm), 3, len(ORDERS)))
    for place, (i, j) in enumerate(ORDERS):
        weights[:, 0, place] = along[i] * across[j]
        if i:
            weights[:, 1, place] = along[i - 1] * across[j]
        if j:
            weights[:, 2, place] = along[i] * across[j - 1]
    return weights
