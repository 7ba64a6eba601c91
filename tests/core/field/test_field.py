import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from grabberd.core.field import (
    BIT_DEPTHS,
    BOTTOM,
    TOP,
    Field,
    double_lines,
    packed_shape,
    quantise,
    split_frame,
    unpack,
)

frames = hnp.arrays(np.uint8, st.tuples(st.integers(1, 12).map(lambda n: 2 * n), st.integers(1, 40)))


@given(frames, st.sampled_from([TOP, BOTTOM]))
def test_the_fields_of_a_frame_weave_into_it_again(frame, older):
    woven = np.zeros_like(frame)
    for field in split_frame(frame, older):
        lines = field.y0 + field.y_step * np.arange(field.rows)
        woven[lines] = field.luma
    np.testing.assert_array_equal(woven, frame)


@pytest.mark.parametrize("older", [TOP, BOTTOM])
def test_the_older_field_comes_first(older):
    first, second = split_frame(np.zeros((4, 3), np.uint8), older)
    assert (first.parity, second.parity) == (older, 1 - older)


def test_fields_are_views_into_the_frame():
    frame = np.zeros((4, 3), np.uint8)
    top, bottom = split_frame(frame)
    frame[1, 2] = 9
    assert np.shares_memory(top.luma, frame)
    assert bottom.luma[0, 2] == 9


@pytest.mark.parametrize("parity", [TOP, BOTTOM])
def test_an_intact_field_says_on_which_frame_lines_its_rows_are(parity):
    field = Field.intact(np.zeros((5, 7), np.uint8), parity)
    assert (field.y0, field.y_step) == (parity, 2)
    assert (field.rows, field.columns) == (5, 7)


fields = st.builds(
    Field.intact,
    hnp.arrays(np.uint8, st.tuples(st.integers(1, 9), st.integers(1, 40))),
    st.sampled_from([TOP, BOTTOM]),
)
depths = st.sampled_from(BIT_DEPTHS)
thresholds = st.integers(0, 254)


@given(fields, depths, thresholds, thresholds)
def test_unpacking_and_quantising_again_gives_the_same_planes(field, bits, threshold, another):
    packed = quantise(field, bits, threshold)
    np.testing.assert_array_equal(quantise(unpack(packed), bits, another).data, packed.data)


@given(fields, thresholds)
def test_eight_bits_lose_nothing(field, threshold):
    np.testing.assert_array_equal(unpack(quantise(field, 8, threshold)).luma, field.luma)


@given(fields, thresholds)
def test_one_bit_is_set_exactly_where_the_luma_exceeds_the_threshold(field, threshold):
    luma = unpack(quantise(field, 1, threshold)).luma
    np.testing.assert_array_equal(luma, np.where(field.luma > threshold, 255, 0))


@given(fields, st.sampled_from([2, 3, 4, 5, 6]))
def test_a_grey_value_comes_back_as_the_middle_of_its_level(field, bits):
    step = 256 >> bits
    np.testing.assert_array_equal(
        unpack(quantise(field, bits, 50)).luma, field.luma.astype(int) // step * step + step // 2
    )


@given(fields, depths, thresholds)
def test_a_packed_field_keeps_where_its_rows_are(field, bits, threshold):
    for whole in (field, double_lines(field) if field.rows > 1 else field):
        packed = quantise(whole, bits, threshold)
        assert (packed.rows, packed.columns) == whole.luma.shape
        assert (packed.parity, packed.y0, packed.y_step) == (whole.parity, whole.y0, whole.y_step)
        assert packed.threshold == threshold


@given(fields, depths)
def test_its_bytes_have_the_shape_that_a_file_expects(field, bits):
    packed = quantise(field, bits, 100)
    assert packed.data.shape == packed_shape(field.rows, field.columns, bits)
    assert packed.data.flags.c_contiguous
    assert packed.data.dtype == np.uint8


@given(fields, st.sampled_from([1, 2, 3, 4, 5, 6]))
def test_bits_beyond_the_last_column_are_zero(field, bits):
    packed = quantise(field, bits, 0)
    beyond = np.unpackbits(packed.data, axis=2)[:, :, field.columns :]
    assert not beyond.any()


@pytest.mark.parametrize("bits", BIT_DEPTHS)
def test_it_shares_no_memory_with_the_drivers_buffer(bits):
    buffer = np.full((4, 16), 200, np.uint8)
    packed = quantise(Field.intact(buffer, TOP), bits, 100)
    before = packed.data.copy()
    buffer[:] = 0
    np.testing.assert_array_equal(packed.data, before)


def test_the_leftmost_pixel_is_the_highest_bit_and_the_first_plane_the_most_significant():
    packed = quantise(Field.intact(np.array([[255, 0, 0, 64, 0, 0, 0, 0, 128]], np.uint8), TOP), 2, 50)
    assert packed.data.tolist() == [[[0b10000000, 0b10000000]], [[0b10010000, 0]]]


def test_a_one_bit_pal_field_takes_as_many_bytes_as_promised():
    field = Field.intact(np.zeros((288, 720), np.uint8), TOP)
    assert quantise(field, 1, 100).data.nbytes == 25_920
    assert quantise(double_lines(field), 1, 100).data.nbytes == 51_840
    assert quantise(field, 8, 100).data.nbytes == 207_360


def test_a_threshold_of_its_own_for_every_pixel_sets_the_pixels_above_it():
    rng = np.random.default_rng(7)
    luma, thresholds = rng.integers(0, 256, (2, 16, 33)).astype(np.uint8)
    packed = quantise(Field.intact(luma, TOP), 1, thresholds)
    np.testing.assert_array_equal(unpack(packed).luma == 255, luma > thresholds)
    assert isinstance(packed.threshold, int)


def test_an_even_map_of_thresholds_is_the_threshold():
    field = Field.intact(np.arange(256, dtype=np.uint8).reshape(16, 16), TOP)
    even, scalar = (quantise(field, 1, threshold) for threshold in (np.full((16, 16), 99, np.uint8), 99))
    np.testing.assert_array_equal(even.data, scalar.data)
    assert even.threshold == scalar.threshold


@pytest.mark.parametrize(("bits", "shape"), [(2, (4, 8)), (8, (4, 8)), (1, (4, 7))])
def test_a_map_of_thresholds_is_for_one_bit_and_for_its_own_size(bits, shape):
    with pytest.raises(ValueError, match="does not fit a field of"):
        quantise(Field.intact(np.zeros((4, 8), np.uint8), TOP), bits, np.zeros(shape, np.uint8))
