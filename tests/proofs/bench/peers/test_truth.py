"""Places and points beside the truth."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from .truth import UNNAMED, Pairs, point_errors, pointing

TRUTH = np.array([[20.0 * column, 15.0 * row] for row in range(4) for column in range(5)])
BOTH = np.stack([TRUTH, TRUTH + np.array([360.0, 0.0])])
SPACE = np.column_stack([TRUTH / 4, np.zeros(len(TRUTH))])


def pairs(left=TRUTH, right=BOTH[1], xyz_mm=SPACE, target=None):
    named = np.full(len(left), UNNAMED) if target is None else target
    return Pairs(left, right, xyz_mm, named)


@given(st.permutations(range(len(TRUTH))), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_places_off_by_the_same_are_all_found_with_that_error_in_any_order(order, x, y):
    found = pointing([TRUTH[list(order)] + np.array([x, y])], TRUTH)
    assert (found.found, found.of, found.wrong) == (20, 20, 0)
    assert (found.x_px, found.y_px) == pytest.approx((abs(x), abs(y)), abs=1e-9)


def test_a_place_that_is_no_target_is_wrong_and_a_target_without_a_place_is_not_found():
    found = pointing([np.vstack([TRUTH[1:], [[500.0, 500.0]]]), TRUTH], TRUTH)
    assert (found.found, found.of, found.wrong) == (39, 40, 1)


def test_a_target_that_fell_into_two_is_found_once():
    found = pointing([np.vstack([TRUTH, TRUTH[:1] + np.array([1.0, 0.0])])], TRUTH)
    assert (found.found, found.wrong, found.x_px) == (20, 1, 0.0)


def test_of_nothing_found_the_error_is_not_a_number():
    found = pointing([np.empty((0, 2))], TRUTH)
    assert (found.found, found.wrong) == (0, 0)
    assert math.isnan(found.x_px)


def test_points_of_the_right_pairs_are_right_with_the_error_of_their_axes():
    found = point_errors([pairs(xyz_mm=SPACE + np.array([3.0, 0.0, 4.0]))], BOTH, SPACE)
    assert (found.right, found.of, found.wrong) == (20, 20, 0)
    assert (found.x_mm, found.y_mm, found.z_mm, found.xyz_mm) == pytest.approx((3.0, 0.0, 4.0, 5.0))


def test_a_point_of_two_targets_is_wrong_and_spoils_no_error():
    swapped = BOTH[1].copy()
    swapped[[0, 1]] = swapped[[1, 0]]
    found = point_errors(
        [pairs(right=swapped, xyz_mm=SPACE + 90.0 * (np.arange(20) < 2)[:, None])], BOTH, SPACE
    )
    assert (found.right, found.wrong, found.xyz_mm) == (18, 2, 0.0)


def test_a_point_with_another_s_name_is_wrong():
    names = np.arange(20)
    names[0] = 1
    found = point_errors([pairs(target=names)], BOTH, SPACE)
    assert (found.right, found.wrong) == (19, 1)
