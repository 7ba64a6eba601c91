"""Distortion by lens and mirrors, added to the ideal point (paper eqs. 6 and 7).

With x, y reduced to the principal point and r² = x² + y²:

    dx = −b1 x + b2 y + x (b3 r² + b4 r⁴ + b5 r⁶) + b6 (r² + 2x²) + 2 b7 x y − b8 x y²
    dy = +b1 y + b2 x + y (b3 r² + b4 r⁴ + b5 r⁶) + 2 b6 x y + b7 (r² + 2y²) − b9 x² y

b1 is an affinity (with equal signs, as printed in the paper, it would be a scale, which f already is) and b9
is separate from b8. For speed the equations and their slopes are kept as a table over fifteen monomials:

    dx = x·P + y·Q,  dy = y·P + x·Q;  ∂dx/∂x, ∂dy/∂y = S;  ∂dx/∂y, ∂dy/∂x = T   (each for x and for y)

so that a few products and one matrix multiplication give everything, for all points of all views.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ONE, _X, _Y, _XX, _YY, _XY, _R2, _R4, _R6, _XX2, _YY2, _XY2, _XX4, _YY4, _XY4 = range(15)
"""Indices of the monomials; x²r² is _XX2, x²r⁴ is _XX4."""


def polynomials(b: Sequence[float]) -> Array:
    """(4, 2, 15) coefficients of the polynomials P, Q, S, T, each for dx and for dy."""
    return np.tensordot(b, _OF_EACH, axes=1)


def _written_out(b: Sequence[float]) -> Array:
    b1, b2, b3, b4, b5, b6, b7, b8, b9 = b
    radial = {_R2: b3, _R4: b4, _R6: b5}
    return np.array(
        [
            [
                _row({_ONE: -b1, _X: 3 * b6, _Y: 2 * b7, _YY: -b8, **radial}),
                _row({_ONE: +b1, _Y: 3 * b7, _X: 2 * b6, _XX: -b9, **radial}),
            ],
            [_row({_ONE: b2, _Y: b6}), _row({_ONE: b2, _X: b7})],
            [
                _row({_ONE: -b1, _X: 6 * b6, _Y: 2 * b7, _YY: -b8, **radial, **_steep(_XX, _XX2, _XX4, b)}),
                _row({_ONE: +b1, _Y: 6 * b7, _X: 2 * b6, _XX: -b9, **radial, **_steep(_YY, _YY2, _YY4, b)}),
            ],
            [
                _row({_ONE: b2, _Y: 2 * b6, _X: 2 * b7, **_steep(_XY, _XY2, _XY4, b), _XY: 2 * (b3 - b8)}),
                _row({_ONE: b2, _X: 2 * b7, _Y: 2 * b6, **_steep(_XY, _XY2, _XY4, b), _XY: 2 * (b3 - b9)}),
            ],
        ]
    )


def monomials(xy_mm: Array) -> Array:
    """Evaluate the monomials, (V, 15, N), at the ideal points (2, V, N) in mm."""
    _, views, count = xy_mm.shape
    powers = np.empty((15, views, count))
    powers[_ONE] = 1.0
    powers[_X:_XX] = xy_mm
    np.multiply(xy_mm, xy_mm, out=powers[_XX:_XY])
    np.multiply(xy_mm[0], xy_mm[1], out=powers[_XY])
    r2 = np.add(powers[_XX], powers[_YY], out=powers[_R2])
    r4 = np.multiply(r2, r2, out=powers[_R4])
    np.multiply(r4, r2, out=powers[_R6])
    np.multiply(powers[_XX:_R2], r2, out=powers[_XX2:_XX4])
    np.multiply(powers[_XX:_R2], r4, out=powers[_XX4:])
    return powers.swapaxes(0, 1)


def distortion(b: Sequence[float], xy_mm: Array) -> Array:
    """(N, 2) float64, dx and dy in mm at N ideal points (N, 2) in mm; b holds b1…b9 (paper eqs. 6 and 7)."""
    at = xy_mm.T
    own, other, _, _ = np.tensordot(polynomials(b), monomials(at[:, np.newaxis])[0], axes=1)
    added: Array = at * own + at[::-1] * other
    return added.T


def basis(xy_mm: Array) -> Array:
    """(2, V, 9, N) derivatives of dx and dy by b1…b9 at the ideal points (2, V, N) in mm."""
    x, y = xy_mm
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    table = np.zeros((*xy_mm.shape[:2], 9, xy_mm.shape[2]))
    table[0, :, 0], table[1, :, 0] = -x, y
    table[:, :, 1] = xy_mm[::-1]
    table[:, :, 2] = xy_mm * r2
    table[:, :, 3] = table[:, :, 2] * r2
    table[:, :, 4] = table[:, :, 3] * r2
    table[0, :, 5], table[1, :, 6] = r2 + 2 * xx, r2 + 2 * yy
    table[1, :, 5] = table[0, :, 6] = 2 * xy
    table[0, :, 7], table[1, :, 8] = -x * yy, -xx * y
    return table


def _steep(square: int, fourth: int, sixth: int, b: Sequence[float]) -> dict[int, float]:
    """Slope terms of the radial series, added to the series itself; `square` is x², y² or xy."""
    return {square: 2 * b[2], fourth: 4 * b[3], sixth: 6 * b[4]}


def _row(terms: dict[int, float]) -> Array:
    row = np.zeros(15)
    row[list(terms)] = list(terms.values())
    return row


_OF_EACH = np.array([_written_out(one) for one in np.eye(9).tolist()])
"""(9, 4, 2, 15) polynomials of each unit coefficient: they are linear in b1…b9."""
