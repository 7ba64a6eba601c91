"""Blocks of the wall's unknowns: what one dense matrix would give."""

import numpy as np
import pytest

from grabberd_liner.analysis.wall.half_tube import Cuts
from grabberd_liner.analysis.wall.rubber import Factors, Forces, Rows
from grabberd_liner.analysis.wall.splines import GAUSS_ALONG, GAUSS_ROUND, SplineAxis, SplineGrid

GRID = SplineGrid(SplineAxis.over(0.0, 1.0, 3), SplineAxis.over(0.0, 1.0, 6))
ARCS, SLABS = 3, 6
MEMBERS = GRID.basis(*GRID.quadrature()[:2]).members[:: GAUSS_ROUND * GAUSS_ALONG]
CUTS = Cuts.of(GRID)
ROWS = Rows.of(CUTS.order.reshape(GRID.along.count, GRID.around.count, 4))
UNKNOWNS = CUTS.order[MEMBERS].reshape(-1, 64)


def patches(seed: int):
    """Matrices without symmetry, like those of a wall under a load that turns with it."""
    noise = np.random.default_rng(seed).normal(size=(len(MEMBERS), 64, 64))
    return noise / 64 + 10 * np.eye(64)


def dense(matrices):
    total = np.zeros((CUTS.count, CUTS.count))
    for unknowns, matrix in zip(UNKNOWNS, matrices, strict=True):
        free = unknowns >= 0
        np.add.at(total, np.ix_(unknowns[free], unknowns[free]), matrix[np.ix_(free, free)])
    return total


def factors(matrices) -> Factors:
    band = ROWS.band()
    for slab in range(SLABS):
        ROWS.add_stiffness(band, slab, matrices[slab * ARCS : (slab + 1) * ARCS])
    return Factors(ROWS, band)


@pytest.mark.parametrize("transposed", [False, True])
def test_solutions_are_those_of_the_dense_sum(transposed):
    matrix, right = dense(patches(1)), np.random.default_rng(2).normal(size=(CUTS.count, 3))
    expected = np.linalg.solve(matrix.T if transposed else matrix, right)
    solved = factors(patches(1))
    assert solved.solve(right, transposed) == pytest.approx(expected, abs=1e-12)
    assert solved.solve(right[:, 0], transposed) == pytest.approx(expected[:, 0], abs=1e-12)


def test_rows_serve_several_matrices():
    right = np.ones(CUTS.count)
    once = factors(patches(3)).solve(right)
    factors(patches(4))
    assert np.array_equal(factors(patches(3)).solve(right), once)


def test_a_singular_block_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        factors(np.zeros((len(MEMBERS), 64, 64)))


def test_each_unknown_has_a_place_of_its_own_and_the_others_are_held():
    assert len(np.unique(ROWS.unknowns)) == CUTS.count
    assert ROWS.held.sum() == ROWS.count * ROWS.size - CUTS.count
    assert not ROWS.held.ravel()[ROWS.unknowns].any()


@pytest.fixture(scope="module")
def forces():
    """Two fields and three other parameters, and the dense matrix."""
    rng = np.random.default_rng(5)
    each = rng.normal(size=(2, len(MEMBERS), 64, 16))
    bands = np.zeros((2, ROWS.count, 7 * ROWS.size, GRID.around.count))
    total = np.zeros((2, CUTS.count, GRID.count))
    for field in range(2):
        for slab in range(SLABS):
            ROWS.add_field(bands[field], slab, each[field, slab * ARCS : (slab + 1) * ARCS])
        for unknowns, members, patch in zip(UNKNOWNS, MEMBERS, each[field], strict=True):
            free = unknowns >= 0
            np.add.at(total[field], (unknowns[free][:, np.newaxis], members), patch[free])
    others = rng.normal(size=(CUTS.count, 3))
    fields = np.ascontiguousarray(np.moveaxis(bands, 0, 2))
    return Forces(ROWS, fields, others), np.hstack([*total, others])


def test_forces_of_a_change_are_those_of_the_dense_matrix(forces):
    made, matrix = forces
    change = np.random.default_rng(6).normal(size=matrix.shape[1])
    assert made.of(change) == pytest.approx(matrix @ change, abs=1e-12)


def test_products_with_adjoints_are_those_of_the_dense_matrix(forces):
    made, matrix = forces
    adjoint = np.random.default_rng(7).normal(size=(CUTS.count, 4))
    assert made.transposed(adjoint) == pytest.approx(adjoint.T @ matrix, abs=1e-12)
