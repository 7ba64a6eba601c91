from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from core.geometry.rigs import LENS, aimed, calibration, places, views
from grabberd.core.geometry import (
    PARAMETERS,
    Rig,
    View,
    correct_all,
    distortion,
    linearise,
    linearise_corrections,
    linearise_parameters,
    parameter_derivatives,
    project,
    project_all,
    rays,
    rotation_matrix,
)
from grabberd.core.geometry.functional_model import TOLERANCE_MM

STEPS = (
    *(1e-4, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3),
    *(1e-5, 1e-5, 1e-6, 1e-7, 1e-8, 1e-6, 1e-6, 1e-6, 1e-6),
)
STRAIGHT = View("left", 0, 720, 0.01, 0.005, 1, 8.0, 100.0, 200.0, 0.0, 0.0, 0.0, 0.0, 0.0, 240.0)


def object_derivatives(view, xyz):
    return linearise(Rig.of_views([view]), xyz)[1][:, 0].transpose(2, 0, 1)


def by_the_book(view, place):
    """Equations (4)–(7) for one point."""
    u, v, w = (
        np.diag([view.handedness, 1, 1])
        @ rotation_matrix(view.omega_rad, view.phi_rad, view.kappa_rad)
        @ (place - view.center_mm)
    )
    ideal = np.array([-view.f_mm * u / w, -view.f_mm * v / w])
    x, y = ideal + distortion(view.b, ideal[np.newaxis])[0]
    return view.x0_px + x / view.pixel_x_mm, view.y0_px - y / view.pixel_y_mm


@given(views(["distortion"]), places())
def test_it_is_equations_4_to_7(view, xyz):
    assert np.allclose(project(view, xyz), [by_the_book(view, place) for place in xyz], atol=1e-9)


def test_a_point_on_the_axis_falls_on_the_principal_point():
    assert np.array_equal(project(STRAIGHT, np.zeros((1, 3))), [[100.0, 200.0]])


def test_columns_grow_to_the_right_and_lines_downward():
    right, up = project(STRAIGHT, np.array([[3.0, 0.0, 0.0], [0.0, 3.0, 0.0]]))
    assert np.allclose(right, [100 + 8 * 3 / 240 / 0.01, 200])
    assert np.allclose(up, [100, 200 - 8 * 3 / 240 / 0.005])


def test_a_left_handed_view_is_mirrored_before_the_distortion():
    lens = (0.0, 0.002, *(0.0,) * 7)
    mirrored = project(replace(STRAIGHT, handedness=-1, b=lens), np.array([[3.0, 1.0, 0.0]]))
    seen = project(replace(STRAIGHT, b=lens), np.array([[-3.0, 1.0, 0.0]]))
    assert np.allclose(mirrored, seen)


@pytest.mark.parametrize("z_mm", [240.0, 241.0])
def test_what_is_not_in_front_of_the_camera_gives_nan_and_disturbs_no_other_point(z_mm):
    pixels = project(STRAIGHT, np.array([[1.0, 1.0, z_mm], [0.0, 0.0, 0.0]]))
    assert np.isnan(pixels[0]).all()
    assert np.array_equal(pixels[1], [100.0, 200.0])


def test_no_points_give_no_pixels():
    assert project(STRAIGHT, np.empty((0, 3))).shape == (0, 2)
    assert object_derivatives(STRAIGHT, np.empty((0, 3))).shape == (0, 2, 3)
    assert parameter_derivatives(STRAIGHT, np.empty((0, 3))).shape == (0, 2, 18)


@given(views(), places())
def test_derivatives_by_the_object_are_those_of_finite_differences(view, xyz):
    analytic = object_derivatives(view, xyz)
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = 1e-3
        numeric = (project(view, xyz + step) - project(view, xyz - step)) / 2e-3
        assert np.allclose(analytic[:, :, axis], numeric, rtol=1e-6, atol=1e-6)


@settings(max_examples=50)
@given(views(), places())
def test_derivatives_by_the_parameters_are_those_of_finite_differences(view, xyz):
    analytic = parameter_derivatives(view, xyz)
    values = view.vector()
    for index, (name, size) in enumerate(zip(PARAMETERS, STEPS, strict=True)):
        step = np.zeros(18)
        step[index] = size
        above, below = (project(view.with_vector(values + sign * step), xyz) for sign in (1, -1))
        numeric = (above - below) / (2 * size)
        scale = max(1.0, np.abs(numeric).max())
        assert np.allclose(analytic[:, :, index], numeric, atol=2e-6 * scale), name


def test_a_rig_computes_what_its_views_compute_alone():
    both = calibration().views
    xyz = np.random.default_rng(1).uniform(-20, 20, (50, 3))
    together = project_all(Rig.of_views(both), xyz)
    for index, view in enumerate(both):
        assert np.allclose(together[:, index].T, project(view, xyz), rtol=0, atol=1e-10)


def test_the_reference_rig_sees_the_origin_in_the_middle_of_both_halves_at_a_quarter_millimetre_a_pixel():
    for handedness in (1, -1):
        for name, middle in (("left", 179.5), ("right", 539.5)):
            view = aimed(name, handedness, (0.0,) * 9)
            assert np.allclose(project(view, np.zeros((1, 3))), [[middle, 287.5]], atol=1e-9)
            down = object_derivatives(view, np.zeros((1, 3)))[0, 1, 0]
            assert 3.5 < down < 4.1


FOLDED = replace(aimed("left"), b=(0.0, 0.0, -0.05, *(0.0,) * 6))


@given(views(), places())
def test_the_ray_of_a_projected_point_leads_back_to_it(view, xyz):
    center, directions = rays(view, project(view, xyz))
    reach = ((xyz - center) * directions).sum(axis=1)
    assert (reach > 0).all()
    assert np.abs(center + reach[:, np.newaxis] * directions - xyz).max() < 1e-9


@given(views(), places())
def test_the_picture_of_a_point_on_the_ray_is_where_the_ray_came_from(view, xyz):
    pixels = project(view, xyz)
    center, directions = rays(view, pixels)
    assert np.abs(project(view, center + 200.0 * directions) - pixels).max() < 1e-9


def correct(view, xy_px):
    return correct_all(Rig.of_views([view]), xy_px.T[:, np.newaxis])[:, 0].T


@given(views(["distortion"]), places())
def test_distortion_added_to_the_corrected_point_gives_the_observed_one(view, xyz):
    pixels = project(view, xyz)
    ideal = correct(view, pixels)
    x, y = (ideal + distortion(view.b, ideal)).T
    observed = np.column_stack([view.x0_px + x / view.pixel_x_mm, view.y0_px - y / view.pixel_y_mm])
    assert np.abs(observed - pixels).max() * view.pixel_x_mm < TOLERANCE_MM


@given(views(["correction"]), places())
def test_a_correction_added_to_the_observed_point_gives_that_of_a_view_without_distortion(view, xyz):
    observed = (project(view, xyz) - [view.x0_px, view.y0_px]) * [view.pixel_x_mm, -view.pixel_y_mm]
    straight = project(replace(view, b=(0.0,) * 9), xyz) - [view.x0_px, view.y0_px]
    ideal = straight * [view.pixel_x_mm, -view.pixel_y_mm]
    assert np.abs(observed + distortion(view.b, observed) - ideal).max() < 1e-9


def test_both_meanings_of_a_small_term_differ_by_the_sign_and_by_what_is_of_second_order():
    added, corrected = (
        aimed("left"),
        replace(aimed("left", b=tuple(-np.array(LENS))), polynomial="correction"),
    )
    xyz = np.array([[10.0, 5.0, 0.0], [-30.0, 20.0, 8.0]])
    assert 0.001 < np.abs(project(added, xyz) - project(corrected, xyz)).max() < 0.1


def test_views_of_both_meanings_stand_in_one_rig():
    both = aimed("left"), replace(aimed("right"), polynomial="correction")
    xyz = np.random.default_rng(1).uniform(-20, 20, (50, 3))
    together, slopes = linearise_parameters(Rig.of_views(both), xyz)
    for index, view in enumerate(both):
        assert np.allclose(together[:, index].T, project(view, xyz), rtol=0, atol=1e-10)
        alone = parameter_derivatives(view, xyz).transpose(1, 2, 0)
        assert np.allclose(slopes[:, index], alone, rtol=1e-9, atol=1e-9)
    back = correct_all(Rig.of_views(both), together)
    assert np.allclose(back, together_ideal(both, xyz), rtol=0, atol=1e-9)


def together_ideal(views, xyz):
    plain = Rig.of_views([replace(view, b=(0.0,) * 9) for view in views])
    return (project_all(plain, xyz) - plain.origin_px) * plain.pixel_mm


@settings(max_examples=50)
@given(views(["correction"]), places())
def test_derivatives_among_corrected_points_are_those_of_finite_differences(view, xyz):
    observed = project(view, xyz + 0.3).T[:, np.newaxis]
    excess, analytic = linearise_corrections(Rig.of_views([view]), xyz, observed)
    ideal = together_ideal([view], xyz)
    away = (ideal - correct_all(Rig.of_views([view]), observed)) / Rig.of_views([view]).pixel_mm
    assert np.allclose(excess, away, rtol=0, atol=1e-6)
    for index, (name, size) in enumerate(zip(PARAMETERS, STEPS, strict=True)):
        step = np.zeros(18)
        step[index] = size
        above, below = (
            linearise_corrections(
                Rig.of_views([view.with_vector(view.vector() + sign * step)]), xyz, observed
            )[0]
            for sign in (1, -1)
        )
        numeric = (above - below) / (2 * size)
        scale = max(1.0, np.abs(numeric).max())
        assert np.allclose(analytic[:, :, index], numeric, atol=2e-6 * scale), name


def test_what_lies_beyond_the_fold_of_the_correction_is_nan():
    view = replace(FOLDED, polynomial="correction")
    fold_mm = 1 / np.sqrt(3 * 0.05)
    beyond = view.x0_px - 1.05 * fold_mm / view.pixel_x_mm
    ideal = correct(view, np.array([[beyond, view.y0_px], [view.x0_px - 20, view.y0_px]]))
    assert np.isnan(ideal[0]).all()
    assert np.isfinite(ideal[1]).all()


def test_one_step_would_not_be_enough():
    view = aimed("left")
    pixels = np.array([[40.0, 30.0]])
    observed = (pixels - [view.x0_px, view.y0_px]) * [view.pixel_x_mm, -view.pixel_y_mm]
    one_step = observed - distortion(view.b, observed)
    assert np.abs(correct(view, pixels) - one_step).max() > 1e-4


def test_directions_have_unit_length_and_the_center_is_the_views():
    center, directions = rays(aimed("right"), np.array([[400.0, 20.0], [700.0, 500.0]]))
    assert np.array_equal(center, aimed("right").center_mm)
    assert np.allclose((directions**2).sum(axis=1), 1.0, atol=1e-14)


def test_what_lies_beyond_the_fold_of_the_distortion_is_nan_and_disturbs_no_other_point():
    fold_mm = 1 / np.sqrt(3 * 0.05)
    beyond = FOLDED.x0_px - 1.05 * fold_mm * (1 - 0.05 * fold_mm**2) / FOLDED.pixel_x_mm
    ideal = correct(FOLDED, np.array([[beyond, FOLDED.y0_px], [FOLDED.x0_px - 20, FOLDED.y0_px]]))
    assert np.isnan(ideal[0]).all()
    assert np.isfinite(ideal[1]).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_no_place_has_no_ray(bad):
    _, directions = rays(aimed("left"), np.array([[bad, 100.0], [200.0, 100.0]]))
    assert np.isnan(directions[0]).all()
    assert np.isfinite(directions[1]).all()


def test_no_points_give_no_rays():
    assert rays(aimed("left"), np.empty((0, 2)))[1].shape == (0, 3)
