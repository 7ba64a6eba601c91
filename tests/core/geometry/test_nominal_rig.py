"""The rig as it was built, and the views that it makes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.geometry.rigs import aimed
from grabberd.core.geometry import NominalRig, project
from grabberd.errors import InputError

REFERENCE = NominalRig(720, 576, (0, 360), (360, 720), 240.0, 128.0, 30.0, 8.0, 0.0086, 0.0083)
near_one = st.floats(0.9, 1.1)
sign = st.sampled_from([1, -1])


def rig(distance=1.0, base=1.0, convergence=1.0, focal=1.0):
    return replace(
        REFERENCE,
        distance_mm=240.0 * distance,
        base_mm=128.0 * base,
        convergence_deg=30.0 * convergence,
        focal_length_mm=8.0 * focal,
    )


@given(near_one, near_one, near_one, near_one, sign, sign)
def test_the_objects_origin_appears_in_the_middle_of_either_half(d, b, c, f, left, right):
    views = rig(d, b, c, f).views((left, right))
    seen = np.concatenate([project(view, np.zeros((1, 3))) for view in views])
    np.testing.assert_allclose(seen, [[179.5, 287.5], [539.5, 287.5]], atol=1e-9)


@given(near_one, near_one, near_one)
def test_what_the_numbers_contradict_each_other_in_is_shared_among_them(d, b, c):
    nominal = rig(d, b, c)
    left, right = nominal.views()
    made_deg = 2 * np.degrees(np.arctan2(right.Y0_mm, right.Z0_mm))
    assert abs(np.log(left.Z0_mm / nominal.distance_mm)) < 0.11
    assert abs(np.log((right.Y0_mm - left.Y0_mm) / nominal.base_mm)) < 0.11
    assert abs(np.log(made_deg / nominal.convergence_deg)) < 0.12


@pytest.mark.parametrize("handedness", [1, -1])
def test_the_reference_rig_has_the_views_that_it_is_built_with(handedness):
    convergence_deg = 2 * np.degrees(np.arctan2(64.0, 240.0))
    views = replace(REFERENCE, convergence_deg=convergence_deg).views((handedness, handedness))
    for view in views:
        expected = aimed(view.name, handedness, (0.0,) * 9)
        np.testing.assert_allclose(view.vector(), expected.vector(), atol=1e-12)
        assert view.handedness == handedness
        assert (view.first_column, view.end_column) == (expected.first_column, expected.end_column)


def test_y_runs_to_the_right_in_a_right_handed_view_and_to_the_left_in_a_mirrored_one():
    for handedness in (1, -1):
        for view in REFERENCE.views((handedness, handedness)):
            origin, along = project(view, np.array([[0.0, 0.0, 0.0], [0.0, 6.5, 0.0]]))
            assert np.sign(along[0] - origin[0]) == handedness


def test_numbers_that_belong_to_different_rigs_are_refused():
    with pytest.raises(InputError, match=r"implies a convergence of 29\.9 degrees, but 60 are stated"):
        rig(convergence=2.0).views()
