"""Pose of a view from three known points: up to four solutions in closed form.

Grunert's solution in the form of R. M. Haralick et al., "Review and analysis of solutions of the three point
perspective pose estimation problem", Int. J. Computer Vision 13 (1994) 331–356, equations (9) to (11).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_REAL = 1e-3
"""Imaginary part below which a root counts as real: double roots come out as pairs that are nearly real."""


def poses_of_three(directions: Array, xyz_mm: Array) -> Iterator[tuple[Array, Array]]:
    """Find all poses in which three points are seen in given directions.

    Args:
        directions: (3, 3) unit vectors in the camera's frame, one a row.
        xyz_mm: (3, 3) the points in the object's frame, one a row, not on a line.

    Yields:
        A proper rotation (3, 3) from the object's frame into the camera's, and the projection centre (3,).
    """
    for reach in _distances(directions, xyz_mm):
        if (reach > 0).all():
            yield _pose(directions * reach[:, np.newaxis], xyz_mm)


def _distances(directions: Array, xyz_mm: Array) -> Iterator[Array]:
    """(3,) distances of the points from the projection centre."""
    a2, b2, c2 = (float(((xyz_mm[i] - xyz_mm[k]) ** 2).sum()) for i, k in ((1, 2), (0, 2), (0, 1)))
    alpha, beta, gamma = (float(directions[i] @ directions[k]) for i, k in ((1, 2), (0, 2), (0, 1)))
    less, more = (a2 - c2) / b2, (a2 + c2) / b2
    quartic = [
        (less - 1) ** 2 - 4 * c2 / b2 * alpha**2,
        4 * (less * (1 - less) * beta - (1 - more) * alpha * gamma + 2 * c2 / b2 * alpha**2 * beta),
        2 * (less**2 - 1 + 2 * less**2 * beta**2 + 2 * (b2 - c2) / b2 * alpha**2)
        + 2 * (-4 * more * alpha * beta * gamma + 2 * (b2 - a2) / b2 * gamma**2),
        4 * (-less * (1 + less) * beta + 2 * a2 / b2 * gamma**2 * beta - (1 - more) * alpha * gamma),
        (1 + less) ** 2 - 4 * a2 / b2 * gamma**2,
    ]
    for root in np.roots(quartic):
        v, below = float(root.real), 2 * (gamma - float(root.real) * alpha)
        if abs(root.imag) > _REAL * max(1.0, abs(v)) or v <= 0 or below == 0:
            continue
        u = ((less - 1) * v * v - 2 * less * beta * v + 1 + less) / below
        yield np.sqrt(b2 / (1 + v * v - 2 * v * beta)) * np.array([1.0, u, v])


def _pose(camera_mm: Array, xyz_mm: Array) -> tuple[Array, Array]:
    """Rigid motion from the object's frame into the camera's, after Kabsch."""
    middle, seen = xyz_mm.mean(axis=0), camera_mm.mean(axis=0)
    left, _, right = np.linalg.svd((camera_mm - seen).T @ (xyz_mm - middle))
    proper = np.diag([1.0, 1.0, np.linalg.det(left) * np.linalg.det(right)])
    rotation = left @ proper @ right
    return rotation, middle - rotation.T @ seen
