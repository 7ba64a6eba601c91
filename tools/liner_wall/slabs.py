"""Linear equations of a tube: block tridiagonal in its sections, solved slab by slab.

Every brick joins three node sections. The middle one is eliminated inside its slab, what remains couples
neighbouring sections alone. Dense blocks of a few hundred unknowns are what LAPACK is fastest at.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve, lu_factor, lu_solve

from tools.liner_wall.mesh import Array, Face, TubeMesh


def solve_slabs(
    mesh: TubeMesh, blocks: tuple[Array, Array, Array], forces: Array, held: NDArray[np.bool_], drag: float
) -> Array:
    """Shifts (N, 3) under forces (N, 3).

    Args:
        mesh: mesh.
        blocks: stiffness (E, 27, 3, 27, 3) of the bricks, and (F, 27, 3, 27, 3) of outer and inner facets.
        forces: out-of-balance forces.
        held: (N, 3) coordinates that do not move.
        drag: added to every diagonal.
    """
    slabs = _slab_matrices(mesh, blocks, held, drag)
    size = 3 * mesh.per_section
    load = np.where(held, 0.0, forces).reshape(mesh.sections, size)
    return _sweep(slabs, load, size).reshape(-1, 3)


def is_stable(mesh: TubeMesh, blocks: tuple[Array, Array, Array], held: NDArray[np.bool_]) -> bool:
    """True if the stiffness is positive definite: the tube comes back after any small push."""
    inner, end = 6 * mesh.per_section, slice(6 * mesh.per_section, None)
    carried = np.zeros((inner // 2, inner // 2))
    try:
        for matrix in _slab_matrices(mesh, blocks, held, 0.0):
            # Friction's stiffness is not symmetric; energy is taken up by the symmetric part alone.
            symmetric = (matrix + matrix.T) / 2
            symmetric[: inner // 2, : inner // 2] += carried
            factor = cho_factor(symmetric[:inner, :inner])
            carried = symmetric[end, end] - symmetric[end, :inner] @ cho_solve(factor, symmetric[:inner, end])
        cho_factor(carried)
    except LinAlgError:
        return False
    return True


def _slab_matrices(
    mesh: TubeMesh, blocks: tuple[Array, Array, Array], held: NDArray[np.bool_], drag: float
) -> Array:
    """(slabs, 3 s, 3 s) stiffness of each slab's three sections."""
    count, size = mesh.sections // 2, 9 * mesh.per_section
    matrices = np.zeros((count, size, size))
    faces: tuple[Face, ...] = (mesh.outer, mesh.inner)
    for nodes, block in zip((mesh.bricks.nodes, *(f.nodes for f in faces)), blocks, strict=True):
        slab = nodes.min(axis=1) // (2 * mesh.per_section)
        rows = (3 * (nodes - slab[:, np.newaxis] * 2 * mesh.per_section))[:, :, np.newaxis] + np.arange(3)
        rows = rows.reshape(len(nodes), -1)
        dense = block.reshape(len(nodes), rows.shape[1], rows.shape[1])
        # One by one: bricks of a slab share nodes, which one fancy-indexed += would not add up.
        for k, row, values in zip(slab.tolist(), rows, dense, strict=True):
            matrices[k][np.ix_(row, row)] += values
    for k, matrix in enumerate(matrices):
        fixed = np.flatnonzero(held[2 * k * mesh.per_section :][: 3 * mesh.per_section].ravel())
        matrix[fixed] = 0.0
        matrix[:, fixed] = 0.0
        # Neighbouring slabs share a section: the drag of its nodes is counted in the slab that begins there.
        share = np.full(size, drag)
        share[2 * size // 3 :] = drag if k == count - 1 else 0.0
        share[fixed] = 1.0
        matrix[np.arange(size), np.arange(size)] += share
    return matrices


def _sweep(slabs: Array, load: Array, size: int) -> Array:
    """Eliminates from one end to the other, then substitutes back."""
    a, m, b = slice(0, size), slice(size, 2 * size), slice(2 * size, 3 * size)
    carried, carried_load = np.zeros((size, size)), load[0]
    middles, ends = [], []
    for k, matrix in enumerate(slabs):
        matrix[a, a] += carried
        inner = np.hstack([matrix[m, a], matrix[m, b], load[2 * k + 1][:, np.newaxis]])
        solved = lu_solve(lu_factor(matrix[m, m], overwrite_a=True), inner, overwrite_b=True)
        middles.append(solved)
        outer = np.vstack([matrix[a, m], matrix[b, m]]) @ solved
        first = np.hstack([matrix[a, b], carried_load[:, np.newaxis]]) - outer[:size, size:]
        first = lu_solve(lu_factor(matrix[a, a] - outer[:size, :size]), first)
        ends.append(first)
        below = matrix[b, a] - outer[size:, :size]
        carried = matrix[b, b] - outer[size:, size : 2 * size] - below @ first[:, :size]
        carried_load = load[2 * k + 2] - outer[size:, -1] - below @ first[:, -1]
    shifts = np.empty_like(load)
    shifts[-1] = np.linalg.solve(carried, carried_load)
    for k in reversed(range(len(slabs))):
        shifts[2 * k] = ends[k][:, -1] - ends[k][:, :size] @ shifts[2 * k + 2]
        near = np.concatenate([shifts[2 * k], shifts[2 * k + 2]])
        shifts[2 * k + 1] = middles[k][:, -1] - middles[k][:, :-1] @ near
    return shifts
