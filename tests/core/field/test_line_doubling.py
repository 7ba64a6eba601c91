import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from grabberd.core.field import BOTTOM, TOP, Field, double_lines

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


def test_the_kernel_leaves_even_pictures_and_even_slopes_alone():
    slope = np.add.outer(6 * np.arange(8), 4 * np.arange(10)).astype(np.uint8)
    linear, kernel = (double_lines(Field.intact(slope, TOP), one).luma for one in ("linear", "kernel3x3"))
    np.testing.assert_array_equal(kernel[:, 1:-1], linear[:, 1:-1])


@pytest.mark.parametrize("parity", [TOP, BOTTOM])
def test_the_kernel_spreads_a_lone_pixel_over_three_by_three(parity):
    luma = np.zeros((5, 7), np.uint8)
    luma[2, 3] = 128
    doubled = double_lines(Field.intact(luma, parity), "kernel3x3").luma
    here = 4 + parity
    np.testing.assert_array_equal(
        doubled[here - 1 : here + 2, 2:5], [[16, 32, 16], [32, 64, 32], [16, 32, 16]]
    )
    assert doubled.sum() == 256


def test_the_kernel_smooths_steps_along_the_line():
    luma = np.zeros((4, 8), np.uint8)
    luma[:, 4:] = 200
    doubled = double_lines(Field.intact(luma, TOP), "kernel3x3").luma
    np.testing.assert_array_equal(doubled, np.tile([0, 0, 0, 50, 150, 200, 200, 200], (8, 1)))


def test_an_unknown_interpolation_is_refused():
    with pytest.raises(ValueError, match="unknown interpolation 'cubic'; choose from linear, kernel3x3"):
        double_lines(Field.intact(np.zeros((4, 8), np.uint8), TOP), "cubic")
