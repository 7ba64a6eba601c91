"""Differential geometry on a doubly periodic grid, against surfaces known in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from grabberd_fake.ellipse_truth import Sheet, determinant, inverse


def angles(count):
    return np.arange(count) * (2 * np.pi / count)


def torus(ring_mm, tube_mm, grid=(48, 64)):
    """Coordinates: arc length round the tube, and along the ring's middle line."""
    u, v = np.meshgrid(angles(grid[0]), angles(grid[1]), indexing="ij")
    away = ring_mm + tube_mm * np.cos(u)
    places = np.stack([away * np.cos(v), away * np.sin(v), tube_mm * np.sin(u)], axis=-1)
    return u, Sheet(places, np.zeros((2, 3)), (2 * np.pi * tube_mm, 2 * np.pi * ring_mm))


def bellows(radius_mm, wave_mm, length_mm, grid=(64, 32)):
    """A tube of radius r(x) = radius + wave cos(2πx/length); the second coordinate is an angle times 1 mm."""
    x, v = np.meshgrid(angles(grid[0]), angles(grid[1]), indexing="ij")
    r = radius_mm + wave_mm * np.cos(x)
    places = np.stack([0 * x, r * np.sin(v), r * np.cos(v)], axis=-1)
    return r, Sheet(places, np.array([[1.0, 0, 0], [0, 0, 0]]), (length_mm, 2 * np.pi))


def test_a_torus_has_its_metric_and_both_curvatures() -> None:
    u, sheet = torus(20.0, 6.0)
    away = 20 + 6 * np.cos(u)
    assert_allclose(sheet.metric[0, 0], 1, atol=1e-12)
    assert_allclose(sheet.metric[1, 1], (away / 20) ** 2, atol=1e-12)
    mixed = np.einsum("acnm,cbnm->abnm", sheet.raised, sheet.bending)
    inward = np.sign(mixed[0, 0, 0, 0])
    assert_allclose(inward * mixed[0, 0], 1 / 6, atol=1e-11)
    assert_allclose(inward * mixed[1, 1], np.cos(u) / away, atol=1e-11)
    assert_allclose(mixed[0, 1], 0, atol=1e-11)


def test_the_double_divergence_of_the_metric_times_a_function_is_its_laplacian() -> None:
    u, sheet = torus(20.0, 6.0)
    away = 20 + 6 * np.cos(u)
    laplacian = (-np.cos(u) * away + np.sin(u) ** 2 * 6) / away / 36
    assert_allclose(sheet.double_divergence(sheet.raised * np.cos(u)), laplacian, atol=1e-9)


def test_the_double_divergence_on_a_surface_of_revolution_is_that_of_the_textbooks() -> None:
    """For principal values M_l, M_t: (1/r) d/dl (d(r M_l)/dl - M_t dr/dl), with l along the meridian."""
    r, sheet = bellows(12.5, 1.5, 60.0)
    along, around = 1 + 0.2 * r, 2 - 0.01 * r**2
    tensor = np.zeros((2, 2, *r.shape))
    tensor[0, 0], tensor[1, 1] = along / sheet.metric[0, 0], around / sheet.metric[1, 1]

    def by_length(values):
        return sheet.derivative(values, 0) / np.sqrt(sheet.metric[0, 0])

    wanted = by_length(by_length(r * along) - around * by_length(r)) / r
    assert_allclose(sheet.double_divergence(tensor), wanted, atol=1e-9)


def test_the_double_divergence_of_a_bent_ring_is_the_second_derivative_along_it() -> None:
    arc, length = 2 * np.pi * 12.5, 40.0
    s, _ = np.meshgrid(angles(96), angles(8), indexing="ij")
    theta = s + 0.1 * np.sin(2 * s)
    places = np.stack([0 * s, 12.5 * np.sin(theta), 12.5 * np.cos(theta)], axis=-1)
    sheet = Sheet(np.swapaxes(places, 0, 1), np.array([[1.0, 0, 0], [0, 0, 0]]), (length, arc))
    value = np.swapaxes(np.cos(2 * theta), 0, 1)
    tensor = np.zeros((2, 2, 8, 96))
    tensor[1, 1] = value / sheet.metric[1, 1]
    assert_allclose(sheet.double_divergence(tensor), -4 * value / 12.5**2, atol=1e-8)


@given(st.floats(-3, 3), st.floats(0, 9))
def test_places_are_read_between_the_grid_exactly(u0: float, u1: float) -> None:
    _, sheet = torus(20.0, 6.0, (16, 16))
    a, b = np.meshgrid(angles(16), angles(16), indexing="ij")
    values = np.stack([np.sin(3 * a) * np.cos(2 * b), np.cos(a)], axis=-1)
    read = sheet.at(values, np.array([u0]), np.array([u1]))[0, 0]
    first, second = u0 / 6, u1 / 20
    assert_allclose(read, [np.sin(3 * first) * np.cos(2 * second), np.cos(first)], atol=1e-12)


def test_inverse_and_determinant_are_those_of_matrices() -> None:
    form = np.array([[2.0, 0.5], [0.5, 1.0]])
    assert determinant(form) == pytest.approx(1.75)
    assert_allclose(inverse(form) @ form, np.eye(2), atol=1e-12)
