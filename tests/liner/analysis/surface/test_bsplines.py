"""Quintic splines."""

import numpy as np
from scipy.interpolate import BSpline

from grabberd_liner.analysis.surface.smoothing import splines


def test_splines_and_their_derivatives_are_those_of_scipy():
    place = np.linspace(0.01, 6.99, 40)
    knots = np.arange(-5, 13.0)
    for derivative in range(5):
        theirs = np.stack(
            [BSpline(knots, row, 5).derivative(derivative)(place) for row in np.eye(12)], axis=1
        )
        np.testing.assert_allclose(splines(place, 7)[:, derivative], theirs, atol=1e-12)


def test_they_sum_to_one_everywhere_even_a_little_outside():
    np.testing.assert_allclose(splines(np.linspace(-0.4, 7.4, 50), 7)[:, 0].sum(axis=1), 1.0)
