"""Strain of the middle surface: what the membrane has, not what the targets on the outer face show."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from grabberd_liner.analysis.wall.strain import middle_forms, outer_strain, strain
from liner.analysis.shapes import cylinder, moved, sheet, sphere, torus

U, V = np.linspace(-30.0, 30.0, 7), np.linspace(-12.0, 12.0, 7)
H = 1.25


def middle_strain(now, before, depth_mm):
    return strain(*(middle_forms(face, depth_mm).tangents for face in (now, before)))


def test_a_simple_stretch_has_its_stretches():
    result = middle_strain(sheet(U, V, 1.1, 0.95), sheet(U, V), H)
    assert result.stretch == pytest.approx(np.tile([1.1, 0.95], (7, 1)), abs=1e-12)
    expected = np.diag([(1.1**2 - 1) / 2, (0.95**2 - 1) / 2])
    assert result.green_lagrange == pytest.approx(np.tile(expected, (7, 1, 1)), abs=1e-12)
    assert np.abs(result.directions) == pytest.approx(np.tile(np.eye(3)[:2], (7, 1, 1)))


def test_a_shear_is_seen_between_the_axes():
    sheared = sheet(U, V)
    sheared[:, 2, 0] = 0.2
    result = middle_strain(sheared, sheet(U, V), H)
    assert result.green_lagrange == pytest.approx(np.tile([[0.0, 0.1], [0.1, 0.02]], (7, 1, 1)), abs=1e-12)
    assert result.stretch.prod(axis=1) == pytest.approx(np.ones(7))


def test_a_blown_up_sphere_is_stretched_alike_everywhere_at_its_middle_surface():
    result = middle_strain(sphere(22.0, U / 4, V, stretch=1.1), sphere(20.0, U / 4, V), H)
    assert result.stretch == pytest.approx(np.full((7, 2), (22 - H) / (20 - H)))


def test_bending_strains_the_outer_face_by_ten_per_cent_and_the_middle_surface_not_at_all():
    """A liner of middle radius 12.5 mm and wall 2.5 mm, pressed flat."""
    flat, open_tube = sheet(U, V), cylinder(12.5 + H, U, V, around=(12.5 + H) / 12.5)
    assert middle_strain(flat, open_tube, H).green_lagrange == pytest.approx(np.zeros((7, 2, 2)), abs=1e-12)
    assert outer_strain(open_tube, flat).stretch[:, 0] == pytest.approx(np.full(7, 1.1))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_rigid_motion_is_no_strain_and_changes_none(seed):
    rng = np.random.default_rng(seed)
    before = torus(30.0, 8.0, U, V) + rng.normal(size=(7, 15, 3)) * 1e-3
    after = before + rng.normal(size=(7, 15, 3)) * 1e-2
    rotation, shift = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3) * 100
    still = middle_strain(moved(before, rotation, shift), before, H)
    assert still.green_lagrange == pytest.approx(np.zeros((7, 2, 2)), abs=1e-11)
    strained = middle_strain(after, before, H)
    for now, then in ((moved(after, rotation, shift), before), (after, moved(before, rotation, shift))):
        assert middle_strain(now, then, H).green_lagrange == pytest.approx(strained.green_lagrange, abs=1e-11)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.8, 1.3), st.floats(0.8, 1.3), st.floats(0.8, 1.3), st.floats(0.8, 1.3))
def test_stretches_along_the_same_axes_compose(first, second, third, fourth):
    whole = middle_strain(sheet(U, V, first * third, second * fourth), sheet(U, V), H)
    rest = middle_strain(sheet(U, V, first * third, second * fourth), sheet(U, V, first, second), H)
    assert rest.stretch.prod(axis=1) * first * second == pytest.approx(whole.stretch.prod(axis=1))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_principal_directions_are_unit_vectors_before_and_as_long_as_their_stretches_after(seed):
    now, then = np.random.default_rng(seed).normal(size=(2, 5, 2, 3))
    found = strain(now, then)
    before, after = found.components @ then, found.components @ now
    assert before @ before.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(2), (5, 1, 1)), abs=1e-6)
    assert after == pytest.approx(found.stretch[..., np.newaxis] * found.directions)
