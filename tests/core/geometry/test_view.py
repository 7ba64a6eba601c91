import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.geometry.rigs import LENS, LIMITS, aimed, views
from grabberd.core.geometry import (
    PARAMETERS,
    distortion,
    rotation_angles,
    rotation_derivatives,
    rotation_matrix,
)
from grabberd.core.geometry.view import basis, monomials, polynomials


@given(views())
def test_the_vector_of_a_view_gives_the_view_again(view):
    assert view.with_vector(view.vector()) == view


def test_the_vector_is_in_the_order_of_the_parameters():
    view = aimed("left")
    assert len(PARAMETERS) == 18
    assert [view.f_mm, view.Z0_mm, view.b[8]] == [
        view.vector()[PARAMETERS.index(n)] for n in ("f_mm", "Z0_mm", "b9")
    ]


def test_a_view_holds_the_pixels_of_its_half():
    edges = np.array([[-0.5, 0.0], [359.4, 575.0], [359.5, 0.0], [-0.6, 0.0]])
    assert aimed("left").holds(edges).tolist() == [True, True, False, False]
    assert aimed("right").holds(edges).tolist() == [False, False, True, False]


angles = st.floats(-3.0, 3.0)
tilts = st.floats(-1.5, 1.5)


@given(angles, tilts, angles)
def test_a_rotation_is_orthogonal_and_right_handed(omega, phi, kappa):
    rotation = rotation_matrix(omega, phi, kappa)
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert math.isclose(np.linalg.det(rotation), 1.0, abs_tol=1e-13)


@pytest.mark.parametrize(
    ("angle", "camera_sees"),
    [((0.1, 0, 0), (0, math.cos(0.1), -math.sin(0.1))), ((0, 0, 0.1), (math.sin(0.1), math.cos(0.1), 0))],
    ids=["omega", "kappa"],
)
def test_the_y_axis_in_a_camera_whose_axes_are_turned_counterclockwise(angle, camera_sees):
    assert np.allclose(rotation_matrix(*angle) @ [0, 1, 0], camera_sees, atol=1e-15)


def test_the_x_axis_in_a_camera_turned_by_phi():
    assert np.allclose(rotation_matrix(0, 0.1, 0) @ [1, 0, 0], [math.cos(0.1), 0, math.sin(0.1)], atol=1e-15)


def test_omega_is_applied_first_and_kappa_last():
    expected = rotation_matrix(0, 0, 0.3) @ rotation_matrix(0, 0.2, 0) @ rotation_matrix(0.1, 0, 0)
    assert np.array_equal(rotation_matrix(0.1, 0.2, 0.3), expected)


@given(angles, tilts, angles)
def test_the_angles_of_a_matrix_give_the_matrix_again(omega, phi, kappa):
    rotation = rotation_matrix(omega, phi, kappa)
    assert np.allclose(rotation_matrix(*rotation_angles(rotation)), rotation, atol=1e-12)


@pytest.mark.parametrize("phi", [math.pi / 2, -math.pi / 2])
def test_at_the_pole_kappa_is_zero_and_the_matrix_is_still_met(phi):
    rotation = rotation_matrix(0.4, phi, 0.3)
    found = rotation_angles(rotation)
    assert found[2] == 0.0
    assert np.allclose(rotation_matrix(*found), rotation, atol=1e-9)


@given(angles, tilts, angles)
def test_derivatives_are_those_of_finite_differences(omega, phi, kappa):
    derivatives = rotation_derivatives(omega, phi, kappa)
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = 1e-5
        above = rotation_matrix(*(np.array([omega, phi, kappa]) + step))
        below = rotation_matrix(*(np.array([omega, phi, kappa]) - step))
        assert np.allclose(derivatives[axis], (above - below) / 2e-5, atol=1e-9)


coordinates = st.tuples(st.floats(-3, 3), st.floats(-2.4, 2.4))
lenses = st.lists(st.floats(-1, 1), min_size=9, max_size=9).map(lambda shares: np.array(shares) * LIMITS)


def by_the_book(b, x, y):
    """Equations (6) and (7), term by term."""
    b1, b2, b3, b4, b5, b6, b7, b8, b9 = b
    r2 = x * x + y * y
    radial = b3 * r2 + b4 * r2**2 + b5 * r2**3
    dx = -b1 * x + b2 * y + x * radial + b6 * (r2 + 2 * x * x) + 2 * b7 * x * y - b8 * x * y * y
    dy = +b1 * y + b2 * x + y * radial + 2 * b6 * x * y + b7 * (r2 + 2 * y * y) - b9 * x * x * y
    return dx, dy


@given(lenses, coordinates)
def test_it_is_the_sum_of_the_terms_of_equations_6_and_7(b, place):
    assert np.allclose(distortion(b, np.array([place])), by_the_book(b, *place), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("index", range(9))
def test_every_coefficient_has_its_own_term(index):
    b = np.zeros(9)
    b[index] = 1e-3
    assert np.allclose(distortion(b, np.array([[1.7, -1.1]])), by_the_book(b, 1.7, -1.1), rtol=1e-13)


def test_an_affinity_widens_one_axis_as_it_narrows_the_other():
    (dx, dy) = distortion([0.01, *(0.0,) * 8], np.array([[2.0, 2.0]]))[0]
    assert dx == -dy == -0.02


def test_nothing_is_added_at_the_principal_point():
    assert not distortion(LENS, np.zeros((1, 2))).any()


@given(lenses, coordinates)
def test_slopes_are_those_of_finite_differences(b, place):
    at = np.array([place])
    _, _, own, other = polynomials(b) @ monomials(at.T[:, np.newaxis])[0, :, 0]
    for axis, slopes in enumerate([(own[0], other[1]), (other[0], own[1])]):
        step = np.eye(2)[axis] * 1e-5
        numeric = (distortion(b, at + step) - distortion(b, at - step))[0] / 2e-5
        assert np.allclose(slopes, numeric, atol=1e-9)


@given(lenses, coordinates)
def test_distortion_is_linear_in_its_coefficients(b, place):
    at = np.array([place])
    linear = np.array(b) @ basis(at.T[:, np.newaxis])[:, 0]
    assert np.allclose(linear[:, 0], distortion(b, at)[0], rtol=1e-12, atol=1e-15)
