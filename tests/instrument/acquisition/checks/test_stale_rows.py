"""Old rows that a device delivers as new ones."""

import cv2
import numpy as np
import pytest

from instrument.acquisition.pictures import camera, damages, noise

ENOUGH = 20
"""Fields after which it is known how much they differ."""


@pytest.fixture(scope="module")
def liner():
    return camera(80)


def with_rows_of(lumas, n, old, rows):
    spoiled = lumas.copy()
    spoiled[n, rows] = lumas[old, rows]
    return list(spoiled[: n + 1])


def test_a_field_that_equals_the_one_of_its_parity_before_is_repeated():
    fields = [noise(1), noise(2), noise(1), noise(2), noise(3)]
    assert damages(fields) == [None, None, "repeated", "repeated", None]


def test_so_is_one_that_equals_the_field_just_before_although_its_parity_is_another():
    assert damages([noise(1), noise(1), noise(1)]) == [None, "repeated", "repeated"]


def test_a_picture_that_never_changes_stays_repeated(liner):
    assert damages([liner[0]] * 100)[1:] == ["repeated"] * 99


@pytest.mark.parametrize("fields_ago", [1, 2, 16, 64])
def test_rows_that_a_buffer_kept_are_stale_however_deep_the_queue_is(liner, fields_ago):
    n = 70
    fields = with_rows_of(liner, n, n - fields_ago, slice(200, None))
    assert damages(fields)[-2:] == [None, "stale from line 400"]


def test_a_band_is_named_by_its_first_and_last_line(liner):
    fields = with_rows_of(liner, ENOUGH + 1, ENOUGH - 1, slice(100, 110))
    assert damages(fields)[-1] == "stale from line 201 to line 219"


def test_one_row_is_enough_where_there_is_noise(liner):
    assert damages(with_rows_of(liner, ENOUGH, 2, slice(287, None)))[-1] == "stale from line 574"


def test_a_part_is_not_called_stale_before_it_is_known_how_much_fields_differ(liner):
    assert damages(with_rows_of(liner, 4, 2, slice(200, None)))[-1] is None


def test_a_black_picture_tells_nothing():
    black = np.zeros((288, 720), np.uint8)
    assert damages([black, black, black]) == [None] * 3


@pytest.mark.parametrize("noise_share", [0.02, 0.01, 0.005])
@pytest.mark.parametrize("sigmas", [0, 1, 2, 3, 4])
def test_clipped_black_is_never_called_stale(noise_share, sigmas):
    fields = camera(40, scene="accuracy_object", picture={"noise": noise_share, "jitter_px": 0})
    clip = round(20 + sigmas * noise_share * 190)
    assert damages([cv2.subtract(field, clip) for field in fields]) == [None] * len(fields)


def test_the_light_going_out_leaves_nothing_stale(liner):
    dark = np.zeros((288, 720), np.uint8)
    dark[140:150, 300:310] = 200
    assert damages([*liner[:ENOUGH], dark, dark, liner[21]]) == [None] * (ENOUGH + 3)


def test_a_half_of_the_picture_that_turns_black_for_good_is_not_stale(liner):
    half = liner[ENOUGH : ENOUGH + 10].copy()
    half[:, 150:] = 0
    assert damages([*liner[:ENOUGH], *half]) == [None] * (ENOUGH + 10)
