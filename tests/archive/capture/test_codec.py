"""Single fields and their points come out of a capture file of format 1 as they went in."""

import struct
import tracemalloc
import zlib
from functools import partial

import numpy as np
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from archive.captures import packed, points
from archive.first_format import encode_field
from grabberd.archive.capture.encodings import POINT, decode_field, decode_field_points, encode_field_points
from grabberd.core.field import BIT_DEPTHS, Field, quantise
from grabberd.core.reconstruction.points import Points


@pytest.mark.parametrize("doubled", [False, True])
@pytest.mark.parametrize("bits", BIT_DEPTHS)
def test_a_field_comes_back_bit_for_bit(bits, doubled):
    field = packed(3, bits, doubled)
    codec, data = encode_field(field)
    assert codec == ("zlib" if bits == 1 else "zstd")
    back = decode_field(codec, data, field.rows, field.columns, bits)
    np.testing.assert_array_equal(back, field.data)


@given(st.integers(1, 30), st.integers(1, 70), st.sampled_from(BIT_DEPTHS), st.integers(0, 2**32))
def test_a_field_of_any_size_comes_back_bit_for_bit(rows, columns, bits, seed):
    luma = np.random.default_rng(seed).integers(0, 256, (rows, columns), np.uint8)
    field = quantise(Field.intact(luma, 0), bits, 128)
    np.testing.assert_array_equal(decode_field(*encode_field(field), rows, columns, bits), field.data)


def test_a_binary_field_of_a_few_targets_takes_about_a_kilobyte():
    luma = np.zeros((288, 720), np.uint8)
    for row, column in np.random.default_rng(1).integers(6, 280, (216, 2)):
        luma[row : row + 3, 2 * column : 2 * column + 6] = 255
    assert len(encode_field(quantise(Field.intact(luma, 0), 1, 128))[1]) < 2_500


@pytest.mark.parametrize("codec", ["zlib", "zstd"])
def test_damaged_bytes_of_a_field_are_refused(codec):
    with pytest.raises(ValueError, match=f"damaged {codec}"):
        decode_field(codec, b"not compressed at all", 4, 8, 1)


def test_an_unknown_codec_is_refused_by_name():
    with pytest.raises(ValueError, match="codec 'lzma'"):
        decode_field("lzma", b"", 4, 8, 1)


@pytest.mark.parametrize(
    ("codec", "compress"), [("zlib", zlib.compress), ("zstd", zstandard.ZstdCompressor().compress)]
)
@pytest.mark.parametrize(("size", "word"), [(0, "fewer"), (3, "fewer"), (5, "more"), (10_000, "more")])
def test_more_or_fewer_bytes_than_a_picture_has_are_damage(codec, compress, size, word):
    with pytest.raises(ValueError, match=f"damaged {codec} data: {word} bytes than the 4 expected"):
        decode_field(codec, compress(bytes(size)), 4, 8, 1)


def test_bytes_after_the_end_and_a_missing_end_are_damage():
    whole = zlib.compress(bytes(4))
    for codec, data in (
        ("zlib", whole + b"more"),
        ("zlib", whole[:-1]),
        ("zstd", zstandard.compress(bytes(4)) + b"more"),
        ("zstd", zstandard.compress(bytes(4))[:-1]),
    ):
        with pytest.raises(ValueError, match=f"damaged {codec}"):
            decode_field(codec, data, 4, 8, 1)


def test_a_zstd_frame_that_does_not_state_its_size_is_bounded_by_the_pictures():
    compress = zstandard.ZstdCompressor(write_content_size=False).compress
    assert decode_field("zstd", compress(bytes(4)), 4, 8, 1).shape == (1, 4, 1)
    with pytest.raises(ValueError, match="damaged zstd"):
        decode_field("zstd", compress(bytes(10_000)), 4, 8, 1)


@pytest.mark.parametrize("bomb", ["zlib", "zstd", "a claim", "points"])
def test_what_compressed_bytes_claim_or_hold_takes_no_memory(bomb):
    """Each of them is a gigabyte, or says so; what Python holds for it stays below a hundredth of that."""
    packed_zeros = _bomb(zlib.compressobj(9)) if bomb in ("zlib", "points") else _bomb(_zstd())
    if bomb == "a claim":
        packed_zeros = _CLAIM_OF_4_GB
    codec = "zlib" if bomb == "zlib" else "zstd"
    read = partial(decode_field, codec, packed_zeros, 288, 720, 8)
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match="damaged"):
            (partial(decode_field_points, packed_zeros, 100) if bomb == "points" else read)()
        assert tracemalloc.get_traced_memory()[1] < 10 << 20
    finally:
        tracemalloc.stop()


_CLAIM_OF_4_GB = bytes.fromhex("28b52ffd e0") + struct.pack("<Q", 1 << 32) + bytes.fromhex("030010 00")


def _zstd():
    return zstandard.ZstdCompressor().compressobj(size=1 << 30)


def _bomb(compressor):
    return b"".join(compressor.compress(bytes(1 << 20)) for _ in range(1 << 10)) + compressor.flush()


@pytest.mark.parametrize("count", [-1, 1 << 40, None, "7", 2.5])
def test_a_number_of_points_that_no_field_has_is_damage(count):
    with pytest.raises(ValueError, match="a field of"):
        decode_field_points(encode_field_points(points(1, 2)), count)


@pytest.mark.parametrize(("count", "word"), [(1, "more"), (3, "fewer")])
def test_more_or_fewer_points_than_expected_are_damage(count, word):
    with pytest.raises(ValueError, match=f"damaged points: damaged zlib data: {word} bytes"):
        decode_field_points(encode_field_points(points(1, 2)), count)


def test_places_come_back_bit_for_bit():
    one = points(1, 108)
    back = decode_field_points(encode_field_points(one), len(one))
    assert back.xyz_mm.tobytes() == one.xyz_mm.tobytes()
    np.testing.assert_array_equal(back.target, one.target)


def test_what_is_kept_in_single_precision_is_close():
    one = points(2, 50)
    back = decode_field_points(encode_field_points(one), len(one))
    np.testing.assert_allclose(back.residual_px, one.residual_px, rtol=1e-6)
    np.testing.assert_allclose(back.image_px, one.image_px, rtol=1e-6)
    np.testing.assert_allclose(back.covariance_mm2, one.covariance_mm2, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(
        back.calibration_covariance_mm2, one.calibration_covariance_mm2, rtol=1e-6, atol=1e-12
    )


def test_no_points_come_back_as_no_points():
    back = decode_field_points(encode_field_points(Points.none()), 0)
    assert len(back) == 0
    assert back.covariance_mm2.shape == (0, 3, 3)


def test_damaged_points_are_refused():
    with pytest.raises(ValueError, match="damaged points"):
        decode_field_points(b"nonsense", 1)


def test_anybody_can_read_the_records_with_struct():
    one = points(3, 4)
    raw = zlib.decompress(encode_field_points(one))
    record = struct.Struct("<i3d6f6f4ff")
    assert record.size == POINT.itemsize
    rows = list(record.iter_unpack(raw))
    assert [row[0] for row in rows] == one.target.tolist()
    assert [row[1:4] for row in rows] == [tuple(place) for place in one.xyz_mm.tolist()]
    c = one.covariance_mm2[0]
    assert rows[0][4:10] == pytest.approx((c[0, 0], c[0, 1], c[0, 2], c[1, 1], c[1, 2], c[2, 2]))
    assert rows[0][16:20] == pytest.approx(tuple(one.image_px[0].ravel()))
