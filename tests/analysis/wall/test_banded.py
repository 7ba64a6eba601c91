"""Sums of patches in a band: what one dense matrix would give."""

import numpy as np
import pytest

from grabberd.analysis.wall.banded import PATCH, Banded, BandLayout
from grabberd.analysis.wall.splines import GAUSS_ALONG, GAUSS_ROUND, SplineAxis, SplineGrid

GRID = SplineGrid(SplineAxis.over(0.0, 1.0, 2), SplineAxis.over(0.0, 1.0, 5))
MEMBERS = GRID.basis(*GRID.quadrature()[:2]).members[:: GAUSS_ROUND * GAUSS_ALONG]
VALUES = (MEMBERS[:, :, np.newaxis] * 4 + np.arange(4)).reshape(-1, PATCH)


def patches(seed: int):
    """Matrices without symmetry, like those of a wall under a load that turns with it."""
    noise = np.random.default_rng(seed).normal(size=(len(MEMBERS), PATCH, PATCH))
    return noise / PATCH + 10 * np.eye(PATCH)


def dense(unknowns, count: int, matrices):
    total = np.zeros((count, count))
    for members, matrix in zip(unknowns, matrices, strict=True):
        free = members >= 0
        np.add.at(total, np.ix_(members[free], members[free]), matrix[np.ix_(free, free)])
    return total


@pytest.fixture(scope="module")
def order():
    """Number of each control value's unknown: every ninth is held, and number 5 follows number 1."""
    held = np.arange(4 * GRID.count) % 9 == 4
    held[5] = True
    order = np.where(held, -1, np.cumsum(~held) - 1)
    order[5] = order[1]
    return order


@pytest.mark.parametrize("transposed", [False, True])
def test_solutions_are_those_of_the_dense_sum(order, transposed):
    count = order.max() + 1
    matrix = dense(order[VALUES], count, patches(1))
    right = np.random.default_rng(2).normal(size=(count, 3))
    factors = BandLayout.of(order[VALUES], count).factors(patches(1))
    expected = np.linalg.solve(matrix.T if transposed else matrix, right)
    assert factors.solve(right, transposed) == pytest.approx(expected, abs=1e-12)
    assert factors.solve(right[:, 0], transposed) == pytest.approx(expected[:, 0], abs=1e-12)


def test_a_layout_serves_several_matrices(order):
    layout = BandLayout.of(order[VALUES], order.max() + 1)
    right = np.ones(layout.count)
    once = layout.factors(patches(3)).solve(right)
    layout.factors(patches(4))
    assert np.array_equal(layout.factors(patches(3)).solve(right), once)


def test_the_band_is_no_wider_than_unknowns_of_one_patch_are_apart(order):
    layout = BandLayout.of(order[VALUES], order.max() + 1)
    spans = [np.ptp(members[members >= 0]) for members in order[VALUES]]
    assert layout.width == max(spans)


def test_a_singular_matrix_is_refused_with_the_unknown():
    band = np.zeros((4, 3))
    band[2] = [1.0, 0.0, 1.0]
    with pytest.raises(np.linalg.LinAlgError, match="singular at unknown 2"):
        Banded(np.asfortranarray(band), 1)
