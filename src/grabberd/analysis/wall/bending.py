"""The wall's bending: the divergence of its moments, from jets of the fourth order.

All is exact for the jets given: the tensors vary round a place as Taylor series of the second degree, and are
differentiated as such.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.surface.jets import Jets, index
from grabberd.analysis.wall.taylor import Taylor, total

Array = NDArray[np.float64]
Vector = tuple[Taylor, Taylor, Taylor]
Matrix = tuple[tuple[Taylor, Taylor], tuple[Taylor, Taylor]]

_DERIVATIVES = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
_DEGREES = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
_WEIGHTS = np.array([1.0, 1.0, 1.0, 0.5, 1.0, 0.5])


class MiddleSurface(NamedTuple):
    """Variation of the middle surface's forms around some positions.

    Attributes:
        first: first fundamental form, covariant components.
        root: √(det first).
        curvature_per_mm: mixed components κ^α_β, positive with the centre inside.
        second_per_mm: second fundamental form, covariant components.
        face: the derivatives of the face by u, v, uu, uv, vv, three components each, that it was made of.
    """

    first: Matrix
    root: Taylor
    curvature_per_mm: Matrix
    second_per_mm: Matrix
    face: tuple[Vector, ...]


def middle_surface(jets: Jets, depth_mm: float | Array, outward: float = 1.0) -> MiddleSurface:
    """The middle surface at a depth below the face that the jets (..., 15, 3) belong to."""
    face = tuple(_series(jets, i, j) for i, j in _DERIVATIVES)
    first, second, root = _outer(face, outward)
    inverse_square = root.power(-2.0)
    curvature = _each(lambda c: c * inverse_square, _dot_matrix(_adjugate(first), second))
    mean_twice, gauss = curvature[0][0] + curvature[1][1], _determinant(curvature)
    sunk, kept = gauss.times(depth_mm), mean_twice.times(depth_mm)
    ratio = (sunk.times(depth_mm) - kept).plus(1.0)
    inverse = ratio.power(-1.0)
    (a, b), (c, d) = curvature
    return MiddleSurface(
        first=_combined(
            sunk.times(depth_mm).times(-1.0).plus(1.0), first, kept.plus(-2.0).times(depth_mm), second
        ),
        root=root * ratio,
        curvature_per_mm=(((a - sunk) * inverse, b * inverse), (c * inverse, (d - sunk) * inverse)),
        second_per_mm=_combined(sunk, first, kept.times(-1.0).plus(1.0), second),
        face=face,
    )


def frozen(surface: MiddleSurface) -> MiddleSurface:
    """The same surface, taken as given: no sweep asks what it was made of."""
    first, curvature, second = (
        _each(lambda series: Taylor(series.values), matrix)
        for matrix in (surface.first, surface.curvature_per_mm, surface.second_per_mm)
    )
    return MiddleSurface(first, Taylor(surface.root.values), curvature, second, surface.face)


def jets_gradient(bars: list[Array]) -> Array:
    """(..., 15, 3) the derivatives by the jets, from those by the series of `MiddleSurface.face`."""
    result = np.zeros((15, 3, *bars[0].shape[1:]))
    for at, (i, j) in enumerate(_DERIVATIVES):
        for axis in range(3):
            for (a, b), weight, bar in zip(_DEGREES, _WEIGHTS, bars[3 * at + axis], strict=True):
                result[index(i + a, j + b), axis] += weight * bar
    return np.moveaxis(result, (0, 1), (-2, -1))


def moment_divergence(surface: MiddleSurface, unbent: Matrix, poisson: float | Array) -> Taylor:
    """∇∇:M / D in 1/mm³, with M = D [(1 − ν) k + ν tr k g] and k = II − II of the unbent wall.

    Args:
        surface: the middle surface.
        unbent: covariant components of the unbent wall's second form in 1/mm, carried by the material.
        poisson: (...) ν.
    """
    adjugate, inverse = _adjugate(surface.first), surface.root.power(-1.0)
    carried = _dot_matrix(_each(lambda c: c * (inverse * inverse), adjugate), unbent)
    (a, b), (c, d) = surface.curvature_per_mm
    bent = ((a - carried[0][0], b - carried[0][1]), (c - carried[1][0], d - carried[1][1]))
    turned = _dot_matrix(bent, adjugate)
    even = (bent[0][0] + bent[1][1]).times(poisson)
    own = 1 - np.asarray(poisson)
    density = (
        (turned[i][j].times(own) + even * adjugate[i][j]) * inverse for i, j in ((0, 0), (0, 1), (1, 1))
    )
    return _double_divergence(surface, _symmetric(*density))


def _double_divergence(surface: MiddleSurface, density: Matrix) -> Taylor:
    """∇_α ∇_β M^αβ from the density √g M^αβ, symmetric: (∂_α (∂_β m^αβ + Γ^α_βγ m^βγ)) / √g."""
    (e, f), (_, g) = surface.first
    m11, m12, m22 = (m.linear() for m in (density[0][0], density[0][1], density[1][1]))
    half11, half22 = m11.times(0.5), m22.times(0.5)
    low_u = e.by_u() * half11 + e.by_v() * m12 + (f.by_v().times(2.0) - g.by_u()) * half22
    low_v = (f.by_u().times(2.0) - e.by_v()) * half11 + g.by_u() * m12 + g.by_v() * half22
    inverse = surface.root.power(-2.0).linear()
    e, f, g = ((c.linear() * inverse) for c in (e, f, g))
    flux_u = density[0][0].by_u() + density[0][1].by_v() + (g * low_u - f * low_v)
    flux_v = density[0][1].by_u() + density[1][1].by_v() + (e * low_v - f * low_u)
    return (flux_u.by_u() + flux_v.by_v()) * surface.root.constant().power(-1.0)


def _series(jets: Jets, i: int, j: int) -> Vector:
    """The series of ∂^(i+j) X / ∂u^i ∂v^j."""
    places = [index(i + a, j + b) for a, b in _DEGREES]
    values = np.moveaxis(jets[..., places, :] * _WEIGHTS[:, None], (-1, -2), (0, 1))
    x, y, z = np.ascontiguousarray(values)
    return Taylor(x), Taylor(y), Taylor(z)


def _outer(face: tuple[Vector, ...], outward: float) -> tuple[Matrix, Matrix, Taylor]:
    """First and second form of the face, and the root of the first's determinant."""
    by_u, by_v, *seconds = face
    normal = _cross(by_u, by_v)
    root = _dot(normal, normal).power(0.5)
    scale = root.power(-1.0).times(-outward)
    second = _symmetric(*(_dot(vector, normal) * scale for vector in seconds))
    return _symmetric(_dot(by_u, by_u), _dot(by_u, by_v), _dot(by_v, by_v)), second, root


def _combined(of_first: Taylor, first: Matrix, of_second: Taylor, second: Matrix) -> Matrix:
    """A symmetric combination of the two forms of the face."""
    pairs = ((0, 0), (0, 1), (1, 1))
    return _symmetric(*(of_first * first[i][j] + of_second * second[i][j] for i, j in pairs))


def _dot(first: Vector, second: Vector) -> Taylor:
    return total(a * b for a, b in zip(first, second, strict=True))


def _cross(first: Vector, second: Vector) -> Vector:
    (a, b, c), (d, e, f) = first, second
    return b * f - c * e, c * d - a * f, a * e - b * d


def _symmetric(uu: Taylor, uv: Taylor, vv: Taylor) -> Matrix:
    return (uu, uv), (uv, vv)


def _adjugate(matrix: Matrix) -> Matrix:
    """The adjugate of a symmetric matrix."""
    off = matrix[0][1].times(-1.0)
    return (matrix[1][1], off), (off, matrix[0][0])


def _determinant(matrix: Matrix) -> Taylor:
    return matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0]


def _dot_matrix(first: Matrix, second: Matrix) -> Matrix:
    (a, b), (c, d) = first
    (e, f), (g, h) = second
    return (a * e + b * g, a * f + b * h), (c * e + d * g, c * f + d * h)


def _each(function: Callable[[Taylor], Taylor], matrix: Matrix) -> Matrix:
    (a, b), (c, d) = matrix
    return (function(a), function(b)), (function(c), function(d))
