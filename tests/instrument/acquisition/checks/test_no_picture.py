"""Pictures that a grabber makes up while no camera is there, and pictures that only look like it."""

import numpy as np
import pytest

from instrument.acquisition.pictures import camera, looked_at, noise

BARS = np.repeat(np.array([235, 210, 170, 145, 106, 81, 41, 16], np.uint8), 90)


def kinds(*lumas):
    return [content.no_picture for content in looked_at(lumas)]


@pytest.mark.parametrize("value", [0, 16, 41, 128])
def test_blue_and_black_are_a_flat_picture_from_the_first_field_on(value):
    assert kinds(*[np.full((288, 720), value, np.uint8)] * 2) == ["no signal: a flat picture"] * 2


def test_so_they_are_with_blanked_lines_at_top_and_bottom():
    blue = np.full((288, 720), 41, np.uint8)
    blue[:3] = blue[-2:] = 16
    assert kinds(blue) == ["no signal: a flat picture"]


def test_bars_are_known_by_rows_that_are_alike():
    assert kinds(np.tile(BARS, (288, 1))) == ["no signal: bars"]


def test_so_are_bars_that_lie():
    assert kinds(np.repeat(np.resize(BARS, 288)[:, np.newaxis], 720, axis=1)) == ["no signal: bars"]


@pytest.mark.parametrize("width", [1, 3])
def test_snow_is_known_by_contrast_that_no_row_shares_with_the_next(width):
    coarse = np.random.default_rng(width).integers(0, 256, (288, 720 // width), np.uint8)
    assert kinds(np.repeat(coarse, width, axis=1)) == ["no signal: snow"]


@pytest.mark.parametrize("low", [0, 10])
def test_a_dark_camera_is_a_camera(low):
    assert kinds(noise(1, low, low + 3), noise(2, low, low + 50)) == [None, None]


def test_a_few_rows_tell_nothing():
    assert kinds(np.full((8, 720), 41, np.uint8)) == [None]


def test_a_single_speck_is_of_a_camera():
    black = np.zeros((288, 720), np.uint8)
    black[100, 300] = 1
    assert kinds(black) == [None]


@pytest.mark.parametrize("scene", ["liner", "calibration_frame", "accuracy_object", "blank"])
@pytest.mark.parametrize("noise_share", [0.002, 0.02, 0.1])
def test_no_scene_is_taken_for_it(scene, noise_share):
    assert kinds(*camera(3, scene=scene, picture={"noise": noise_share})) == [None] * 3
