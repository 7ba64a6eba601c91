"""Ellipses of one constant perimeter."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from grabberd_fake import liner as ellipse

flattening = st.floats(0.3, 1.0)


def test_the_perimeter_of_a_circle_and_of_a_known_ellipse() -> None:
    found = ellipse.perimeter(np.array([1.0, 2.0]), np.array([1.0, 1.0]))
    assert_allclose(found, [2 * math.pi, 9.688448220547675], rtol=1e-12)


@given(flattening)
def test_a_flattened_circle_keeps_its_perimeter(p: float) -> None:
    q = ellipse.widened(np.array([p]))
    assert q[0] >= 1.0 - 1e-12
    assert_allclose(ellipse.perimeter(np.array([p]), q), 2 * math.pi, rtol=1e-12)


@given(flattening, st.floats(-1.5, 1.5))
def test_the_eccentric_angle_lies_at_its_arc_length(p: float, arc: float) -> None:
    q = ellipse.widened(np.array([p]))
    theta = ellipse.eccentric_angle(np.array([p]), q, np.array([arc]))[0]
    way = np.linspace(0, theta, 20001)
    chords = np.hypot(np.diff(q[0] * np.sin(way)), np.diff(p * np.cos(way)))
    assert_allclose(chords.sum(), abs(arc), atol=1e-8)
    assert math.copysign(1, theta) == math.copysign(1, arc) or abs(arc) < 1e-9


def test_on_a_circle_the_angle_is_the_arc() -> None:
    one = np.ones(3)
    assert_allclose(
        ellipse.eccentric_angle(one, one, np.array([-1.0, 0.0, 2.5])), [-1.0, 0.0, 2.5], atol=1e-12
    )
