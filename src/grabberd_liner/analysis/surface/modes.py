"""The prior of smooth surfaces, as modes.

A coordinate's departure from the nominal shape is a tensor-product spline of degree 5 with a knot at every
row and column. Its roughness is penalised apart along and round: the coefficients' prior covariance is
amplitude² · K(rows; length along) ⊗ K(columns; length round), whose inverse is the penalty; K is Matérn's
correlation with ν = 13/2. Terms linear in u and in v are not penalised. The eigenvectors of that covariance
are the modes: scaled to the prior's standard deviation, so that fitting is least squares with unit weights on
their coefficients.

The family was chosen by likelihood on collapsing tubes: it was far ahead of sums of difference penalties of
any order (which trade roughness round against roughness along).
"""

from functools import lru_cache
from math import comb, factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.surface.jets import HIGHEST, ORDERS, count_to

FREE = 4
"""The first modes, free of penalty: 1, u, v, u·v."""

_DIFFUSE_MM = 100.0
"""Prior σ of the free modes: larger than any object, so that they are free in effect."""
_NEGLIGIBLE = 1e-5
"""Share of the greatest variance below which modes are dropped.

With ten times as many digits, curvature moves by less than a tenth of its σ, and σ by less than 5 %.
"""
_HALF = 6
"""ν = 13/2: six times differentiable, as the fourth derivative and its σ require."""
_KEPT = 12


class Domain(NamedTuple):
    """The grid of knots: `rows` × `columns` of them from (u_mm, v_mm) on, at these pitches."""

    u_mm: float
    v_mm: float
    u_pitch_mm: float
    v_pitch_mm: float
    rows: int
    columns: int


class Modes:
    """The prior's modes over a domain, for one pair of correlation lengths.

    Attributes:
        domain: the grid of knots; `along_mm`, `round_mm`: correlation lengths.
        size: number R of modes.
    """

    def __init__(self, domain: Domain, along_mm: float, round_mm: float) -> None:
        self.domain = domain
        self.along_mm, self.round_mm = along_mm, round_mm
        along = _eigenmodes(domain.rows, along_mm / domain.u_pitch_mm)
        across = _eigenmodes(domain.columns, round_mm / domain.v_pitch_mm)
        variance = along[0][:, np.newaxis] * across[0]
        self._row, self._column = np.nonzero(variance > _NEGLIGIBLE * variance.max())
        scale = np.sqrt(variance[self._row, self._column])
        self._along, self._across = along[1], across[1]
        self._scale = np.concatenate([np.full(FREE, _DIFFUSE_MM), scale])
        self.size = len(self._scale)
        self._places: dict[tuple[bytes, bytes, int], NDArray[np.float64]] = {}

    def jets(
        self, u_mm: NDArray[np.float64], v_mm: NDArray[np.float64], highest: int = HIGHEST
    ) -> NDArray[np.float64]:
        """(N, p, R) jets of the modes at N positions, at unit amplitude; results for recent ones are cached.

        Args:
            u_mm: (N,) material coordinates.
            v_mm: (N,) material coordinates.
            highest: order of the highest derivative; p is 15 for 4.
        """
        key = (np.ascontiguousarray(u_mm).tobytes(), np.ascontiguousarray(v_mm).tobytes(), highest)
        kept = self._places.pop(key, None)
        if kept is None:
            kept = self._jets(u_mm, v_mm, highest)
        self._places[key] = kept
        if len(self._places) > _KEPT:
            self._places.pop(next(iter(self._places)))
        return kept

    def _jets(
        self, u_mm: NDArray[np.float64], v_mm: NDArray[np.float64], highest: int
    ) -> NDArray[np.float64]:
        domain, count = self.domain, count_to(highest)
        row, column = (u_mm - domain.u_mm) / domain.u_pitch_mm, (v_mm - domain.v_mm) / domain.v_pitch_mm
        along = _by_place(row, domain.rows, domain.u_pitch_mm, self._along, highest)
        across = _by_place(column, domain.columns, domain.v_pitch_mm, self._across, highest)
        rows = np.concatenate([[0, 1, 0, 1], self._row + 2])
        columns = np.concatenate([[0, 0, 1, 1], self._column + 2])
        values = np.empty((len(u_mm), count, self.size))
        for place, (i, j) in enumerate(ORDERS[:count]):
            np.multiply(along[:, i, rows], across[:, j, columns], out=values[:, place])
        values *= self._scale
        return values


@lru_cache(maxsize=16)
def modes(domain: Domain, along_mm: float, round_mm: float) -> Modes:
    """The modes, cached for recent domains and lengths, since they are expensive to compute."""
    return Modes(domain, along_mm, round_mm)


def _by_place(
    place: NDArray[np.float64], knots: int, pitch_mm: float, vectors: NDArray[np.float64], highest: int
) -> NDArray[np.float64]:
    """(N, highest + 1, 2 + modes): 1, a line from −1 to 1, then the modes; derivatives per mm."""
    straight = np.zeros((len(place), highest + 1, 2))
    straight[:, 0, 0] = 1.0
    half = (knots - 1) / 2
    straight[:, 0, 1], straight[:, 1:2, 1] = place / half - 1, 1 / half
    values = np.concatenate([straight, splines(place, knots - 1, highest) @ vectors], axis=2)
    values /= pitch_mm ** np.arange(highest + 1.0)[:, np.newaxis]
    return values


def _eigenmodes(knots: int, length: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Variances and vectors of Matérn's correlation among the splines of one direction; length in knots."""
    centres = np.arange(knots - 1 + DEGREE)
    correlation = matern(np.abs(np.subtract.outer(centres, centres)) / length, _HALF)
    variance, vectors = np.linalg.eigh(correlation)
    return np.maximum(variance, 0.0), vectors


def matern(distance: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    """Matérn's correlation of ν = half + ½ at distances in correlation lengths."""
    scaled = np.sqrt(2 * half + 1) * distance
    terms = [
        factorial(half + k) / (factorial(k) * factorial(half - k)) * (2 * scaled) ** (half - k)
        for k in range(half + 1)
    ]
    correlation: NDArray[np.float64] = np.exp(-scaled) * factorial(half) / factorial(2 * half) * sum(terms)
    return correlation


DEGREE = 5


@lru_cache(maxsize=1)
def _pieces() -> NDArray[np.float64]:
    """(6, 6): coefficients [power, spline] of the six splines that live on one interval, argument 0 to 1."""
    pieces = np.zeros((DEGREE + 1, DEGREE + 1))
    for spline in range(DEGREE + 1):
        start = DEGREE - spline
        for knot in range(start + 1):
            weight = (-1) ** knot * comb(DEGREE + 1, knot) / factorial(DEGREE)
            for power in range(DEGREE + 1):
                pieces[power, spline] += weight * comb(DEGREE, power) * (start - knot) ** (DEGREE - power)
    return pieces


def splines(place: NDArray[np.float64], intervals: int, highest: int = HIGHEST) -> NDArray[np.float64]:
    """The splines and their derivatives by position.

    Args:
        place: (N,) positions in knot intervals, 0 to `intervals`; beyond, the outermost pieces continue.
        intervals: number of intervals.
        highest: order of the highest derivative.

    Returns:
        (N, highest + 1, intervals + 5): [place, derivative, spline].
    """
    first = np.clip(np.floor(place), 0, intervals - 1).astype(np.intp)
    powers = (place - first)[:, np.newaxis] ** np.arange(DEGREE + 1)
    values = np.zeros((len(place), highest + 1, intervals + DEGREE))
    rows, columns = np.arange(len(place))[:, np.newaxis], first[:, np.newaxis] + np.arange(DEGREE + 1)
    pieces = _pieces()
    for derivative in range(highest + 1):
        values[rows, derivative, columns] = powers[:, : len(pieces)] @ pieces
        pieces = pieces[1:] * np.arange(1, len(pieces))[:, np.newaxis]
    return values
