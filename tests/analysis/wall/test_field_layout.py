"""What fields do to the unknowns: what one dense matrix would say."""

import numpy as np
import pytest

from grabberd.analysis.wall.field_layout import FieldLayout
from grabberd.analysis.wall.splines import GAUSS_ALONG, GAUSS_ROUND, SplineAxis, SplineGrid

GRID = SplineGrid(SplineAxis.over(0.0, 1.0, 2), SplineAxis.over(0.0, 1.0, 5))
MEMBERS = GRID.basis(*GRID.quadrature()[:2]).members[:: GAUSS_ROUND * GAUSS_ALONG]


@pytest.fixture(scope="module")
def order():
    """Number of each control value's unknown: every ninth is held, and number 5 follows number 1."""
    held = np.arange(4 * GRID.count) % 9 == 4
    held[5] = True
    order = np.where(held, -1, np.cumsum(~held) - 1)
    order[5] = order[1]
    return order.reshape(GRID.count, 4)


def dense(order, patches):
    total = np.zeros((order.max() + 1, GRID.count))
    for members, patch in zip(MEMBERS, patches, strict=True):
        unknowns = order[members]
        free = unknowns >= 0
        np.add.at(total, (unknowns[free][:, np.newaxis], members), patch[free])
    return total


def test_two_fields_stand_side_by_side_and_each_is_the_dense_sum(order):
    patches = np.random.default_rng(1).normal(size=(2, len(MEMBERS), 16, 4, 16))
    layout = FieldLayout.of(MEMBERS, order[MEMBERS], GRID.count)
    matrix = layout.matrix([layout.sums(each) for each in patches])
    assert matrix.toarray() == pytest.approx(np.hstack([dense(order, each) for each in patches]))
