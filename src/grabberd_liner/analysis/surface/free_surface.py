"""The surface through points that are not the same targets from field to field.

Without ids there is no material grid: the surface is a height over a plane, or a radius about an axis, as a
function of position. It has the interface of `Surface`, so curvature, area and sections work unchanged; u and
v are positions in space, not in the material, so there is no strain.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.grid import Grid, NominalShape
from grabberd_liner.analysis.surface.fitting import LARGEST_SHARE_OUT, Posterior, fit_modes
from grabberd_liner.analysis.surface.jets import ORDERS, Jets, index
from grabberd_liner.analysis.surface.smoothing import (
    FREE,
    Departures,
    Domain,
    Modes,
    Smoothing,
    choose,
    modes,
)
from grabberd_liner.analysis.surface.surface import Spread, Surface

_OUTLYING = 40.0
"""Limit on χ² of one degree of freedom that chance does not reach in ten thousand captures."""

_LEAST_POINTS = 4 * FREE
_PASSES = 3
"""They are needed because the noise across the surface depends on its normal, which the fit gives."""
_ASKEW = 0.05


class Tube(NamedTuple):
    """A surface as radius about an axis along x: u = x, v = angle from `up` towards the side, times radius.

    Attributes:
        y_mm, z_mm: position of the axis.
        radius_mm: approximate radius, from which the surface departs.
    """

    y_mm: float
    z_mm: float
    radius_mm: float

    def material(self, xyz_mm: Array) -> tuple[Array, Array]:
        """Parameters u and v, in mm, of positions (N, 3)."""
        angle = np.arctan2(xyz_mm[:, 1] - self.y_mm, xyz_mm[:, 2] - self.z_mm)
        return xyz_mm[:, 0], self.radius_mm * angle

    def base(self, u_mm: Array, v_mm: Array) -> Jets:
        """(N, 15, 3) the tube of that radius."""
        jets = self.radius_mm * self.direction(u_mm, v_mm)
        jets[:, 0] += np.column_stack([u_mm, np.full_like(u_mm, self.y_mm), np.full_like(u_mm, self.z_mm)])
        jets[:, index(1, 0), 0] += 1.0
        return jets

    def direction(self, u_mm: Array, v_mm: Array) -> Jets:
        """(N, 15, 3) jets of the unit vector away from the axis."""
        jets = np.zeros((len(u_mm), len(ORDERS), 3))
        for j in range(5):
            turned = v_mm / self.radius_mm + j * np.pi / 2
            jets[:, index(0, j), 1:] = np.column_stack([np.sin(turned), np.cos(turned)]) / self.radius_mm**j
        return jets


class Height(NamedTuple):
    """A surface as height z over the plane z = `z_mm`: u = x, v = y."""

    z_mm: float = 0.0

    def material(self, xyz_mm: Array) -> tuple[Array, Array]:
        """Parameters u and v, in mm, of positions (N, 3)."""
        return xyz_mm[:, 0], xyz_mm[:, 1]

    def base(self, u_mm: Array, v_mm: Array) -> Jets:
        """(N, 15, 3) the plane."""
        jets = np.zeros((len(u_mm), len(ORDERS), 3))
        jets[:, 0] = np.column_stack([u_mm, v_mm, np.full_like(u_mm, self.z_mm)])
        jets[:, index(1, 0), 0] = jets[:, index(0, 1), 1] = 1.0
        return jets

    def direction(self, u_mm: Array, v_mm: Array) -> Jets:
        """(N, 15, 3) jets of the unit vector along z."""
        jets = np.zeros((len(u_mm), len(ORDERS), 3))
        jets[:, 0, 2] = 1.0
        return jets


def free_shape(grid: Grid) -> Tube | Height:
    """Parameter domain of an object's surface: the tube along x of its nominal positions, or a plane."""
    shape = NominalShape.of(grid)
    askew = np.linalg.norm(shape.along[1:]) > _ASKEW * np.linalg.norm(shape.along)
    if not shape.radius_mm or askew:
        return Height(float(grid.nominal_mm[:, 2].mean()))
    _, y_mm, z_mm = shape.origin_mm
    return Tube(float(y_mm), float(z_mm), shape.radius_mm)


def fit_free_surface(
    xyz_mm: Array,
    covariance_mm2: Array,
    over: Tube | Height,
) -> Surface:
    """The surface of one field's points without ids.

    Noise along the surface does not matter; noise across it is projected on the direction of departure.

    Args:
        xyz_mm: (N, 3) points, object's frame.
        covariance_mm2: (N, 3, 3) their noise.
        over: base shape; the branch cut of its angle has to lie outside the points.

    Raises:
        AnalysisError: too few points, or more than a fifth of them contradict the others.
    """
    _check_enough(xyz_mm)
    u_mm, v_mm = over.material(xyz_mm)
    domain, cell = _domain(u_mm, v_mm)
    # One direction per point: only the departure along it is modelled, since points slide along the surface
    # from field to field.
    away = over.direction(u_mm, v_mm)[:, 0]
    departure = ((xyz_mm - over.base(u_mm, v_mm)[:, 0]) * away).sum(axis=1)[:, np.newaxis]
    kept, normal = np.ones(len(xyz_mm), bool), away
    for _ in range(_PASSES):
        variance = _across(covariance_mm2, normal, away)
        field = Departures(u_mm[kept], v_mm[kept], departure[kept], np.sqrt(variance[kept]))
        chosen = choose(domain, [field])
        candidate = modes(domain, chosen.along_mm, chosen.round_mm)
        posterior, kept = _without_outliers(
            candidate, chosen, (u_mm, v_mm, departure, variance[:, :, np.newaxis]), kept
        )
        surface = Surface(
            base=over.base,
            modes=candidate,
            coefficients=posterior.coefficients,
            factor=posterior.factor,
            smoothing=chosen,
            supported=_supported(domain, cell, kept),
            outward=1.0,
            misfit=posterior.misfit,
            problems=_named(kept),
            spread=Spread(over.direction),
        )
        jets = surface.jets(u_mm, v_mm)
        normal = np.cross(jets[:, index(1, 0)], jets[:, index(0, 1)])
    return surface


def _check_enough(xyz_mm: Array) -> None:
    if len(xyz_mm) < _LEAST_POINTS or not np.isfinite(xyz_mm).all():
        raise AnalysisError(
            f"{len(xyz_mm)} points are too few for a surface, or some are no numbers",
            f"a surface without a target grid needs {_LEAST_POINTS} points",
        )


def _domain(u_mm: Array, v_mm: Array) -> tuple[Domain, tuple[Indices, Indices]]:
    """Knots at 1.5 times the mean distance of the points, and each point's nearest knot."""
    low, high = np.array([u_mm.min(), v_mm.min()]), np.array([u_mm.max(), v_mm.max()])
    mean = 1.5 * np.sqrt((high - low).prod() / len(u_mm))
    knots = np.maximum(np.round((high - low) / mean).astype(int) + 1, 3)
    pitch = (high - low) / (knots - 1)
    if not (pitch > 0).all():
        raise AnalysisError(
            "the points lie on one line and determine no surface", "look at the capture's points"
        )
    row, column = (np.round((np.column_stack([u_mm, v_mm]) - low) / pitch).astype(np.intp)).T
    domain = Domain(
        float(low[0]), float(low[1]), float(pitch[0]), float(pitch[1]), int(knots[0]), int(knots[1])
    )
    return domain, (row, column)


def _across(covariance: Array, normal: Array, away: Array) -> Array:
    """(N, 1) variance of the departure: noise across the surface, projected on the direction of departure."""
    slope = (normal * away).sum(axis=1)
    across = np.einsum("na,nab,nb->n", normal, covariance, normal)
    return (across / slope**2)[:, np.newaxis]


def _without_outliers(
    candidate: Modes, smoothing: Smoothing, field: Sequence[Array], kept: Mask
) -> tuple[Posterior, Mask]:
    kept = kept.copy()
    while True:
        posterior = fit_modes(candidate, smoothing, *(values[kept] for values in field))
        worst = int(np.argmax(posterior.outlying))
        if posterior.outlying[worst] < _OUTLYING:
            return posterior, kept
        kept[np.flatnonzero(kept)[worst]] = False
        if (~kept).sum() > LARGEST_SHARE_OUT * len(kept):
            raise AnalysisError(
                f"more than a fifth of {len(kept)} points contradict the others",
                "the surface may not be a function over this plane or axis: choose another",
            )


def _supported(domain: Domain, cell: tuple[Indices, Indices], kept: Mask) -> Mask:
    """(rows, columns): True for knots with points near them, or near all their neighbours."""
    seen = np.zeros((domain.rows, domain.columns), bool)
    seen[cell[0][kept], cell[1][kept]] = True
    around = np.pad(seen, 1, constant_values=True)
    alone = around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:]
    return seen | alone


def _named(kept: Mask) -> tuple[str, ...]:
    if kept.all():
        return ()
    places = ", ".join(map(str, np.flatnonzero(~kept)))
    return (f"left out, many σ from the prediction by the other points: points number {places}",)
