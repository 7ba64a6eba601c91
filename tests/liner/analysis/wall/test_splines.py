"""Splines on the wall: exact for cubics, smooth across knots, with quadrature exact to degree five."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyval2d

from grabberd_liner.analysis.wall.splines import DERIVATIVES, SplineAxis, SplineGrid

AROUND, ALONG = SplineAxis.over(-3.0, 3.0, 4), SplineAxis.over(0.0, 5.0, 3)
GRID = SplineGrid(AROUND, ALONG)
S, X, WEIGHTS = GRID.quadrature()
ELSEWHERE = np.random.default_rng(1).uniform([-3.0, 0.0], [3.0, 5.0], (40, 2)).T
COEFFICIENTS = st.lists(st.floats(-1.0, 1.0), min_size=16, max_size=16)


def derived(coefficients, around: int, along: int, s, x):
    """A polynomial of s and x, differentiated by numpy."""
    by_s = np.polynomial.polynomial.polyder(coefficients, around, axis=0)
    return polyval2d(s, x, np.polynomial.polynomial.polyder(by_s, along, axis=1))


@settings(max_examples=20, deadline=None)
@given(COEFFICIENTS)
def test_a_cubic_and_its_derivatives_are_reproduced(values):
    coefficients = np.reshape(values, (4, 4))
    dense = GRID.basis(S, X).matrices[0].toarray()
    control = np.linalg.lstsq(dense, polyval2d(S, X, coefficients), rcond=None)[0]
    for derivative, (around, along) in enumerate(DERIVATIVES):
        expected = derived(coefficients, around, along, *ELSEWHERE)
        assert GRID.basis(*ELSEWHERE).of(control, derivative) == pytest.approx(expected, abs=1e-8)


def test_control_points_that_are_alike_give_a_constant():
    basis = GRID.basis(*ELSEWHERE)
    control = np.full(GRID.count, 7.0)
    assert basis.of(control) == pytest.approx(np.full(40, 7.0))
    for derivative in range(1, len(DERIVATIVES)):
        assert basis.of(control, derivative) == pytest.approx(np.zeros(40), abs=1e-12)


def test_positions_of_the_control_points_give_the_position_itself():
    control = np.broadcast_to(AROUND.greville, (ALONG.count, AROUND.count)).ravel()
    assert GRID.basis(*ELSEWHERE).of(control) == pytest.approx(ELSEWHERE[0])


def test_the_corners_are_the_first_and_last_control_points():
    control = np.random.default_rng(2).normal(size=(ALONG.count, AROUND.count))
    corners = GRID.basis(np.array([-3.0, 3.0, -3.0, 3.0]), np.array([0.0, 0.0, 5.0, 5.0]))
    assert corners.of(control.ravel()) == pytest.approx(control[[0, 0, -1, -1], [0, -1, 0, -1]])


@pytest.mark.parametrize("derivative", range(len(DERIVATIVES)))
def test_nothing_jumps_at_a_knot(derivative):
    control = np.random.default_rng(3).normal(size=GRID.count)
    knots, step = np.array([-1.5, 0.0, 1.5]), 1e-9
    before, after = (GRID.basis(knots + side, np.full(3, 5 / 3 + side)) for side in (-step, step))
    assert before.of(control, derivative) == pytest.approx(after.of(control, derivative), abs=1e-6)


def test_fields_may_have_components():
    control = np.random.default_rng(4).normal(size=(GRID.count, 3))
    basis = GRID.basis(*ELSEWHERE)
    columns = [basis.of(control[:, axis], 5) for axis in range(3)]
    assert basis.of(control, 5) == pytest.approx(np.stack(columns, axis=1))


@pytest.mark.parametrize("derivative", range(len(DERIVATIVES)))
def test_the_matrix_says_what_the_basis_says(derivative):
    control = np.random.default_rng(5).normal(size=GRID.count)
    basis = GRID.basis(*ELSEWHERE)
    by_hand = (basis.values[derivative] * control[basis.members]).sum(axis=1)
    assert basis.of(control, derivative) == pytest.approx(by_hand)


@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4),
    st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6),
)
def test_quadrature_is_exact_to_degree_three_round_and_five_along(around, along):
    one, other = Polynomial(around), Polynomial(along)
    exact = (one.integ()(3.0) - one.integ()(-3.0)) * (other.integ()(5.0) - other.integ()(0.0))
    assert WEIGHTS @ (one(S) * other(X)) == pytest.approx(exact, abs=1e-9)


def test_the_six_points_of_a_patch_stand_together():
    patches = GRID.basis(S, X).members.reshape(4 * 3, 6, 16)
    assert np.all(patches == patches[:, :1])
    assert len(np.unique(patches[:, 0], axis=0)) == 12
