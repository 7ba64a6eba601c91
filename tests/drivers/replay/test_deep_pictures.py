"""Pictures of more than 8 bits: their upper 8, by one scale for the whole recording, and never clipped."""

import numpy as np
import pytest

from drivers.replay.pictures import luma, png
from drivers.replay.playing import play
from grabberd.errors import PictureError, StreamEnded
from grabberd_replay import ReplayGrabber

FULL = luma(1, 100, 64)
FULL[0, 0] = 255


def folder(path, *pictures):
    for number, one in enumerate(pictures):
        (path / f"p-{number}.png").write_bytes(png(one))
    return path


@pytest.mark.parametrize("bits", [10, 12, 14])
def test_bits_at_the_lower_end_are_found_and_named(tmp_path, bits):
    deep = (FULL.astype(np.uint16) << (bits - 8)) | 1
    info, played, end = play(folder(tmp_path, deep, deep // 2), rate_hz=60)
    assert isinstance(end, StreamEnded)
    np.testing.assert_array_equal(played[0].field.luma, FULL)
    np.testing.assert_array_equal(played[1].field.luma, deep // 2 >> (bits - 8))
    assert info.details["samples"] == f"the upper 8 of {bits} bits"
    assert f"{bits} of them are significant" in info.remarks[0]
    assert "'bits'" in info.remarks[0]


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_bits_at_the_upper_end_are_scaled_as_sixteen(tmp_path, bits):
    rng = np.random.default_rng(bits)
    deep = rng.integers(0, 1 << bits, (100, 64), np.uint16) << (16 - bits)
    info, played, _ = play(folder(tmp_path, deep), rate_hz=60)
    np.testing.assert_array_equal(played[0].field.luma, deep >> 8)
    assert (info.details["samples"], info.remarks) == ("the upper 8 of 16 bits", ())


def test_a_dark_picture_at_the_upper_end_is_not_made_bright(tmp_path):
    dark = (FULL // 8).astype(np.uint16) << 8
    np.testing.assert_array_equal(play(folder(tmp_path, dark), rate_hz=60)[1][0].field.luma, FULL // 8)


def test_a_brighter_picture_than_the_first_can_explain_ends_it_with_what_to_state(tmp_path):
    dim = FULL.astype(np.uint16) * 4 | 1
    bright = FULL.astype(np.uint16) * 16 | 1
    _, played, error = play(folder(tmp_path, dim, bright), rate_hz=60)
    assert isinstance(error, PictureError)
    assert "p-1.png has values up to 4081, expected at most 1023 of 10 bits" in error.message
    assert "give 'bits'" in error.hint
    assert len(played) == 1


def test_bits_that_are_stated_scale_dim_pictures_alike(tmp_path):
    dim, bright = FULL.astype(np.uint16) * 4 | 1, FULL.astype(np.uint16) * 16 | 1
    info, played, _ = play(folder(tmp_path, dim, bright), rate_hz=60, bits=12)
    np.testing.assert_array_equal(played[0].field.luma, FULL // 4)
    np.testing.assert_array_equal(played[1].field.luma, FULL)
    assert info.remarks == ()


def test_colours_of_sixteen_bits_become_luma(tmp_path):
    deep = np.repeat((FULL.astype(np.uint16) * 257)[..., None], 3, axis=2)
    info, played, _ = play(folder(tmp_path, deep), rate_hz=60)
    np.testing.assert_allclose(played[0].field.luma.astype(int), FULL, atol=1)
    assert "Rec. 601" in info.details["colours"]


def test_transparent_pixels_of_sixteen_bits_are_refused(tmp_path):
    deep = np.full((100, 64, 4), 65535, np.uint16)
    folder(tmp_path, deep)
    assert play(tmp_path, rate_hz=60)[1][0].field.luma.min() == 255
    deep[3, 4, 3] = 65534
    folder(tmp_path, deep)
    with pytest.raises(PictureError, match="1 transparent pixels"):
        ReplayGrabber(tmp_path, rate_hz=60).open()


def test_another_number_of_bits_is_refused(tmp_path):
    with pytest.raises(ValueError, match="bits is one of 8, 10, 12, 14, 16, not 11"):
        ReplayGrabber(tmp_path, bits=11)
