import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry.rigs import LENS, LIMITS
from grabberd.geometry import distortion
from grabberd.geometry.distortion import basis, monomials, polynomials

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
