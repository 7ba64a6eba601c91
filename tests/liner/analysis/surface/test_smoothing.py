"""How smooth the surface is taken to be."""

import numpy as np
import pytest

from grabberd_liner.analysis.surface.fitting import choose_smoothing
from grabberd_liner.analysis.surface.smoothing import matern
from liner.analysis.collapsing import SIGMA_8_BIT_MM, grid, points


def capture(closed, sigma_mm=SIGMA_8_BIT_MM, fields=4):
    rng = np.random.default_rng(4)
    return [points(closed, sigma_mm, rng) for _ in range(fields)]


def test_an_open_liner_departs_from_the_nominal_shape_by_nothing_that_shows():
    assert max(choose_smoothing(grid(), capture(0.0)).amplitude_mm) == pytest.approx(1e-3)


def test_the_farther_it_closes_the_greater_the_amplitude():
    amplitudes = [choose_smoothing(grid(), capture(closed)).amplitude_mm for closed in (0.1, 0.3, 1.0)]
    assert np.all(np.diff(amplitudes, axis=0)[:, 1:] > 0)


def test_materns_correlation_is_one_at_no_distance_and_the_known_one_for_three_halves():
    distance = np.linspace(0, 3, 7)
    known = (1 + np.sqrt(3) * distance) * np.exp(-np.sqrt(3) * distance)
    np.testing.assert_allclose(matern(distance, 1), known)
    assert matern(np.zeros(1), 6) == pytest.approx(1.0)
