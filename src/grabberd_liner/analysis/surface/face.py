"""Outer face of the wall as sections and volumes need it, where data support it, and the area that the
targets cover.
"""

from typing import NamedTuple, Protocol

import numpy as np

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.gauss import gauss_rule
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.surface.jets import index
from grabberd_liner.analysis.surface.smoothing import Domain
from grabberd_liner.arrays import Array, Indices, Mask

_REACH = 0.5 + 1e-9
"""Half a pitch; the slack keeps positions halfway between two targets within both."""


class Face(Protocol):
    """The outer (target) face of the wall over material coordinates u, v, at one field."""

    @property
    def domain(self) -> Domain:
        """The grid of targets."""

    @property
    def misfit(self) -> float:
        """Weighted squared departure of the points over its expectation: 1 if the points' σ are right."""

    @property
    def problems(self) -> tuple[str, ...]:
        """Points left out and the reasons, as sentences."""

    def within(self, u_mm: Array, v_mm: Array) -> Mask:
        """(N,) True for positions supported by data."""

    def places_mm(self, u_mm: Array, v_mm: Array) -> Estimate:
        """(N, 3) points X."""

    def tangents(self, u_mm: Array, v_mm: Array) -> Array:
        """(N, 3, 3) X, X_u, X_v."""

    def covariance(self, weights: Array, u_mm: Array, v_mm: Array) -> Array:
        """(k, k) covariance of sums over positions of X, X_u, X_v with weights (k, N, at most 3, 3)."""


def supported_places(grid: Grid, seen: Indices) -> Mask:
    """(rows, columns): True for targets that are seen, or the only missing one among their neighbours."""
    there = np.zeros(len(grid), bool)
    there[seen] = True
    alone = np.ones(len(grid), bool)
    first, second = grid.pairs().T
    np.logical_and.at(alone, first, there[second])
    np.logical_and.at(alone, second, there[first])
    supported = np.zeros((grid.row.max() + 1, grid.column.max() + 1), bool)
    supported[grid.row, grid.column] = there | alone
    return supported


def is_within(domain: Domain, supported: Mask, u_mm: Array, v_mm: Array) -> Mask:
    """(N,) True for positions supported by data.

    These lie within half a pitch (along and round) of a target that was seen, or whose neighbours were
    all seen; not farther outside, nor in a hole of several targets.
    """
    row, column = (u_mm - domain.u_mm) / domain.u_pitch_mm, (v_mm - domain.v_mm) / domain.v_pitch_mm
    near_row = np.clip(np.round(row), 0, domain.rows - 1).astype(np.intp)
    near_column = np.clip(np.round(column), 0, domain.columns - 1).astype(np.intp)
    near = (np.abs(row - near_row) <= _REACH) & (np.abs(column - near_column) <= _REACH)
    return near & supported[near_row, near_column]


# Gauss' rule with two nodes is exact for cubics; half a cell of the wall is hardly more curved than that.
_NODES = 2


class Area(NamedTuple):
    """The wall's outer face between its outermost targets.

    Attributes:
        area_mm2: area supported by data, with σ from the points' noise and the smoothing.
        covered: share of the target grid supported by data; the rest is left out.
    """

    area_mm2: Estimate
    covered: float


def surface_area(surface: Face) -> Area:
    """The area, by Gauss' rule in every half cell of the target grid."""
    domain = surface.domain
    u_mm, u_share = _nodes(domain.u_mm, domain.u_pitch_mm, domain.rows)
    v_mm, v_share = _nodes(domain.v_mm, domain.v_pitch_mm, domain.columns)
    u, v = np.repeat(u_mm, len(v_mm)), np.tile(v_mm, len(u_mm))
    share = np.multiply.outer(u_share, v_share).ravel()
    kept = np.where(surface.within(u, v), share, 0.0)
    jets = surface.tangents(u, v)
    slopes = kept[:, np.newaxis, np.newaxis] * _slopes(jets)
    variance = surface.covariance(slopes[np.newaxis], u, v)[0, 0]
    value = (kept * np.linalg.norm(_normal(jets), axis=1)).sum()
    return Area(Estimate.of(value, np.sqrt(variance)), float(kept.sum() / share.sum()))


def _nodes(start: float, pitch: float, knots: int) -> tuple[Array, Array]:
    node, weight = gauss_rule(_NODES)
    half = pitch / 2
    starts = start + half * np.arange(2 * (knots - 1))
    return (starts[:, np.newaxis] + half * (node + 1) / 2).ravel(), np.tile(half / 2 * weight, len(starts))


def _normal(jets: Array) -> Array:
    return np.cross(jets[:, index(1, 0)], jets[:, index(0, 1)])


def _slopes(jets: Array) -> Array:
    """(N, 3, 3) derivatives of |X_u × X_v| by X, X_u, X_v."""
    normal = _normal(jets)
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    along, across = jets[:, index(1, 0)], jets[:, index(0, 1)]
    return np.stack([np.zeros_like(unit), np.cross(across, unit), np.cross(unit, along)], axis=1)
