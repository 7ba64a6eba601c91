"""The points of a group come out of its columns as their quanta say, bit for bit."""

import struct
import tracemalloc

import numpy as np
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from archive.capture.groups.test_quanta import ARRAYS, with_values
from archive.captures import computed_points, points
from grabberd.archive.capture.encodings import (
    COLUMNS,
    decode_points,
    differences,
    encode_points,
    frame_of,
    planes_of,
    read_planes,
    sums,
)
from grabberd.core.reconstruction.points import Points

CLAIM_OF_4_GB = bytes.fromhex("28b52ffd e0") + struct.pack("<Q", 1 << 32) + bytes.fromhex("030010 00")


def decoded(fields):
    """The arrays of a group that has been encoded and decoded."""
    back = decode_points(encode_points(fields), sum(map(len, fields)))
    return {name: getattr(back, name) for name in ARRAYS}


def expected(fields):
    return {name: np.concatenate([getattr(one, name) for one in fields]) for name in ARRAYS}


def same(one, other):
    for name in ARRAYS:
        assert one[name].tobytes() == other[name].tobytes(), name
        assert one[name].dtype == other[name].dtype


@given(st.lists(st.integers(0, 30), min_size=1, max_size=8), st.integers(0, 1000))
def test_points_of_any_number_of_fields_come_back_as_quantised(counts, seed):
    fields = [points(seed + place, count) for place, count in enumerate(counts)]
    same(decoded(fields), expected(fields))


def test_what_is_computed_comes_back_quantised():
    fields = [computed_points(n, 40) for n in range(9)]
    same(decoded(fields), expected([points(n, 40) for n in range(9)]))


def test_a_point_is_the_same_whichever_others_are_stored_with_it():
    one, other = points(1), points(2)
    xyz = other.xyz_mm.copy()
    xyz[0, 0] = np.nan
    odd = with_values(other, xyz_mm=xyz, image_px=other.image_px * 1e9, covariance_mm2=-other.covariance_mm2)
    columns = encode_points([one, odd])
    assert columns.exact.split() == ["xyz_mm", "image_px", "covariance_mm2"]
    same(decoded([one, odd]), expected([one, odd]))
    same({name: value[: len(one)] for name, value in decoded([one, odd]).items()}, decoded([one]))


def test_no_points_come_back_as_no_points():
    back = decode_points(encode_points([Points.none(), Points.none()]), 0)
    assert (len(back), back.covariance_mm2.shape, back.image_px.shape) == (0, (0, 3, 3), (0, 2, 2))


@given(st.lists(st.integers(-(2**31), 2**31 - 1), min_size=4, max_size=40), st.sampled_from([1, 2, 4]))
def test_differences_of_any_numbers_add_up_to_them(numbers, size):
    values = np.array(numbers[: len(numbers) // size * size], np.int32).view(np.uint32).reshape(-1, size)
    np.testing.assert_array_equal(sums(differences(values)), values)
    halves = values.view(np.uint16)
    np.testing.assert_array_equal(sums(differences(halves)), halves)


def test_small_differences_of_either_sign_have_empty_upper_bytes():
    folded = differences(np.array([[5], [4], [6], [6]], np.uint32))
    assert folded.tolist() == [[10, 1, 4, 0]]
    assert b"".join(planes_of(folded)) == bytes([10, 1, 4, 0, *[0] * 12])
    np.testing.assert_array_equal(read_planes(frame_of(planes_of(folded)), "<u4", 4), folded.ravel())


def test_seventy_points_of_a_field_take_a_third_of_their_bytes_in_format_1():
    rng = np.random.default_rng(5)
    still = points(1, 70)
    shaken = [
        with_values(
            still,
            xyz_mm=still.xyz_mm + rng.normal(0, 0.05, (70, 3)),
            image_px=still.image_px + rng.normal(0, 0.12, (70, 2, 2)),
        )
        for _ in range(25)
    ]
    assert sum(map(len, encode_points(shaken)[1:])) / 25 < 1200


@pytest.mark.parametrize("count", [-1, 1 << 40, None, "7", 2.5])
def test_a_number_of_points_that_no_group_has_is_damage(count):
    with pytest.raises(ValueError, match="a group of"):
        decode_points(encode_points([points(1, 2)]), count)


@pytest.mark.parametrize(("count", "word"), [(1, "more"), (3, "fewer")])
def test_more_or_fewer_points_than_expected_are_damage(count, word):
    with pytest.raises(ValueError, match=f"damaged points: damaged zstd data: {word} bytes"):
        decode_points(encode_points([points(1, 2)]), count)


@pytest.mark.parametrize("column", COLUMNS)
@pytest.mark.parametrize("bomb", ["a claim", "a gigabyte", "nonsense", "no bytes"])
def test_whatever_a_column_claims_or_holds_takes_no_memory(column, bomb):
    data = {"a claim": CLAIM_OF_4_GB, "nonsense": b"nonsense", "no bytes": b""}.get(bomb) or _gigabyte(bomb)
    columns = encode_points([points(1, 5)])._replace(**{column: data})
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match="damaged points"):
            decode_points(columns, 5)
        assert tracemalloc.get_traced_memory()[1] < 10 << 20
    finally:
        tracemalloc.stop()


def _gigabyte(bomb):
    if bomb != "a gigabyte":
        return b""
    compressor = zstandard.ZstdCompressor().compressobj(size=1 << 30)
    return b"".join(compressor.compress(bytes(1 << 20)) for _ in range(1 << 10)) + compressor.flush()


@pytest.mark.parametrize("exact", ["target", "xyz", "xyz_mm; image_px"])
def test_an_unknown_exact_column_is_damage(exact):
    with pytest.raises(ValueError, match="there is no column"):
        decode_points(encode_points([points(1, 2)])._replace(exact=exact), 2)
