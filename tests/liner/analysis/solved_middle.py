"""Middle surface of walls that were solved as solids: its curvature and strain, from their outer faces.

The tables hold the outer face at nodes, through which splines are laid. The middle is the parallel surface at
the depth where half of the rubber lies above it: rubber keeps its volume. No code of the analysis is used.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import RectBivariateSpline

from .walls import SolvedLiner

_NEWTON_STEPS = 20


class Middle(NamedTuple):
    """The middle surface under N targets.

    Attributes:
        curvature_per_m: (N, 2) principal ones, the greater first; `strain`: (N, 2) λ − 1 since 0 kPa.
    """

    curvature_per_m: np.ndarray
    strain: np.ndarray


def solved_middle(liner: SolvedLiner, outer_kpa: float) -> Middle:
    """Truth at a pressure difference."""
    first, bent = _outer_forms(liner, outer_kpa)
    mounted, round_ = _outer_forms(liner, 0.0)
    half_mm = liner.design["wall_mm"] / 2
    before = np.full(len(first), half_mm)
    area = np.sqrt(np.linalg.det(mounted) / np.linalg.det(first))
    now = _depth_mm(
        _eigenvalues(first, bent), _volume(_eigenvalues(mounted, round_), before)[0] * area, half_mm
    )
    middles = _parallel(mounted, round_, before), _parallel(first, bent, now)
    outer = _eigenvalues(first, bent)
    curvature = 1e3 * outer / (1 - now[:, np.newaxis] * outer)
    return Middle(curvature, np.sqrt(_eigenvalues(*middles)) - 1)


def _outer_forms(liner: SolvedLiner, outer_kpa: float) -> tuple[np.ndarray, np.ndarray]:
    """First and second form (N, 2, 2) of the outer face, curvature positive with the centre inside."""
    quarter, theta, radius_mm = (
        liner.states.outer_mm(outer_kpa),
        liner.states.theta,
        liner.design["radius_mm"],
    )
    half = np.concatenate([quarter[:, :0:-1] * [1, -1, 1], quarter], axis=1)
    s_mm = np.concatenate([-theta[:0:-1], theta]) * radius_mm
    splines = [RectBivariateSpline(liner.states.x_mm, s_mm, half[..., axis]) for axis in range(3)]
    at = liner.x_mm[liner.grid.row], liner.theta[liner.grid.column] * radius_mm

    def by(along: int, around: int) -> np.ndarray:
        return np.stack([one.ev(*at, dx=along, dy=around) for one in splines], axis=1)

    tangents = np.stack([by(1, 0), by(0, 1)], axis=1)
    normal = np.cross(tangents[:, 0], tangents[:, 1])
    normal *= np.sign(normal[:, 2].sum()) / np.linalg.norm(normal, axis=1, keepdims=True)
    seconds = np.stack([by(2, 0), by(1, 1), by(1, 1), by(0, 2)], axis=1).reshape(-1, 2, 2, 3)
    return tangents @ tangents.transpose(0, 2, 1), -np.einsum("nabi,ni->nab", seconds, normal)


def _volume(curvature, depth_mm):
    """Volume per area of the face of the layers down to a depth, and its slope."""
    mean, gaussian = curvature.mean(axis=1), curvature.prod(axis=1)
    volume = depth_mm - mean * depth_mm**2 + gaussian * depth_mm**3 / 3
    return volume, 1 - 2 * mean * depth_mm + gaussian * depth_mm**2


def _depth_mm(curvature, volume, start_mm):
    """(N,) depth down to which the layers have that volume per area of the face."""
    depth = np.full(len(volume), start_mm)
    for _ in range(_NEWTON_STEPS):
        found, slope = _volume(curvature, depth)
        depth = depth - (found - volume) / slope
    return depth


def _parallel(first, second, depth_mm):
    """(N, 2, 2) first form of the parallel surface: I − 2 d II + d² II I⁻¹ II."""
    depth = depth_mm[:, np.newaxis, np.newaxis]
    return first - 2 * depth * second + depth**2 * second @ np.linalg.solve(first, second)


def _eigenvalues(first, second):
    """(N, 2) of the second form by the first, the greater first."""
    return np.sort(np.linalg.eigvals(np.linalg.solve(first, second)).real, axis=1)[:, ::-1]
