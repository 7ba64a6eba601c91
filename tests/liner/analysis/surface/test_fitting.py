"""From a field's points to its surface, with honest σ."""

import numpy as np
import pytest

from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.surface.fitting import choose_smoothing, fit_surface
from grabberd_liner.analysis.wall.strain import curvature_per_m as curvature_of
from grabberd_liner.analysis.wall.strain import outer_forms
from liner.analysis.collapsing import (
    SIGMA_1_BIT_MM,
    SIGMA_8_BIT_MM,
    as_points,
    by_differences,
    curvature_per_m,
    grid,
    outer,
    points,
)

PLACES = grid().u_mm, grid().v_mm


def kappa(jets):
    return curvature_of(outer_forms(jets, grid().outward))


def chi_squared(closed, sigma_mm, missing, fields=12):
    """(2,) mean squared error of κ1, κ2 in units of σ, over all targets and fields of one smoothing."""
    rng = np.random.default_rng(11)
    capture = [points(closed, sigma_mm, rng, missing) for _ in range(fields)]
    smoothing = choose_smoothing(grid(), capture)
    estimates = [fit_surface(grid(), one, smoothing).propagate(kappa, *PLACES, highest=2) for one in capture]
    ratio = [(one.value - curvature_per_m(closed)) / one.sigma for one in estimates]
    return (np.array(ratio) ** 2).mean(axis=(0, 1))


@pytest.mark.parametrize("missing", [0.0, 0.1], ids=["whole", "a tenth missing"])
@pytest.mark.parametrize("sigma_mm", [SIGMA_8_BIT_MM, SIGMA_1_BIT_MM], ids=["8 bit", "1 bit"])
@pytest.mark.parametrize("closed", [0.5, 1.0], ids=["half closed", "closed"])
def test_curvatures_of_the_collapsed_liner_err_as_much_as_their_sigma_says(closed, sigma_mm, missing):
    greater, lesser = chi_squared(closed, sigma_mm, missing)
    assert 0.6 < greater < 1.4
    assert 0.6 < lesser < 1.4
    assert 0.75 < (greater + lesser) / 2 < 1.2


@pytest.mark.parametrize("missing", [0.0, 0.1], ids=["whole", "a tenth missing"])
@pytest.mark.parametrize("sigma_mm", [SIGMA_8_BIT_MM, SIGMA_1_BIT_MM], ids=["8 bit", "1 bit"])
def test_of_the_open_liner_the_prior_is_right_and_sigma_small(sigma_mm, missing):
    rng = np.random.default_rng(11)
    capture = [points(0.0, sigma_mm, rng, missing) for _ in range(12)]
    smoothing = choose_smoothing(grid(), capture)
    estimates = [fit_surface(grid(), one, smoothing).propagate(kappa, *PLACES, highest=2) for one in capture]
    ratio = np.array([(one.value - curvature_per_m(0.0)) / one.sigma for one in estimates])[..., 0]
    assert 0.6 < (ratio**2).mean() < 1.4
    assert max(one.sigma.max() for one in estimates) < 0.7


def test_a_surface_is_fitted_where_a_quarter_is_missing_and_sigma_grows_there():
    few = fit_surface(grid(), points(1.0, SIGMA_8_BIT_MM, np.random.default_rng(1), 0.25))
    all_of_it = fit_surface(grid(), points(1.0, SIGMA_8_BIT_MM, np.random.default_rng(1)), few.smoothing)
    more = few.propagate(kappa, *PLACES).sigma / all_of_it.propagate(kappa, *PLACES).sigma
    assert more.mean() > 1.05
    assert more.max() > 1.3


def test_the_residuals_tell_whether_the_points_sigma_is_right():
    rng = np.random.default_rng(2)
    honest = points(0.5, SIGMA_8_BIT_MM, rng)
    smoothing = choose_smoothing(grid(), [honest])
    boasting = as_points(honest.target, points(0.5, SIGMA_1_BIT_MM, rng).xyz_mm, SIGMA_8_BIT_MM)
    assert fit_surface(grid(), honest, smoothing).misfit == pytest.approx(1.0, abs=0.25)
    assert fit_surface(grid(), boasting, smoothing).misfit > 2


def test_a_point_many_sigma_off_is_left_out_and_named():
    field = points(0.5, SIGMA_8_BIT_MM, np.random.default_rng(3))
    smoothing = choose_smoothing(grid(), [field])
    field.xyz_mm[40, 2] += 0.8
    surface = fit_surface(grid(), field, smoothing)
    assert surface.problems == ("left out, many σ from the prediction by the other points: targets 41",)
    assert surface.supported.all()


def test_ids_that_have_jumped_along_a_whole_row_are_refused():
    field = points(0.5, SIGMA_8_BIT_MM, np.random.default_rng(3))
    mixed = field.xyz_mm.copy()
    mixed[::2] = mixed[::-2]
    with pytest.raises(AnalysisError, match="contradict"):
        fit_surface(grid(), as_points(field.target, mixed, SIGMA_8_BIT_MM))


def test_too_few_points_are_refused():
    field = points(0.5, SIGMA_8_BIT_MM, np.random.default_rng(3))
    with pytest.raises(AnalysisError, match="too few"):
        fit_surface(grid(), field.select(grid().row < 2))
    with pytest.raises(AnalysisError, match="none of 1 fields"):
        choose_smoothing(grid(), [Points.none()])


def test_points_without_covariance_are_refused():
    field = points(0.5, SIGMA_8_BIT_MM, np.random.default_rng(3))
    with pytest.raises(AnalysisError, match="covariance"):
        fit_surface(grid(), as_points(field.target, field.xyz_mm, 0.0))


def test_the_surface_of_exact_points_goes_through_them():
    exact = outer(grid().row.astype(float), grid().column.astype(float), 1.0)
    surface = fit_surface(grid(), as_points(grid().target, exact, 1e-4))
    np.testing.assert_allclose(surface.jets(*PLACES)[:, 0], exact, atol=1e-3)


def test_derivatives_are_those_of_the_places():
    surface = fit_surface(grid(), points(1.0, SIGMA_8_BIT_MM, np.random.default_rng(3)))
    u_mm, v_mm = np.array([2.0, 50.3, 100.1]), np.array([3.0, 17.7, 34.9])
    np.testing.assert_allclose(
        surface.jets(u_mm, v_mm), by_differences(surface.jets, u_mm, v_mm), rtol=1e-5, atol=1e-6
    )
