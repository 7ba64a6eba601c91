"""The area of the wall that the targets cover."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.gauss import gauss_rule
from grabberd_liner.analysis.surface.face import Face
from grabberd_liner.analysis.surface.jets import index

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
    return Area(Estimate(np.asarray(value), np.sqrt(variance)), float(kept.sum() / share.sum()))


def _nodes(start: float, pitch: float, knots: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    node, weight = gauss_rule(_NODES)
    half = pitch / 2
    starts = start + half * np.arange(2 * (knots - 1))
    return (starts[:, np.newaxis] + half * (node + 1) / 2).ravel(), np.tile(half / 2 * weight, len(starts))


def _normal(jets: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.cross(jets[:, index(1, 0)], jets[:, index(0, 1)])


def _slopes(jets: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 3) derivatives of |X_u × X_v| by X, X_u, X_v."""
    normal = _normal(jets)
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    along, across = jets[:, index(1, 0)], jets[:, index(0, 1)]
    return np.stack([np.zeros_like(unit), np.cross(across, unit), np.cross(unit, along)], axis=1)
