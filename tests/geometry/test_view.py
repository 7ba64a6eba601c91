import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry.rigs import aimed, views
from grabberd.geometry import PARAMETERS, rotation_angles, rotation_derivatives, rotation_matrix


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
