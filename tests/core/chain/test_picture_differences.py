"""Where no discs are seen, as before a moved hand, differences of the pictures tell the order of fields."""

import cv2
import numpy as np
import pytest

from grabberd.core.chain.field_order import check
from grabberd.core.field import BOTTOM, TOP, Field
from grabberd.core.reconstruction.field_order import Order

FIELDS = 200


def shade(time: float) -> np.ndarray:
    """A frame of a large dim shape that is moved, rests, and is moved back; nothing in it is a disc."""
    share = np.interp(time % 50, [5, 15, 30, 40], [0.0, 1.0, 1.0, 0.0])
    at = 12.0 * (0.5 - 0.5 * np.cos(np.pi * share))
    y, x = np.mgrid[0:288, 0:360].astype(np.float32)
    return 90 + 30 * np.sin((x - at) / 9) + 30 * np.sin((y - at / 2) / 11 + x / 40)


@pytest.fixture(scope="module")
def fields() -> list[Field]:
    """Fields of its movement in the order of time, top first, with noise of 2 grey levels."""
    random = np.random.default_rng(1)
    made = []
    for n in range(FIELDS):
        luma = shade(n)[n % 2 :: 2]
        luma = np.clip(luma + random.normal(0, 2, luma.shape), 0, 255)
        made.append(Field.intact(cv2.GaussianBlur(luma, (0, 0), 0.5).astype(np.uint8), n % 2))
    return made


def exchanged(fields: list[Field]) -> list[Field]:
    """Of each frame the newer field first."""
    return [field for pair in zip(fields[1::2], fields[::2], strict=True) for field in pair]


def test_fields_as_the_camera_takes_them_are_right(fields):
    finding = check(fields)
    assert finding.order is Order.RIGHT
    assert abs(finding.top_to_bottom.value - finding.bottom_to_top.value) < 0.5


def test_fields_that_change_places_within_their_frames_are_reversed(fields):
    finding = check(exchanged(fields))
    assert finding.order is Order.REVERSED
    assert finding.top_to_bottom.value > 5 * finding.bottom_to_top.value
    assert check(exchanged(fields)[1:]).order is Order.REVERSED


def test_a_field_that_is_made_of_the_other_is_of_the_same_instant(fields):
    made = []
    for top in fields[::2]:
        below = np.vstack((top.luma[1:], top.luma[-1:]))
        made += [top, Field.intact(cv2.addWeighted(top.luma, 0.5, below, 0.5, 0), BOTTOM)]
    assert check(made).order is Order.SAME_INSTANT


def test_lost_fields_and_gaps_are_passed_over(fields):
    lost = [field for n, field in enumerate(fields) if n % 23]
    assert check(lost).order is Order.RIGHT
    assert check([*fields[:90], None, *fields[101:]]).order is Order.RIGHT


def test_where_nothing_moves_nothing_is_said(fields):
    random = np.random.default_rng(2)
    still = [
        Field.intact(
            np.clip(shade(0)[parity::2] + random.normal(0, 2, (144, 360)), 0, 255).astype(np.uint8), parity
        )
        for parity in (TOP, BOTTOM) * 50
    ]
    finding = check(still)
    assert finding.order is Order.NO_MOVEMENT
    assert finding.top_to_bottom is None
