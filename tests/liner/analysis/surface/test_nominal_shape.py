"""The smooth shape behind the nominal places."""

import numpy as np
import pytest

from grabberd.core.reconstruction import ObjectModel
from grabberd_liner.analysis.grid import Grid, NominalShape
from grabberd_liner.analysis.surface.fitting import fit_surface
from grabberd_liner.analysis.wall.strain import curvature_per_m, outer_forms
from liner.analysis.collapsing import as_points, by_differences, grid, model
from liner.analysis.test_grid import of

PLACES = np.array([3.0, 40.0, 90.0]), np.array([0.0, 11.0, 33.0])


def test_an_open_liner_is_a_cylinder_of_its_outer_radius():
    shape = NominalShape.of(grid())
    assert shape.radius_mm == pytest.approx(13.75, abs=1e-9)
    np.testing.assert_allclose(shape.jets(grid().u_mm, grid().v_mm)[:, 0], grid().nominal_mm, atol=1e-9)


def test_its_curvature_is_exact_to_a_millionth():
    kappa = curvature_per_m(outer_forms(NominalShape.of(grid()).jets(*PLACES), grid().outward))
    np.testing.assert_allclose(kappa, np.tile([1e3 / 13.75, 0.0], (3, 1)), atol=1e-6)


@pytest.mark.parametrize("turn", [np.eye(3), np.diag([-1.0, -1, 1]), np.linalg.qr(np.vander([1.0, 2, 4]))[0]])
def test_it_is_found_wherever_the_liner_lies(turn):
    moved = ObjectModel("x", grid().target, model().xyz_mm @ turn.T + 5, grid().row, grid().column, 1.5, 0.0)
    turned = Grid.of(moved)
    np.testing.assert_allclose(
        NominalShape.of(turned).jets(turned.u_mm, turned.v_mm)[:, 0], turned.nominal_mm, atol=1e-9
    )


def test_targets_all_round_a_tube_are_a_cylinder_too():
    whole = of(5, 12, lambda r, c: (6 * r, 10 * np.sin(c * np.pi / 6), 10 * np.cos(c * np.pi / 6)))
    assert NominalShape.of(whole).radius_mm == pytest.approx(10.0)


def test_derivatives_are_those_of_the_places():
    shape = NominalShape.of(grid())
    np.testing.assert_allclose(shape.jets(*PLACES), by_differences(shape.jets, *PLACES), atol=1e-7)


def test_a_plane_has_no_such_shape_and_needs_none():
    sheet = of(6, 5, lambda r, c: (6.5 * r, 6.5 * c, 0.1 * r - 0.3 * c))
    assert NominalShape.of(sheet).radius_mm == 0.0
    surface = fit_surface(sheet, as_points(sheet.target, sheet.nominal_mm, 0.02))
    np.testing.assert_allclose(surface.jets(sheet.u_mm, sheet.v_mm)[:, 0], sheet.nominal_mm, atol=1e-5)
