"""Marks on the grey field: their centres, and what is not taken for one."""

import cv2
import numpy as np
import pytest

from grabberd.core.field import Field, double_lines, split_frame
from grabberd.core.measurement.marks import MarkLocator

FINE = 16
PLACES = [(40.0, 60.0), (330.0, 520.0), (690.0, 44.0)]


def drawn(places, diameter_px=6.0, contrast=180.0, background=25.0):
    """A frame with blurred discs, drawn by OpenCV sixteen times finer than its pixels."""
    frame = np.zeros((576, 720))
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    for place in places:
        corner = np.floor(place).astype(int) - 16
        rim = np.array(place) + diameter_px / 2 * np.column_stack([np.cos(angle), np.sin(angle)])
        fine = np.zeros((32 * FINE, 32 * FINE), np.float32)
        points = ((rim - corner + 0.5) * FINE - 0.5) * 16
        cv2.fillPoly(fine, [np.rint(points).astype(np.int32)], 1.0, shift=4)
        soft = cv2.GaussianBlur(fine, (0, 0), 0.75 * FINE).reshape(32, FINE, 32, FINE).mean(axis=(1, 3))
        frame[corner[1] :, corner[0] :][:32, :32] += soft
    return np.clip(np.rint(background + contrast * frame), 0, 255).astype(np.uint8)


def test_the_mean_of_both_parities_is_the_centre_wherever_it_lies_between_the_pixels():
    rng, off = np.random.default_rng(5), []
    for _ in range(12):
        places = np.array(PLACES) + rng.uniform(-4, 4, 2)
        fields = split_frame(drawn(places))
        off.append(np.mean([MarkLocator(PLACES).locate(one)[:, :2] for one in fields], axis=0) - places)
    assert np.sqrt(np.mean(np.square(off), axis=(0, 1))).max() < 0.012


def test_a_progressive_picture_and_a_doubled_field_are_located_too():
    frame = drawn(PLACES)
    for field in (Field.progressive(frame), double_lines(split_frame(frame)[0])):
        assert np.abs(MarkLocator(PLACES).locate(field)[:, :2] - PLACES).max() < 0.03


def test_its_area_is_that_of_the_disc_whatever_the_light():
    bright, dim = (MarkLocator(PLACES).locate(split_frame(drawn(PLACES, contrast=c))[0]) for c in (180, 60))
    assert bright[:, 2] == pytest.approx(dim[:, 2], rel=0.02)


def test_it_averages_as_noise_does():
    rng, frame, located = np.random.default_rng(1), drawn(PLACES), []
    for _ in range(64):
        noisy = np.clip(np.rint(frame + rng.normal(0, 3.6, frame.shape)), 0, 255).astype(np.uint8)
        located += [MarkLocator(PLACES).locate(one)[:, :2] for one in split_frame(noisy)]
    means = np.reshape(located, (8, 16, 3, 2)).mean(axis=1)
    assert means.std(axis=0).max() < 2.0 * np.std(located, axis=0).max() / 4.0


def unseen(frame):
    located = MarkLocator(PLACES).locate(split_frame(frame)[0])
    return np.isnan(located).all(axis=1).tolist()


def test_a_mark_that_is_dark_or_cut_off_or_has_a_bright_neighbour_is_not_seen():
    assert unseen(drawn(PLACES[:1])) == [False, True, True]
    assert unseen(drawn([PLACES[0], (330.0 + 11, 520.0), PLACES[2]])) == [False, True, False]
    frame = drawn(PLACES)
    frame[40:90, 700:] = 200
    assert unseen(frame) == [False, False, True]


def test_a_picture_of_two_levels_has_no_marks():
    frame = np.where(drawn(PLACES) > 100, 255, 0).astype(np.uint8)
    assert unseen(frame) == [True, True, True]


def test_a_place_at_the_edge_of_the_picture_has_a_window_inside():
    located = MarkLocator([(3.0, 2.0), (719.0, 575.0)]).locate(split_frame(drawn([(9.0 + 16, 25.0)]))[0])
    assert located.shape == (2, 3)
