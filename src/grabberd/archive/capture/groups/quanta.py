"""The quanta of stored points: how finely a capture file keeps each number, decided here and nowhere else.

| number | kept |
|---|---|
| position | to whole 10⁻⁴ mm: 1/500 of the σ of one field |
| image coordinates, residual | to whole 10⁻³ px: 1/100 of their σ |
| covariances | their Cholesky factors in half precision: an element to 10⁻³ of the product of its σ |

A factor, rather than the matrix itself: what it gives back is symmetric and has no negative variance in any
direction, however long and thin the ellipsoid of errors is. A number that no quantum fits is kept whole.
Every number is decided by itself, so that a point is the same whichever others are stored with it.
"""

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.points import Points

PER_MM = 10_000
PER_PX = 1_000
LARGEST_WHOLE = 2**31 - 1
LARGEST_CHANGE = 1e-3
"""Change of an element of a covariance, relative to the variances of its row and its column."""
UPPER = np.triu_indices(3)
"""Indices of a covariance's six elements: xx, xy, xz, yy, yz, zz."""


def quantised(points: Points) -> Points:
    """Points as a file gives them back; quantising again changes nothing."""
    return Points(
        target=points.target,
        xyz_mm=rounded(points.xyz_mm, PER_MM),
        covariance_mm2=symmetric(rounded_covariance(points.covariance_mm2)),
        calibration_covariance_mm2=symmetric(rounded_covariance(points.calibration_covariance_mm2)),
        image_px=rounded(points.image_px, PER_PX),
        residual_px=rounded(points.residual_px, PER_PX),
    )


def whole(values: NDArray[np.float64], per_unit: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Values in whole quanta, and which of them are numbers that fit into 32 bits."""
    with np.errstate(invalid="ignore", over="ignore"):
        quanta = np.rint(values * per_unit) + 0.0  # no negative zero, which an integer cannot keep
        return quanta, np.abs(quanta) <= LARGEST_WHOLE


def rounded(values: NDArray[np.float64], per_unit: int) -> NDArray[np.float64]:
    """Values rounded to quanta; those that do not fit stay as they are."""
    quanta, fits = whole(values, per_unit)
    return np.where(fits, quanta / per_unit, values)


def factors(covariance: NDArray[np.float64]) -> tuple[NDArray[np.float16], NDArray[np.bool_]]:
    """(N, 6) elements of the Cholesky factors of (N, 3, 3) covariances, and which of them are near enough.

    The elements are the columns of the lower factor: xx, xy, xz, yy, yz, zz.
    """
    xx, xy, xz, yy, yz, zz = elements = covariance[:, *UPPER].T
    with np.errstate(all="ignore"):
        a = np.sqrt(xx)
        b, c = _quotient(xy, a), _quotient(xz, a)
        d = np.sqrt(np.maximum(yy - b * b, 0.0))
        e = _quotient(yz - b * c, d)
        f = np.sqrt(np.maximum(zz - c * c - e * e, 0.0))
        half = np.stack((a, b, c, d, e, f), axis=1).astype(np.float16)
        deviation = np.sqrt([xx, yy, zz])
        allowed = LARGEST_CHANGE * deviation[UPPER[0]] * deviation[UPPER[1]]
        near = np.abs(product(half).T - elements) <= allowed
    return half, np.logical_and.reduce(near)


def _quotient(value: NDArray[np.float64], by: NDArray[np.float64]) -> NDArray[np.float64]:
    """0 where nothing is divided by nothing: a variance of 0 has no covariances."""
    return np.where(by > 0, value / by, 0.0)


def product(half: NDArray[np.float16]) -> NDArray[np.float64]:
    """(N, 6) elements xx, xy, xz, yy, yz, zz of the covariances of (N, 6) factors."""
    a, b, c, d, e, f = half.astype(np.float64).T
    with np.errstate(invalid="ignore"):  # factors beyond half precision's range, or in a damaged file
        return np.stack((a * a, a * b, a * c, b * b + d * d, b * c + d * e, c * c + e * e + f * f), axis=1)


def rounded_covariance(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 6) elements of (N, 3, 3) covariances by rounded factors; those not near stay as they are."""
    half, near = factors(covariance)
    return np.where(near[:, None], product(half), covariance[:, *UPPER])


def symmetric(elements: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 3) matrices of their (N, 6) elements."""
    full = np.empty((len(elements), 3, 3))
    full[:, *UPPER] = elements
    full[:, UPPER[1], UPPER[0]] = elements
    return full
