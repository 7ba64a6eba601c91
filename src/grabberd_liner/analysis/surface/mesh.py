"""A surface as a fine mesh: of flat facets for drawing, of Taylor polynomials for ray casting."""

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.surface.jets import ORDERS, Jets
from grabberd_liner.analysis.surface.surface import Surface

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

    u_mm: NDArray[np.float64]
    v_mm: NDArray[np.float64]
    jets: Jets
    supported: NDArray[np.bool_]

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
    def xyz_mm(self) -> NDArray[np.float64]:
        """(P, Q, 3) the corners in the object's frame."""
        return self.jets[:, :, 0]

    def tangents(self, u_mm: NDArray[np.float64], v_mm: NDArray[np.float64]) -> NDArray[np.float64]:
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
        tangents: NDArray[np.float64] = weights @ self.jets[row, column]
        return tangents

    def corners(self) -> NDArray[np.intp]:
        """(F, 4) indices into the flattened corners of the supported facets, in cyclic order."""
        index = np.arange(self.u_mm.size).reshape(self.u_mm.shape)
        four = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
        return four[self.supported]


def middles(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(P − 1, Q − 1) means of the four corners (P, Q) of each facet."""
    mean: NDArray[np.float64] = (values[:-1, :-1] + values[1:, :-1] + values[1:, 1:] + values[:-1, 1:]) / 4
    return mean


def _steps(targets: int) -> NDArray[np.float64]:
    """Corners from half a pitch before the first target to half a pitch beyond the last, in pitches."""
    return np.arange(targets * PER_PITCH + 1) / PER_PITCH - 0.5


def _taylor(du_mm: NDArray[np.float64], dv_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 15) weights of a jet's entries in X, X_u and X_v at these distances from its position."""
    along, across = (_powers(step) for step in (du_mm, dv_mm))
    weights = np.zeros((len(du_mm), 3, len(ORDERS)))
    for place, (i, j) in enumerate(ORDERS):
        weights[:, 0, place] = along[i] * across[j]
        if i:
            weights[:, 1, place] = along[i - 1] * across[j]
        if j:
            weights[:, 2, place] = along[i] * across[j - 1]
    return weights


def _powers(step: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """step^k / k!, k from 0 to 4."""
    return [step**k / factorial(k) for k in range(5)]
