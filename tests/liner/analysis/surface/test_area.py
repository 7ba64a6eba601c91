"""The area that the targets cover."""

import numpy as np
import pytest

from grabberd_liner.analysis.surface.fitting import choose_smoothing, fit_surface
from grabberd_liner.analysis.surface.sections import surface_area
from liner.analysis.collapsing import PITCH_MM, SIGMA_8_BIT_MM, as_points, grid, points


def test_an_open_liners_area_is_length_times_arc():
    found = surface_area(fit_surface(grid(), as_points(grid().target, grid().nominal_mm, 0.001)))
    assert float(found.area_mm2.value) == pytest.approx(17 * PITCH_MM * 5 * PITCH_MM * 1.1, rel=1e-5)
    assert found.covered == pytest.approx(1.0)


def test_a_hole_is_not_counted():
    hole = np.isin(grid().row, (8, 9)) & np.isin(grid().column, (2, 3))
    field = as_points(grid().target[~hole], grid().nominal_mm[~hole], 0.001)
    found = surface_area(fit_surface(grid(), field))
    assert found.covered == pytest.approx(1 - 4 / (17 * 5))


def test_its_sigma_is_by_how_much_it_errs():
    rng = np.random.default_rng(3)
    capture = [points(0.5, SIGMA_8_BIT_MM, rng) for _ in range(12)]
    smoothing = choose_smoothing(grid(), capture)
    areas = [surface_area(fit_surface(grid(), one, smoothing)).area_mm2 for one in capture]
    spread = np.std([float(one.value) for one in areas])
    assert 0.4 < spread / np.mean([one.sigma for one in areas]) < 1.3
