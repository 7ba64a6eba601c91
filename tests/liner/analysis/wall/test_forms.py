"""Fundamental forms: exact on analytic shapes, wherever they are and whatever their coordinates."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from grabberd_liner.analysis.wall.strain import (
    curvature_per_m,
    determinant,
    middle_forms,
    outer_forms,
)
from liner.analysis.shapes import cylinder, moved, renamed, sheet, sphere, torus

U, V = np.linspace(-30.0, 30.0, 7), np.linspace(-12.0, 12.0, 7)
H = 1.35


def test_a_cylinder_is_curved_by_one_over_r_outside_and_one_over_r_minus_h_at_the_depth_h():
    jets = cylinder(13.75, U, V)
    assert curvature_per_m(outer_forms(jets)) == pytest.approx(np.tile([1e3 / 13.75, 0.0], (7, 1)))
    assert curvature_per_m(middle_forms(jets, H)) == pytest.approx(np.tile([1e3 / (13.75 - H), 0], (7, 1)))


def test_a_sphere_is_curved_alike_in_all_directions():
    values = curvature_per_m(middle_forms(sphere(20.0, U / 4, V), H))
    assert values == pytest.approx(np.full((7, 2), 1e3 / (20 - H)))


def test_a_torus_has_the_curvatures_of_its_tube_and_of_its_ring():
    jets = torus(30.0, 8.0, U, V)
    outside = np.cos(U / 8) / (30 + 8 * np.cos(U / 8))
    expected = 1e3 * np.stack([np.full(7, 1 / 8), outside], axis=1)
    assert curvature_per_m(outer_forms(jets)) == pytest.approx(expected)


def test_a_plane_has_no_curvature():
    assert curvature_per_m(outer_forms(sheet(U, V))) == pytest.approx(np.zeros((7, 2)))


def test_coordinates_that_turn_the_other_way_round_are_told_by_outward():
    jets = renamed(cylinder(13.75, U, V), _swap("v"), _swap("u"))
    assert curvature_per_m(middle_forms(jets, H, outward=-1.0))[:, 0] == pytest.approx(1e3 / (13.75 - H))


def test_the_middle_surface_has_the_area_that_parallel_surfaces_have():
    outer, middle = outer_forms(sphere(20.0, U / 4, V)), middle_forms(sphere(20.0, U / 4, V), H)
    ratio = np.sqrt(determinant(middle.first) / determinant(outer.first))
    assert ratio == pytest.approx(np.full(7, (1 - H / 20) ** 2))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_moving_the_surface_changes_no_curvature(seed):
    rng = np.random.default_rng(seed)
    jets = torus(30.0, 8.0, U, V) + rng.normal(size=(7, 15, 3)) * 1e-3
    rotation = Rotation.random(rng=rng).as_matrix()
    here, there = (
        curvature_per_m(middle_forms(j, H)) for j in (jets, moved(jets, rotation, rng.normal(size=3)))
    )
    assert there == pytest.approx(here)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_curvatures_do_not_depend_on_the_coordinates(seed):
    rng = np.random.default_rng(seed)
    jets = torus(30.0, 8.0, U, V) + rng.normal(size=(7, 15, 3)) * 1e-3
    u_of, v_of = _swap("u") + 0.1 * rng.normal(size=(5, 5)), _swap("v") + 0.1 * rng.normal(size=(5, 5))
    here, there = (curvature_per_m(middle_forms(j, H)) for j in (jets, renamed(jets, u_of, v_of)))
    assert there == pytest.approx(here)


def _swap(name):
    result = np.zeros((5, 5))
    result[(1, 0) if name == "u" else (0, 1)] = 1.0
    return result
