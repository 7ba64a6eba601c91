"""The pictures of a group come back bit for bit, and no group takes more memory than it may."""

import numpy as np
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from archive.captures import packed
from grabberd.archive.capture.groups import (
    LARGEST_GROUP,
    MOST_FIELDS,
    decode_pictures,
    encode_pictures,
)
from grabberd.core.field import BIT_DEPTHS, Field, quantise


@pytest.mark.parametrize("doubled", [False, True])
@pytest.mark.parametrize("bits", BIT_DEPTHS)
def test_pictures_come_back_bit_for_bit(bits, doubled):
    fields = [packed(n, bits, doubled) for n in range(7)]
    back = decode_pictures(encode_pictures(fields), 7, fields[0].rows, fields[0].columns, bits)
    for one, data in zip(fields, back, strict=True):
        np.testing.assert_array_equal(data, one.data)
        assert data.flags.c_contiguous
        assert data.base is None


@given(st.integers(1, 30), st.integers(1, 70), st.sampled_from(BIT_DEPTHS), st.integers(1, 5))
def test_pictures_of_any_size_come_back_bit_for_bit(rows, columns, bits, count):
    luma = np.random.default_rng(rows).integers(0, 256, (count, rows, columns), np.uint8)
    fields = [quantise(Field.intact(one, 0), bits, 128) for one in luma]
    back = decode_pictures(encode_pictures(fields), count, rows, columns, bits)
    assert all((data == one.data).all() for one, data in zip(fields, back, strict=True))


def test_a_binary_field_of_targets_takes_less_than_a_kilobyte():
    luma = np.zeros((288, 720), np.uint8)
    for row, column in np.random.default_rng(1).integers(6, 280, (216, 2)):
        luma[row : row + 3, 2 * column : 2 * column + 6] = 255
    fields = [quantise(Field.intact(luma, 0), 1, 128)] * 25
    assert len(encode_pictures(fields)) < 25 * 1000


@pytest.mark.parametrize("count", [0, -1, MOST_FIELDS + 1])
def test_a_number_of_fields_that_no_group_has_is_damage(count):
    with pytest.raises(ValueError, match="a group of"):
        decode_pictures(zstandard.compress(b""), count, 4, 8, 1)


def test_a_group_of_large_pictures_is_refused_before_it_is_decompressed():
    side = 4096
    assert 2 * side * side > LARGEST_GROUP
    with pytest.raises(ValueError, match="a group of 2 fields"):
        decode_pictures(b"", 2, side, side, 8)


@pytest.mark.parametrize(("count", "word"), [(1, "more"), (3, "fewer")])
def test_more_or_fewer_pictures_than_expected_are_damage(count, word):
    fields = [packed(n) for n in range(2)]
    with pytest.raises(ValueError, match=f"{word} bytes than the"):
        decode_pictures(encode_pictures(fields), count, fields[0].rows, fields[0].columns, 1)
