"""The prior of smooth surfaces as modes, and the choice of their smoothness from the points of one or
several fields.

A coordinate's departure from the nominal shape is a spline of degree 5 with a knot at every row and column.
The coefficients' prior covariance is amplitude² · K(rows; length along) ⊗ K(columns; length round), K being
Matérn's correlation of ν = 13/2; its inverse is the penalty, of all but terms linear in u and in v. Its
eigenvectors, scaled to the prior's standard deviation, are the modes: fitting is least squares with unit
weights on their coefficients. By likelihood on collapsing tubes this was far ahead of sums of difference
penalties of any order.

The length round is tuned on simulated tubes that collapse elliptically (radius 12.5 mm, six columns 6.5 mm
apart): squared errors of curvatures are .7 to 1.2 of σ² on average, .4 to 1.3 on other tubes, and up to
twice σ² halfway between columns, or at the outermost ones at 8 bits. If the outermost column comes close to
the fold of a closed wall (radius 11 mm), σ is two to five times too small, which the residuals do not show;
the remedy is more columns, or leaving out the outermost ones.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import comb, factorial
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd_liner.analysis.grid import Grid
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

    @classmethod
    def of(cls, grid: Grid) -> "Domain":
        """A knot at every target of a grid."""
        rows, columns = int(grid.row.max()) + 1, int(grid.column.max()) + 1
        return cls(0.0, 0.0, grid.u_pitch_mm, grid.v_pitch_mm, rows, columns)


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
        self._places: dict[tuple[bytes, bytes, int], Array] = {}

    def jets(self, u_mm: Array, v_mm: Array, highest: int = HIGHEST) -> Array:
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

    def _jets(self, u_mm: Array, v_mm: Array, highest: int) -> Array:
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


def _by_place(place: Array, knots: int, pitch_mm: float, vectors: Array, highest: int) -> Array:
    """(N, highest + 1, 2 + modes): 1, a line from −1 to 1, then the modes; derivatives per mm."""
    straight = np.zeros((len(place), highest + 1, 2))
    straight[:, 0, 0] = 1.0
    half = (knots - 1) / 2
    straight[:, 0, 1], straight[:, 1:2, 1] = place / half - 1, 1 / half
    values = np.concatenate([straight, splines(place, knots - 1, highest) @ vectors], axis=2)
    values /= pitch_mm ** np.arange(highest + 1.0)[:, np.newaxis]
    return values


def _eigenmodes(knots: int, length: float) -> tuple[Array, Array]:
    """Variances and vectors of Matérn's correlation among the splines of one direction; length in knots."""
    centres = np.arange(knots - 1 + DEGREE)
    correlation = matern(np.abs(np.subtract.outer(centres, centres)) / length, _HALF)
    variance, vectors = np.linalg.eigh(correlation)
    return np.maximum(variance, 0.0), vectors


def matern(distance: Array, half: int) -> Array:
    """Matérn's correlation of ν = half + ½ at distances in correlation lengths."""
    scaled = np.sqrt(2 * half + 1) * distance
    terms = [
        factorial(half + k) / (factorial(k) * factorial(half - k)) * (2 * scaled) ** (half - k)
        for k in range(half + 1)
    ]
    return np.exp(-scaled) * factorial(half) / factorial(2 * half) * sum(terms)


DEGREE = 5


@lru_cache(maxsize=1)
def _pieces() -> Array:
    """(6, 6): coefficients [power, spline] of the six splines that live on one interval, argument 0 to 1."""
    pieces = np.zeros((DEGREE + 1, DEGREE + 1))
    for spline in range(DEGREE + 1):
        start = DEGREE - spline
        for knot in range(start + 1):
            weight = (-1) ** knot * comb(DEGREE + 1, knot) / factorial(DEGREE)
            for power in range(DEGREE + 1):
                pieces[power, spline] += weight * comb(DEGREE, power) * (start - knot) ** (DEGREE - power)
    return pieces


def splines(place: Array, intervals: int, highest: int = HIGHEST) -> Array:
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


ROUND = 1.28
"""Correlation length round, in pitches of the columns. It is not chosen from the points: a few columns leave
it open, and longer ones claim more at the outermost columns than is known there (see above)."""

_LENGTHS = (2.0, 4.0, 8.0, 16.0)
_HALVINGS = 2
"""Candidate correlation lengths along the rows, in pitches, and number of refinements of their ratio."""

# A grid over all plausible amplitudes instead of a search: the likelihood may have two maxima.
_AMPLITUDES_MM = 10.0 ** np.arange(-3.0, 2.01, 0.05)

_SHOWN = 4.0
"""Gain in twice the log likelihood from which a departure counts as real: two σ."""


class Smoothing(NamedTuple):
    """The prior's parameters.

    Attributes:
        along_mm: correlation length along the rows of the departure from the nominal shape.
        round_mm: correlation length round the wall.
        amplitude_mm: σ of the departure's x, y, z, beyond terms linear in u and in v.
    """

    along_mm: float
    round_mm: float
    amplitude_mm: tuple[float, ...]


class Departures(NamedTuple):
    """Evidence of one field's points about the departure from the nominal shape.

    Attributes:
        u_mm, v_mm: (N,) material coordinates.
        departure_mm: (N, D) departures in D directions; `sigma_mm`: (N, D) their noise.
    """

    u_mm: Array
    v_mm: Array
    departure_mm: Array
    sigma_mm: Array


def choose(
    domain: Domain,
    fields: Sequence[Departures],
    along_mm: float | None = None,
) -> Smoothing:
    """Choose a common smoothing for fields by restricted likelihood, which takes the points' σ as known.

    The correlation length along the rows is chosen as well, unless it is given.
    """
    round_mm = ROUND * domain.v_pitch_mm

    def tried(length: float) -> _Choice:
        candidate = modes(domain, length * domain.u_pitch_mm, round_mm)
        return _best([_spectra(candidate, field) for field in fields])

    known = () if along_mm is None else (along_mm / domain.u_pitch_mm,)
    choices = {length: tried(length) for length in known or _LENGTHS}
    for halving in range(1, 1 if known else _HALVINGS + 1):
        best = min(choices, key=lambda length: choices[length].cost)
        step = 2.0 ** (0.5**halving)
        choices |= {length: tried(length) for length in (best / step, best * step)}
    best = min(choices, key=lambda length: choices[length].cost)
    chosen = choices[best]
    return Smoothing(best * domain.u_pitch_mm, round_mm, chosen.amplitude_mm)


class _Choice(NamedTuple):
    """Cost and amplitude of each direction at the best amplitudes."""

    cost: float
    amplitude_mm: tuple[float, ...]


class _Spectrum(NamedTuple):
    """One direction of one field: values of unit noise, after the free modes are projected out.

    Attributes:
        energy: (K,) squared singular values of the modes at the points; `part2`: (K,) squared parts of the
            departure along their vectors.
    """

    energy: Array
    part2: Array


def _spectra(candidate: Modes, field: Departures) -> list[_Spectrum]:
    places = candidate.jets(field.u_mm, field.v_mm, highest=0)[:, 0]
    return [
        _spectrum(places / sigma[:, np.newaxis], departure / sigma)
        for departure, sigma in zip(field.departure_mm.T, field.sigma_mm.T, strict=True)
    ]


def _spectrum(design: Array, departure: Array) -> _Spectrum:
    basis = np.linalg.qr(design[:, :FREE], mode="complete")[0][:, FREE:]
    penalised, value = basis.T @ design[:, FREE:], basis.T @ departure
    energy, vectors = np.linalg.eigh(penalised @ penalised.T)
    return _Spectrum(np.maximum(energy, 0.0), (vectors.T @ value) ** 2)


def _best(spectra: list[list[_Spectrum]]) -> _Choice:
    directions = zip(*spectra, strict=True)
    costs = [np.sum([_likelihood(field) for field in direction], axis=0) for direction in directions]
    best = [_shown(cost) for cost in costs]
    total = float(sum(cost[place] for cost, place in zip(costs, best, strict=True)))
    return _Choice(total, tuple(float(_AMPLITUDES_MM[place]) for place in best))


def _shown(cost: Array) -> int:
    """Index of the best amplitude; of the least one unless the points show a significant departure."""
    best = int(np.argmin(cost))
    return best if cost[0] - cost[best] > _SHOWN else 0


def _likelihood(spectrum: _Spectrum) -> Array:
    """Minus twice the log restricted likelihood, at every amplitude."""
    variance = 1 + np.multiply.outer(_AMPLITUDES_MM**2, spectrum.energy)
    return (np.log(variance) + spectrum.part2 / variance).sum(axis=1)
