"""Rows that lie too far left or right from some row of the field on."""

import re

import cv2
import numpy as np
import pytest

from grabberd.instrument.acquisition.content_check import ContentCheck
from instrument.acquisition.pictures import AS_IT_IS, camera, damages, grabbed, without_a_packet

TARGETS = slice(60, 240)
"""First rows with targets above them and below."""


@pytest.fixture(scope="module")
def liner():
    return camera(30)


def told(damage):
    """Columns and line, or None."""
    found = re.match(r"shifted by (-?\d+) px from line (\d+)", damage or "")
    return (int(found[1]), int(found[2])) if found else None


def found(fields, n, row, columns):
    return told(damages([*fields[:n], without_a_packet(fields[n], row, columns)])[n])


@pytest.mark.parametrize("n", [12, 25])
@pytest.mark.parametrize("row", [60, 144, 240])
@pytest.mark.parametrize("columns", [8, 13, 26, 40, 100, 345, 360, 374, 500, 700])
def test_lost_data_are_found_by_how_many_and_from_where(liner, n, row, columns):
    shift = found(liner, n, row, columns)
    assert shift
    assert abs((shift[0] + columns + 360) % 720 - 360) <= 1
    assert abs((shift[1] - n % 2) / 2 - row) <= 10, "the lines between two rows of targets tell nothing"


@pytest.mark.parametrize("scene", ["calibration_frame", "accuracy_object"])
@pytest.mark.parametrize("noise", [0.005, 0.05])
def test_so_are_they_before_objects_that_stand_still(scene, noise):
    fields = camera(6, scene=scene, picture={"noise": noise})
    assert found(fields, 5, 144, 40) is not None
    assert found(fields, 5, 144, 8) is not None


def test_the_first_shifted_line_is_exact_where_a_target_is_cut():
    fields = camera(6, scene="calibration_frame", picture={"noise": 0.005})
    bright = np.flatnonzero((fields[5] > 120).any(axis=1))
    row = int(bright[bright > 130][1])
    assert found(fields, 5, row, 40)[1] == 2 * row + 1


@pytest.mark.parametrize(
    "options",
    [
        {"liner": {"period_s": 0.5}},
        {"scene": "blank"},
        {"scene": "blank", "picture": {"noise": 0.1}},
        {"picture": {"noise": 0.1}},
        {"picture": {"exposure_ms": 20, "uneven_light": 0.5}},
        {"rig": {"reflections": 1}, "picture": {"agc_level": 40, "agc_fields": 2}},
    ],
)
def test_what_moves_or_is_noisy_is_not_shifted(options):
    assert damages(camera(60, **options)) == [None] * 60


def test_neither_is_what_is_lit_otherwise_from_field_to_field(liner):
    fields = [
        cv2.convertScaleAbs(luma, alpha=(1.0, 0.5, 0.1, 1.3)[n // 3 % 4]) for n, luma in enumerate(liner)
    ]
    assert damages(fields) == [None] * len(liner)


def test_neither_is_a_whole_picture_that_is_pushed_aside(liner):
    pushed = [np.roll(luma, 15 * max(0, n - 20), axis=1) for n, luma in enumerate(liner)]
    assert damages(pushed) == [None] * len(liner)


def test_after_a_gap_there_is_nothing_to_compare_with(liner):
    check = ContentCheck()
    check.take(grabbed(liner[0], 0), AS_IT_IS)
    late = grabbed(without_a_packet(liner[1], 144, 40), 1)
    assert check.take(late._replace(time_ns=late.time_ns + 100_000_000), AS_IT_IS)[0].damage is None


def test_neither_is_a_counter_that_runs_in_every_line():
    """Squares of four pixels: of one number, those of the next may lie two to the side."""
    noise = np.random.default_rng(1).integers(24, 32, (288, 720), np.uint8)
    fields = [np.roll(noise, 7 * n, axis=0) for n in range(400)]
    for n, field in enumerate(fields):
        field[:, :64] = np.repeat([235 if n >> bit & 1 else 16 for bit in range(15, -1, -1)], 4)
    assert damages(fields) == [None] * len(fields)
