"""Pictures from outside are read whole or refused by name."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.replay.pictures import luma, png
from grabberd.errors import PictureError
from grabberd_replay.picture_file import Header, read_picture

GREY = luma(1, 12, 20)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.png"


def test_grey_values_come_as_they_are(path):
    path.write_bytes(png(GREY))
    header, values = read_picture(path)
    assert header == Header(12, 20, coloured=False)
    np.testing.assert_array_equal(values, GREY)


def test_colours_become_luma_and_that_is_said(path):
    colours = np.zeros((4, 6, 3), np.uint8)
    colours[..., 1] = 200
    path.write_bytes(png(colours))
    header, values = read_picture(path)
    assert header.coloured
    assert str(header) == "6x4 coloured"
    assert set(values.ravel()) == {round(0.587 * 200)}


def test_grey_stored_as_colours_stays_what_it_was(path):
    path.write_bytes(png(cv2.cvtColor(GREY, cv2.COLOR_GRAY2BGR)))
    np.testing.assert_array_equal(read_picture(path)[1], GREY)


def test_a_missing_picture_is_named_with_what_was_expected(path):
    with pytest.raises(PictureError, match=r"a\.png is missing; expected 720x576 grey"):
        read_picture(path, Header(576, 720, coloured=False))


@pytest.mark.parametrize("kept", [0, 7, 20, 33, 60, -1, -12, -13])
def test_a_truncated_picture_is_refused_wherever_it_ends(path, kept):
    path.write_bytes(png(GREY)[:kept])
    with pytest.raises(PictureError, match=r"a\.png.* truncated"):
        read_picture(path)


def test_a_bit_that_flipped_is_found(path):
    data = bytearray(png(GREY))
    data[60] ^= 4
    path.write_bytes(bytes(data))
    with pytest.raises(PictureError, match="checksum"):
        read_picture(path)


def test_another_kind_of_file_is_refused(path):
    path.write_bytes(b"GIF89a" + bytes(100))
    with pytest.raises(PictureError, match="no PNG"):
        read_picture(path)


def test_content_that_cannot_be_decoded_is_refused(path):
    data = png(GREY)
    at = data.index(b"IDAT")
    (length,) = struct.unpack_from(">I", data, at - 4)
    rubbish = b"IDAT" + bytes(length)
    check = struct.pack(">I", zlib.crc32(rubbish))
    path.write_bytes(data[:at] + rubbish + check + data[at + 8 + length :])
    with pytest.raises(PictureError, match="cannot be decoded"):
        read_picture(path)


def test_sixteen_bits_come_as_they_are(path):
    deep = GREY.astype(np.uint16) * 257
    path.write_bytes(png(deep))
    header, values = read_picture(path)
    assert str(header) == "20x12 grey of 16 bits"
    np.testing.assert_array_equal(values, deep)


@pytest.mark.parametrize("colours", ["grey", "coloured"])
def test_an_alpha_channel_is_read_if_it_hides_nothing(path, colours):
    path.write_bytes(with_alpha(colours, 255))
    header, values = read_picture(path)
    assert header.coloured == (colours == "coloured")
    np.testing.assert_array_equal(values, GREY)


@pytest.mark.parametrize("colours", ["grey", "coloured"])
def test_transparent_pixels_are_refused(path, colours):
    path.write_bytes(with_alpha(colours, 254))
    with pytest.raises(PictureError, match=r"a\.png has an alpha channel with 240 transparent pixels"):
        read_picture(path)


def with_alpha(colours, alpha):
    """The grey picture as a PNG of colour type 4 or 6, written chunk by chunk: OpenCV writes no type 4."""
    channels = 1 if colours == "grey" else 3
    rows = [b"\0" + np.column_stack([*[row] * channels, np.full_like(row, alpha)]).tobytes() for row in GREY]
    head = struct.pack(">IIBBBBB", GREY.shape[1], GREY.shape[0], 8, 4 if colours == "grey" else 6, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(b"".join(rows))), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )


def _claiming(columns, lines):
    """A PNG of one pixel whose header claims another size; its checksums are right."""
    whole = png(np.zeros((1, 1), np.uint8))
    head = b"IHDR" + struct.pack(">II", columns, lines) + whole[24:29]
    return whole[:12] + head + struct.pack(">I", zlib.crc32(head)) + whole[33:]


@pytest.mark.parametrize("size", [(16383, 16383), (4097, 1), (1, 1 << 31), (0, 5)])
def test_a_size_that_no_grabber_has_is_refused_before_anything_is_decoded(path, size):
    path.write_bytes(_claiming(*size))
    with pytest.raises(PictureError, match=f"has {size[0]}x{size[1]} pixels by its header"):
        read_picture(path)


def test_a_file_that_goes_on_for_ever_is_refused():
    with pytest.raises(PictureError, match="more than 67108864 bytes"):
        read_picture(Path("/dev/zero"))


def test_a_picture_of_another_size_is_refused_with_both_sizes(path):
    path.write_bytes(png(GREY))
    with pytest.raises(PictureError, match="is 20x12 grey, expected 20x14 grey"):
        read_picture(path, Header(14, 20, coloured=False))


def test_a_folder_of_that_name_is_refused(path):
    path.mkdir()
    with pytest.raises(PictureError, match="cannot be read"):
        read_picture(path)


# --- other kinds ---

SMOOTH = cv2.GaussianBlur(GREY, (0, 0), 3)


def written(path, picture, *options):
    path.write_bytes(cv2.imencode(path.suffix, picture, options)[1].tobytes())
    return path


@pytest.mark.parametrize("name", ["a.tif", "a.tiff", "a.TIF", "a.bmp", "a.pgm", "a.pnm"])
def test_kinds_without_loss_are_read_like_png(tmp_path, name):
    path = written(tmp_path / name.lower(), GREY).rename(tmp_path / name)
    header, values = read_picture(path)
    assert header == Header(*GREY.shape, coloured=False)
    np.testing.assert_array_equal(values, GREY)


@pytest.mark.parametrize("name", ["a.tif", "a.pgm"])
def test_samples_of_sixteen_bits_come_as_they_are_in_other_kinds_too(tmp_path, name):
    deep = GREY.astype(np.uint16) * 257
    header, values = read_picture(written(tmp_path / name, deep))
    assert header.bits == 16
    np.testing.assert_array_equal(values, deep)


def test_of_a_jpeg_the_luma_is_read_and_no_mark_turns_it(tmp_path):
    path = written(tmp_path / "a.jpg", SMOOTH, cv2.IMWRITE_JPEG_QUALITY, 95)
    plain = read_picture(path)[1]
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    data = path.read_bytes()
    path.write_bytes(data[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + data[2:])
    assert cv2.imread(str(path), 0).shape != GREY.shape, "the mark is there, and others follow it"
    np.testing.assert_array_equal(read_picture(path)[1], plain)
    assert np.abs(plain.astype(int) - SMOOTH).max() < 8


@pytest.mark.parametrize("name", ["a.jpg", "a.tif", "a.bmp", "a.pgm"])
def test_other_kinds_are_refused_wherever_they_end(tmp_path, name):
    path = written(tmp_path / name, SMOOTH)
    whole = path.read_bytes()
    for kept in (0, 1, 20, len(whole) // 2, len(whole) - 3):
        path.write_bytes(whole[:kept])
        with pytest.raises(PictureError, match=f"{name} (is no|is truncated|cannot be decoded)"):
            read_picture(path)


@pytest.mark.parametrize("name", ["a.jpg", "a.tif", "a.bmp", "a.pgm"])
def test_a_picture_of_another_kind_than_its_name_says_is_refused(tmp_path, name):
    path = written(tmp_path / "a.png", GREY).rename(tmp_path / name)
    with pytest.raises(PictureError, match=f"{name} is no"):
        read_picture(path)


def test_a_file_of_several_pages_is_refused(tmp_path):
    path = tmp_path / "a.tif"
    assert cv2.imwritemulti(str(path), [GREY, GREY])
    with pytest.raises(PictureError, match="has 2 pages"):
        read_picture(path)


def test_samples_that_are_no_whole_numbers_are_refused(tmp_path):
    path = written(tmp_path / "a.tif", GREY.astype(np.float32))
    with pytest.raises(PictureError, match="samples of float32"):
        read_picture(path)
