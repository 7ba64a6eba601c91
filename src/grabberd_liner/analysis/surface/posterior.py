"""Fitting a surface to points: linear least squares on the modes of the prior."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtri

from grabberd_liner.analysis.surface.modes import FREE, Modes
from grabberd_liner.analysis.surface.smoothing import Smoothing


class Posterior(NamedTuple):
    """The posterior of the modes' coefficients.

    Attributes:
        coefficients: (D, R), at unit amplitude; `factor`: (D, R, D·R) square root of their covariance.
        outlying: (N,) squared distance of each point from its prediction by all others, in units of its
            covariance: χ² with D degrees of freedom.
        misfit: weighted squared residuals and roughness over their expectation, which is 1.
    """

    coefficients: NDArray[np.float64]
    factor: NDArray[np.float64]
    outlying: NDArray[np.float64]
    misfit: float


def fit_modes(
    modes: Modes,
    smoothing: Smoothing,
    u_mm: NDArray[np.float64],
    v_mm: NDArray[np.float64],
    departure_mm: NDArray[np.float64],
    covariance_mm2: NDArray[np.float64],
) -> Posterior:
    """Fit the modes of the departure to N points.

    Args:
        modes: R modes, for the smoothing's lengths.
        smoothing: amplitudes of the D directions.
        u_mm: (N,) material coordinates.
        v_mm: (N,) material coordinates.
        departure_mm: (N, D) departures from the nominal shape.
        covariance_mm2: (N, D, D) noise.
    """
    places = modes.jets(u_mm, v_mm, highest=0)[:, 0]
    weight = np.linalg.inv(covariance_mm2 * smoothing.noise_factor**2).astype(np.float64, copy=False)
    scale = _scale(modes, smoothing)
    normal = _normal(places, weight, scale)
    right = scale * (places.T @ np.einsum("nab,nb->na", weight, departure_mm)).T
    size = right.size
    # LAPACK's Cholesky and triangular inverse: the inverse factor is needed in any case, as the root of the
    # covariance, and solves the equations on the way.
    lower = dpotrf(normal.reshape(size, size), lower=1, overwrite_a=1)[0]
    inverse = dtrtri(lower, lower=1)[0]
    factor = np.tril(inverse).T
    solved = (factor @ (factor.T @ right.ravel())).reshape(right.shape)
    factor = factor.reshape(*right.shape, size) * scale[:, :, np.newaxis]
    coefficients = scale * solved
    residual = departure_mm - places @ coefficients.T
    outlying = _outlying(places, factor, weight, residual)
    squares = float(np.einsum("na,nab,nb->", residual, weight, residual) + (solved[:, FREE:] ** 2).sum())
    return Posterior(coefficients, factor, outlying, squares / (residual.size - FREE * residual.shape[1]))


def _scale(modes: Modes, smoothing: Smoothing) -> NDArray[np.float64]:
    """(D, R): each direction's amplitude; 1 for the free modes."""
    scale = np.repeat(np.array(smoothing.amplitude_mm)[:, np.newaxis], modes.size, axis=1)
    scale[:, :FREE] = 1.0
    return scale


def _normal(
    places: NDArray[np.float64], weight: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(D, R, D, R) matrix of the normal equations, including the prior's unit weights."""
    directions, size = scale.shape
    normal = np.empty((directions, size, directions, size))
    for a in range(directions):
        for b in range(a + 1):
            block = (places * weight[:, a, b, np.newaxis]).T @ places
            block *= np.multiply.outer(scale[a], scale[b])
            normal[a, :, b] = block
            normal[b, :, a] = block.T
        normal[a, np.arange(size), a, np.arange(size)] += 1.0
    return normal


def _outlying(
    places: NDArray[np.float64],
    factor: NDArray[np.float64],
    weight: NDArray[np.float64],
    residual: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Leave-one-out χ² of every point, in closed form instead of N fits."""
    root = np.einsum("nr,ark->nak", places, factor, optimize=True)
    known = root @ root.transpose(0, 2, 1)
    kept = weight - weight @ known @ weight
    pull = np.einsum("nab,nb->na", weight, residual)
    squared: NDArray[np.float64] = np.einsum(
        "na,na->n", pull, np.linalg.solve(kept, pull[..., np.newaxis])[..., 0]
    )
    return squared
