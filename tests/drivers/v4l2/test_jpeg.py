"""Compressed pictures: their luma, and what is said of those that are broken."""

import itertools

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grabberd_v4l2.formats import JpegLuma

LINES, COLUMNS = 96, 160


def scene(lines=LINES, columns=COLUMNS):
    """Bright discs on a dark ground with some noise."""
    picture = np.random.default_rng(5).normal(25, 3, (lines, columns)).clip(0, 255).astype(np.uint8)
    for x, y in itertools.product(range(12, columns, 24), range(12, lines, 24)):
        cv2.circle(picture, (x, y), 5, 220, -1, cv2.LINE_AA)
    return picture


def compressed(picture, quality=90, **more):
    flags = [cv2.IMWRITE_JPEG_QUALITY, quality, *more.get("flags", ())]
    coloured = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    return cv2.imencode(".jpg", coloured, flags)[1].ravel()


WHOLE = compressed(scene())


def decoder(lines=LINES, columns=COLUMNS):
    return JpegLuma(lines, columns)


def without_tables(data):
    """As many cameras send them: without the tables of Huffman's method, which are those of the standard."""
    text, at, kept = data.tobytes(), 2, data.tobytes()[:2]
    while text[at + 1] != 0xDA:
        end = at + 2 + int.from_bytes(text[at + 2 : at + 4], "big")
        kept += b"" if text[at + 1] == 0xC4 else text[at:end]
        at = end
    return np.frombuffer(kept + text[at:], np.uint8)


def test_the_luma_is_the_cameras_but_for_the_compression():
    luma, damage = decoder().decode(WHOLE)
    assert damage is None
    assert luma.shape == (LINES, COLUMNS)
    assert np.abs(luma.astype(int) - scene()).mean() < 3


def test_a_drivers_read_only_buffer_will_do():
    data = WHOLE.copy()
    data.flags.writeable = False
    assert decoder().decode(data)[1] is None


def test_pictures_without_tables_of_their_own_are_decoded():
    luma, damage = decoder().decode(without_tables(WHOLE))
    assert damage is None
    assert np.array_equal(luma, decoder().decode(WHOLE)[0])


def test_pictures_without_an_end_of_their_own_are_decoded():
    assert decoder().decode(WHOLE[:-2])[1] is None


def test_bytes_after_the_end_are_no_harm():
    assert decoder().decode(np.concatenate([WHOLE, np.zeros(700, np.uint8)]))[1] is None


@pytest.mark.parametrize("part", [0.5, 0.9])
def test_a_picture_that_breaks_off_is_damaged_and_keeps_what_came(part):
    luma, damage = decoder().decode(WHOLE[: int(part * WHOLE.size)])
    assert damage == "broken JPEG: data are missing"
    assert np.array_equal(luma[:16], decoder().decode(WHOLE)[0][:16])


def test_a_picture_that_lost_bytes_in_the_middle_is_damaged():
    middle = WHOLE.size // 2
    data = np.concatenate([WHOLE[:middle], WHOLE[middle + 600 :]])
    assert decoder().decode(data)[1] == "broken JPEG: data are missing"


@pytest.mark.parametrize("units", [5, 10, 23])
def test_bytes_lost_before_the_coding_begins_anew_are_noticed(units):
    """Many cameras restart it after every row of units, which then hides what is missing before."""
    whole = compressed(scene(), flags=[cv2.IMWRITE_JPEG_RST_INTERVAL, units])
    stream = decoder()
    assert stream.decode(whole)[1] is None
    for first in range(WHOLE.size // 4, WHOLE.size - 700, 300):
        damaged = np.concatenate([whole[:first], whole[first + 512 :]])
        assert stream.decode(damaged)[1] == "broken JPEG: data are missing"
        assert stream.decode(whole)[1] is None


def test_a_grey_scene_is_not_taken_for_missing_data():
    grey = np.full((LINES, COLUMNS), 128, np.uint8)
    grey[-16:] = 30
    stream = decoder()
    data = compressed(grey, flags=[cv2.IMWRITE_JPEG_RST_INTERVAL, 10])
    assert [stream.decode(data)[1] for _ in range(3)] == [None] * 3


def test_a_changed_bit_is_mostly_not_to_be_noticed():
    """The limit of what is known: the coding has no sum to check, and any bits mean something."""
    draw, stream = np.random.default_rng(1), decoder()
    good, _ = stream.decode(WHOLE)
    begin = WHOLE.tobytes().index(b"\xff\xda") + 14
    noticed, changed = 0, []
    for at in draw.integers(begin, WHOLE.size - 2, 200):
        spoilt = WHOLE.copy()
        spoilt[at] ^= 1 << draw.integers(8)
        luma, damage = stream.decode(spoilt)
        noticed += damage is not None
        changed.append((np.abs(luma.astype(int) - good) > 8).mean())
    assert noticed < 20
    assert np.mean(np.array(changed) > 0.05) > 0.2, "the rest of the picture is brighter, darker or displaced"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (WHOLE[:0], "it is empty"),
        (WHOLE[1:], "it does not begin like one"),
        (WHOLE[:60], "its header breaks off"),
        (np.zeros(500, np.uint8), "it does not begin like one"),
        (compressed(scene(48, 64)), "it has 64×48 pixels, not 160×96"),
    ],
)
def test_what_cannot_be_decoded_is_named_and_the_picture_before_stands_for_it(data, said):
    stream = decoder()
    good, _ = stream.decode(WHOLE)
    luma, damage = stream.decode(data)
    assert damage == f"broken JPEG: {said}"
    assert np.array_equal(luma, good)
    assert stream.decode(WHOLE)[1] is None


def test_a_picture_that_broke_off_stands_for_no_other():
    stream = decoder()
    good, _ = stream.decode(WHOLE)
    stream.decode(WHOLE[: WHOLE.size // 2])
    assert np.array_equal(stream.decode(WHOLE[:0])[0], good)


def test_before_the_first_picture_there_is_none_to_stand_for_a_broken_one():
    assert decoder().decode(WHOLE[:0])[0] is None


def test_a_header_that_claims_gigabytes_costs_none():
    at = WHOLE.tobytes().index(b"\xff\xc0") + 5
    data = WHOLE.copy()
    data[at : at + 4] = 255
    assert decoder().decode(data)[1] == "broken JPEG: it has 65535×65535 pixels, not 160×96"


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_nothing_that_is_spoilt_ends_the_stream(data):
    spoilt = WHOLE[: data.draw(st.integers(0, WHOLE.size))].copy()
    for _ in range(data.draw(st.integers(0, 8))):
        if spoilt.size:
            spoilt[data.draw(st.integers(0, spoilt.size - 1))] = data.draw(st.integers(0, 255))
    stream = decoder()
    stream.decode(WHOLE)
    luma, _ = stream.decode(spoilt)
    assert luma.shape == (LINES, COLUMNS)
    assert stream.decode(WHOLE)[1] is None
