"""The simulated liner's outer face, exact at any place, and points of it with noise."""

from functools import lru_cache

import numpy as np

from grabberd.core.reconstruction import ObjectModel, Points
from grabberd_fake import liner as ellipse
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.surface.jets import ORDERS

ROWS, COLUMNS, PITCH_MM = 18, 6, 6.5
RADIUS_MM, WALL_MM, LENGTH_MM, AXIS_Z_MM, DEFLECTION_MM = 12.5, 2.5, 130.0, -9.0, 5.0
SIGMA_8_BIT_MM = np.array([0.02, 0.02, 0.03])
SIGMA_1_BIT_MM = 3 * SIGMA_8_BIT_MM


def middle(row, column, closed):
    """(..., 3) middle surface at (fractional) rows and columns, `closed` from 0 to 1."""
    row, column = np.broadcast_arrays(row, column)
    x, s = (row - (ROWS - 1) / 2) * PITCH_MM, (column - (COLUMNS - 1) / 2) * PITCH_MM
    p = 1 - DEFLECTION_MM / RADIUS_MM * closed * np.cos(np.pi * x.ravel() / LENGTH_MM) ** 2
    q = ellipse.widened(p)
    theta = ellipse.eccentric_angle(p, q, s.ravel() / RADIUS_MM)
    y, z = (RADIUS_MM * q * np.sin(theta)).reshape(x.shape), (RADIUS_MM * p * np.cos(theta)).reshape(x.shape)
    return np.stack([x, y, z + AXIS_Z_MM], axis=-1)


def outer(row, column, closed, step=1e-4):
    """(..., 3) the outer face over the same place of the middle surface."""
    along = middle(row + step, column, closed) - middle(row - step, column, closed)
    across = middle(row, column + step, closed) - middle(row, column - step, closed)
    normal = np.cross(along, across)
    return middle(row, column, closed) + normal / np.linalg.norm(normal, axis=-1, keepdims=True) * WALL_MM / 2


@lru_cache
def model():
    row, column = np.divmod(np.arange(ROWS * COLUMNS, dtype=np.int32), np.int32(COLUMNS))
    ids = np.arange(1, ROWS * COLUMNS + 1, dtype=np.int32)
    return ObjectModel("liner", ids, outer(row, column, 0.0), row, column, 1.5, 0.05)


@lru_cache
def grid():
    return Grid.of(model())


@lru_cache
def curvature_per_m(closed, step=3e-3):
    """(108, 2) true κ1 ≥ κ2 of the outer face at the targets, from differences of exact places."""
    row, column = grid().row.astype(float), grid().column.astype(float)

    def at(i, j):
        return outer(row + i * step, column + j * step, closed)

    here = at(0, 0)
    along, across = (at(1, 0) - at(-1, 0)) / 2, (at(0, 1) - at(0, -1)) / 2
    second = (
        at(1, 0) - 2 * here + at(-1, 0),
        (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / 4,
        at(0, 1) - 2 * here + at(0, -1),
    )
    normal = np.cross(along, across)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    first = [(a * b).sum(axis=1) for a, b in ((along, along), (along, across), (across, across))]
    bent = [-(part * normal).sum(axis=1) for part in second]
    first, bent = (np.stack([f[0], f[1], f[1], f[2]], axis=1).reshape(-1, 2, 2) for f in (first, bent))
    return 1e3 * np.sort(np.linalg.eigvals(np.linalg.solve(first, bent)).real, axis=1)[:, ::-1]


def points(closed, sigma_mm, rng, missing=0.0):
    """One field's points, noise independent from target to target."""
    seen = rng.random(len(grid())) >= missing
    exact = outer(grid().row.astype(float), grid().column.astype(float), closed)[seen]
    return as_points(grid().target[seen], exact + rng.normal(size=exact.shape) * sigma_mm, sigma_mm)


def as_points(target, xyz, sigma_mm):
    count = len(target)
    covariance = np.tile(np.diag(np.broadcast_to(sigma_mm, 3) ** 2.0), (count, 1, 1))
    empty = np.zeros((count, 3, 3))
    return Points(target, xyz, covariance, empty, np.zeros((count, 2, 2)), np.zeros(count))


def by_differences(jets_at, u_mm, v_mm, step=1e-3):
    """(N, 15, 3) derivatives from differences of the next lower ones; order 0 as it is."""
    jets = jets_at(u_mm, v_mm)
    ahead_u, behind_u = jets_at(u_mm + step, v_mm), jets_at(u_mm - step, v_mm)
    ahead_v, behind_v = jets_at(u_mm, v_mm + step), jets_at(u_mm, v_mm - step)
    result = jets.copy()
    for place, (i, j) in enumerate(ORDERS):
        if i:
            result[:, place] = (ahead_u - behind_u)[:, ORDERS.index((i - 1, j))] / (2 * step)
        elif j:
            result[:, place] = (ahead_v - behind_v)[:, ORDERS.index((i, j - 1))] / (2 * step)
    return result
