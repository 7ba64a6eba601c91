"""The luma in a buffer, in every format that is read."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd_v4l2.formats import FORMATS, RAW, bytes_per_pixel, luma, needed_bytes

WITHOUT_COPY = ("GREY", "NV12")


def picture(lines=6, columns=8):
    return np.random.default_rng(lines * columns).integers(0, 255, (lines, columns), np.uint8)


def buffer_of(grey, fourcc, padding=0):
    """A driver's buffer with this luma; chroma and padding are 255, which the luma never is."""
    lines, columns = grey.shape
    spread = {"YUYV": (0, 2), "UYVY": (1, 2)}
    first, step = spread.get(fourcc, (0, 1))
    padded = np.full((lines, step * columns + padding), 255, np.uint8)
    padded[:, first : step * columns : step] = grey
    chroma = lines * padded.shape[1] // 2 if fourcc == "NV12" else 0
    return np.concatenate([padded.ravel(), np.full(chroma, 255, np.uint8)]), padded.shape[1]


@pytest.mark.parametrize("fourcc", FORMATS)
@given(
    lines=st.integers(2, 12).map(lambda n: 2 * n),
    pairs=st.integers(1, 20),
    padding=st.integers(0, 9),
    parity=st.integers(0, 1),
)
def test_the_luma_of_any_lines_is_read_whatever_the_padding(fourcc, lines, pairs, padding, parity):
    grey = picture(lines, 2 * pairs)
    buffer, bytes_per_line = buffer_of(grey, fourcc, padding)
    rows = slice(parity, None, 2)
    assert np.array_equal(luma(buffer, fourcc, lines, 2 * pairs, bytes_per_line), grey)
    assert np.array_equal(luma(buffer, fourcc, lines, 2 * pairs, bytes_per_line, rows), grey[rows])


@pytest.mark.parametrize("fourcc", WITHOUT_COPY)
def test_luma_that_lies_side_by_side_is_a_view(fourcc):
    buffer, bytes_per_line = buffer_of(picture(), fourcc)
    assert np.shares_memory(luma(buffer, fourcc, 6, 8, bytes_per_line), buffer)


@pytest.mark.parametrize("fourcc", FORMATS)
def test_pixels_lie_side_by_side_for_what_follows(fourcc):
    buffer, bytes_per_line = buffer_of(picture(), fourcc, padding=4)
    assert luma(buffer, fourcc, 6, 8, bytes_per_line, slice(0, None, 2)).strides[1] == 1


@pytest.mark.parametrize("fourcc", FORMATS)
def test_a_drivers_read_only_buffer_will_do(fourcc):
    buffer, bytes_per_line = buffer_of(picture(), fourcc)
    buffer.flags.writeable = False
    assert np.array_equal(luma(buffer, fourcc, 6, 8, bytes_per_line), picture())


def test_the_last_line_need_not_be_padded():
    buffer, bytes_per_line = buffer_of(picture(), "YUYV", padding=6)
    assert np.array_equal(luma(buffer[:-6], "YUYV", 6, 8, bytes_per_line), picture())


def test_nothing_is_read_beyond_a_buffer():
    buffer, bytes_per_line = buffer_of(picture(), "GREY")
    with pytest.raises(ValueError, match="6 lines of GREY need 48 bytes, the buffer has 47"):
        luma(buffer[:-1], "GREY", 6, 8, bytes_per_line)


@pytest.mark.parametrize(
    ("fourcc", "bytes_per_line", "needed"),
    [
        ("GREY", 720, 414_720),
        ("NV12", 720, 622_080),
        ("YUYV", 1440, 829_440),
        ("UYVY", 1440, 829_440),
        ("GREY", 768, 576 * 768 - 48),
    ],
)
def test_a_whole_picture_includes_its_chroma_but_not_the_last_padding(fourcc, bytes_per_line, needed):
    assert needed_bytes(fourcc, 576, 720, bytes_per_line) == needed


def test_grey_is_preferred_and_what_has_to_be_thinned_out_comes_last():
    assert list(FORMATS) == ["GREY", "NV12", "YUYV", "UYVY", "MJPG", "JPEG"]
    assert RAW == ("GREY", "NV12", "YUYV", "UYVY")
    assert [bytes_per_pixel(fourcc) for fourcc in RAW] == [1, 1, 2, 2]
