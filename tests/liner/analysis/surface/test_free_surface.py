"""Surfaces through points without ids."""

import numpy as np
import pytest

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.surface.free_surface import Height, Tube, fit_free_surface, free_shape
from grabberd_liner.analysis.surface.sections import Plane, sections, surface_area
from grabberd_liner.analysis.wall.strain import curvature_per_m, outer_forms
from liner.analysis.collapsing import AXIS_Z_MM, SIGMA_8_BIT_MM, by_differences, grid, middle
from liner.analysis.test_grid import of

TUBE = Tube(0.0, AXIS_Z_MM, 12.5)
NOISE_MM2 = np.diag(SIGMA_8_BIT_MM**2)


def kappa(jets):
    return curvature_per_m(outer_forms(jets))


def speckle(closed, count=150, seed=0):
    """Random places of the middle surface, with noise."""
    rng = np.random.default_rng(seed)
    exact = middle(rng.uniform(0, 17, count), rng.uniform(0, 5, count), closed)
    return exact + rng.normal(size=exact.shape) * SIGMA_8_BIT_MM, np.tile(NOISE_MM2, (count, 1, 1))


def dome(count=200, seed=0, radius=40.0):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-15, 15, (2, count))
    exact = np.stack([x, y, np.sqrt(radius**2 - x**2 - y**2)], axis=1)
    return exact + rng.normal(size=exact.shape) * SIGMA_8_BIT_MM, np.tile(NOISE_MM2, (count, 1, 1))


def test_a_tubes_radius_and_curvature_are_found_without_ids():
    surface = fit_free_surface(*speckle(0.0), TUBE)
    u_mm, v_mm = np.array([-20.0, 0.0, 25.0]), np.array([-8.0, 0.0, 6.0])
    estimate = surface.propagate(kappa, u_mm, v_mm, highest=2)
    assert (np.abs(estimate.value - [80.0, 0.0]) < 4 * estimate.sigma + 0.05).all()
    assert estimate.sigma.max() < 4


def test_a_collapsed_tubes_width_is_found_without_ids():
    surface = fit_free_surface(*speckle(1.0), TUBE)
    plane = Plane(np.array([0.0, 0.0, AXIS_Z_MM]), np.array([0.0, 0.0, 1.0]))
    (middle,), _ = sections(surface, [0.0], plane)
    distance = middle.distance_mm
    assert float(distance.value) == pytest.approx(7.5, abs=max(0.05, 4 * float(distance.sigma)))


def test_a_domes_curvatures_and_their_sigma_are_honest():
    surface = fit_free_surface(*dome(), Height(40.0))
    u_mm, v_mm = (part.ravel() for part in np.meshgrid(np.linspace(-12, 12, 7), np.linspace(-12, 12, 7)))
    estimate = surface.propagate(kappa, u_mm, v_mm, highest=2)
    ratio = (estimate.value - 25.0) / estimate.sigma
    assert 0.1 < (ratio**2).mean() < 2.0


def test_derivatives_are_those_of_the_places():
    surface = fit_free_surface(*speckle(1.0), TUBE)
    u_mm, v_mm = np.array([-20.0, 0.0, 25.0]), np.array([-8.0, 0.3, 6.0])
    np.testing.assert_allclose(
        surface.jets(u_mm, v_mm), by_differences(surface.jets, u_mm, v_mm), rtol=1e-5, atol=1e-6
    )


def test_normals_point_away_from_the_axis_and_up_from_the_plane():
    surface = fit_free_surface(*speckle(0.0), TUBE)
    normal = outer_forms(surface.jets(np.zeros(1), np.zeros(1)), surface.outward).normal
    assert normal[0, 2] > 0.9


def test_a_point_far_off_is_left_out_and_told():
    xyz, covariance = speckle(0.5)
    xyz[7, 2] += 4.0
    assert fit_free_surface(xyz, covariance, TUBE).problems == (
        "left out, many σ from the prediction by the other points: points number 7",
    )


def test_a_hole_is_not_within():
    xyz, covariance = speckle(0.0, 400)
    seen = np.abs(xyz[:, 0]) > 12
    surface = fit_free_surface(xyz[seen], covariance[seen], TUBE)
    assert not surface.within(np.zeros(1), np.zeros(1))[0]
    assert surface.within(np.array([30.0]), np.zeros(1))[0]
    assert surface_area(surface).covered < 0.9


def test_too_few_points_are_refused():
    xyz, covariance = speckle(0.0, 10)
    with pytest.raises(AnalysisError, match="too few"):
        fit_free_surface(xyz, covariance, TUBE)


def test_the_grid_says_what_the_surface_is_a_function_over():
    tube = free_shape(grid())
    assert isinstance(tube, Tube)
    assert tube == pytest.approx((0.0, AXIS_Z_MM, 13.75), abs=0.01)
    assert isinstance(free_shape(of(5, 5)), Height)
