import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from grabberd.field import BOTTOM, TOP, Field, double_lines

lumas = hnp.arrays(np.uint8, st.tuples(st.integers(2, 12), st.integers(1, 40)))
parities = st.sampled_from([TOP, BOTTOM])


@given(lumas, parities)
def test_the_lines_of_the_camera_stay_as_they_are(luma, parity):
    doubled = double_lines(Field.intact(luma, parity))
    np.testing.assert_array_equal(doubled.luma[parity::2], luma)
    assert (doubled.y0, doubled.y_step, doubled.parity) == (0, 1, parity)


def test_a_missing_line_is_the_mean_of_its_neighbours_rounded_half_up_for_every_pair_of_grey_values():
    above, below = np.meshgrid(np.arange(256), np.arange(256))
    pairs = np.stack([above.ravel(), below.ravel()]).astype(np.uint8)
    between = double_lines(Field.intact(pairs, TOP)).luma[1]
    np.testing.assert_array_equal(between, (above.ravel() + below.ravel() + 1) // 2)


@given(lumas, parities)
def test_every_missing_line_between_two_lines_is_their_mean(luma, parity):
    doubled = double_lines(Field.intact(luma, parity)).luma.astype(int)
    missing = np.arange(1, len(doubled) - 1)
    missing = missing[missing % 2 != parity]
    np.testing.assert_array_equal(doubled[missing], (doubled[missing - 1] + doubled[missing + 1] + 1) // 2)


@pytest.mark.parametrize(("parity", "outermost", "neighbour"), [(TOP, 5, 4), (BOTTOM, 0, 1)])
def test_beyond_the_outermost_line_its_neighbour_is_repeated(parity, outermost, neighbour):
    luma = np.array([[10], [20], [70]], np.uint8)
    doubled = double_lines(Field.intact(luma, parity)).luma
    np.testing.assert_array_equal(doubled[outermost], doubled[neighbour])


@given(lumas, parities)
def test_doubled_lines_are_not_doubled_again(luma, parity):
    once = double_lines(Field.intact(luma, parity))
    assert double_lines(once) is once


def test_doubling_leaves_the_field_alone():
    luma = np.arange(12, dtype=np.uint8).reshape(4, 3)
    doubled = double_lines(Field.intact(luma, TOP))
    assert not np.shares_memory(doubled.luma, luma)
    np.testing.assert_array_equal(luma, np.arange(12).reshape(4, 3))


def test_a_strided_view_of_a_frame_doubles_like_a_copy():
    frame = np.random.default_rng(3).integers(0, 256, (8, 10)).astype(np.uint8)
    from_view = double_lines(Field.intact(frame[1::2], BOTTOM))
    from_copy = double_lines(Field.intact(frame[1::2].copy(), BOTTOM))
    np.testing.assert_array_equal(from_view.luma, from_copy.luma)
