"""Outer face of the wall as areas, sections and volumes need it, and where data support it."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.surface.modes import Domain

Array = NDArray[np.float64]

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

    def within(self, u_mm: Array, v_mm: Array) -> NDArray[np.bool_]:
        """(N,) True for positions supported by data."""

    def places_mm(self, u_mm: Array, v_mm: Array) -> Estimate:
        """(N, 3) points X."""

    def tangents(self, u_mm: Array, v_mm: Array) -> Array:
        """(N, 3, 3) X, X_u, X_v."""

    def covariance(self, weights: Array, u_mm: Array, v_mm: Array) -> Array:
        """(k, k) covariance of sums over positions of X, X_u, X_v with weights (k, N, at most 3, 3)."""


def supported_places(grid: Grid, seen: NDArray[np.intp]) -> NDArray[np.bool_]:
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


def is_within(domain: Domain, supported: NDArray[np.bool_], u_mm: Array, v_mm: Array) -> NDArray[np.bool_]:
    """(N,) True for positions supported by data.

    These lie within half a pitch (along and round) of a target that was seen, or whose neighbours were
    all seen; not farther outside, nor in a hole of several targets.
    """
    row, column = (u_mm - domain.u_mm) / domain.u_pitch_mm, (v_mm - domain.v_mm) / domain.v_pitch_mm
    near_row = np.clip(np.round(row), 0, domain.rows - 1).astype(np.intp)
    near_column = np.clip(np.round(column), 0, domain.columns - 1).astype(np.intp)
    near = (np.abs(row - near_row) <= _REACH) & (np.abs(column - near_column) <= _REACH)
    within: NDArray[np.bool_] = near & supported[near_row, near_column]
    return within
