"""What a surface does at one place."""

import numpy as np

from grabberd_liner.analysis.surface.jets import ORDERS, index, times
from grabberd_liner.analysis.wall.strain import curvature_per_m, outer_forms


def test_the_orders_are_sorted_by_total_order_and_then_by_v():
    assert ORDERS[:6] == ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    assert len(ORDERS) == 15
    assert all(index(i, j) == place for place, (i, j) in enumerate(ORDERS))


def test_a_scalar_times_a_vector_has_the_derivatives_of_the_product():
    u, v = 0.3, -0.7
    scalar = np.array([np.exp(u) * 2.0**j * np.exp(2 * v) for i, j in ORDERS])
    vector = np.array([3.0**i * np.exp(3 * u) * np.exp(-v) * (-1.0) ** j * np.ones(3) for i, j in ORDERS])
    both = np.array([4.0**i * np.exp(4 * u) * np.exp(v) * np.ones(3) for i, j in ORDERS])
    np.testing.assert_allclose(np.einsum("pqa,q->pa", times(vector), scalar), both, rtol=1e-12)


def test_a_saddles_curvatures_are_exact_to_a_millionth():
    jet = np.zeros((1, 15, 3))
    jet[0, index(1, 0)], jet[0, index(0, 1)] = [1, 0, 0], [0, 1, 0]
    jet[0, index(2, 0), 2], jet[0, index(0, 2), 2] = 1 / 20, -1 / 50
    kappa = curvature_per_m(outer_forms(jet))
    np.testing.assert_allclose(kappa[0], [20.0, -50.0], atol=1e-6)
