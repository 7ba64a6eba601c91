import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from grabberd.core.field import BIT_DEPTHS, TOP, Field, quantise, unpack
from grabberd.core.measurement.labelling import find_runs, run_greys, target_bits

fields = hnp.arrays(np.uint8, st.tuples(st.integers(1, 8), st.integers(1, 40))).map(
    lambda luma: Field.intact(luma, TOP)
)
depths = st.sampled_from(BIT_DEPTHS)


def mask_of(packed):
    return np.unpackbits(target_bits(packed), axis=1, count=packed.columns).astype(bool)


@given(fields, depths, st.integers(64, 254))
def test_the_mask_is_where_the_unpacked_grey_value_exceeds_the_threshold(field, bits, threshold):
    packed = quantise(field, bits, threshold)
    np.testing.assert_array_equal(mask_of(packed), unpack(packed).luma > threshold)


@pytest.mark.parametrize("bits", [2, 3, 4, 5, 6])
def test_the_lowest_level_is_background_even_under_a_threshold_of_0(bits):
    packed = quantise(Field.intact(np.array([[0, 255, 0]], np.uint8), TOP), bits, 0)
    assert mask_of(packed).tolist() == [[False, True, False]]


@given(fields, depths, st.integers(0, 254))
def test_no_pixel_beyond_the_last_column_is_a_target(field, bits, threshold):
    bits_set = np.unpackbits(target_bits(quantise(field, bits, threshold)), axis=1)
    assert not bits_set[:, field.columns :].any()


@given(fields, st.sampled_from([2, 3, 4, 5, 6, 8]), st.integers(0, 254))
def test_the_greys_of_runs_are_those_of_the_unpacked_field(field, bits, threshold):
    packed = quantise(field, bits, threshold)
    grey, column, begin = run_greys(packed, find_runs(target_bits(packed)))
    row, expected_column = np.nonzero(mask_of(packed))
    np.testing.assert_array_equal(column, expected_column)
    np.testing.assert_array_equal(grey, unpack(packed).luma[row, expected_column])
    assert len(begin) == len(find_runs(target_bits(packed)).row)
