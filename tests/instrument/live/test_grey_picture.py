"""A grey picture is sent with as much detail as a link carries, and what is clipped stays clipped."""

import zlib

import numpy as np
import pytest
from numpy.typing import NDArray

from grabberd.core.chain.light import CLIPPED_LEVEL
from grabberd.core.field import Field
from grabberd.instrument.live.preview import (
    BLACK,
    LADDER,
    NO_PICTURE,
    WHITE,
    Detail,
    Part,
    SentPicture,
    grey_picture,
)

WHOLE = Detail(1, 1)
BOTTOM = 1


def noise(rows: int = 288, columns: int = 720) -> Field:
    luma = np.random.default_rng(3).integers(2, 250, (rows, columns)).astype(np.uint8)
    return Field.intact(luma, BOTTOM)


def grey_of(sent: SentPicture) -> NDArray[np.uint8]:
    """What a client makes of it."""
    differences = np.frombuffer(zlib.decompress(sent.deflated), np.uint8).reshape(sent.rows, sent.columns)
    return np.cumsum(differences, axis=1, dtype=np.uint8)


def test_with_every_detail_the_picture_is_the_field() -> None:
    field = noise()
    sent = grey_picture(field, None, WHOLE)
    assert (grey_of(sent) == field.luma).all()
    assert sent[:6] == (720, 288, 0, 1, 1, 2)


@pytest.mark.parametrize("detail", LADDER)
def test_with_less_each_value_is_at_most_half_a_step_away(detail: Detail) -> None:
    field = noise()
    sent = grey_picture(field, None, detail)
    blocks = field.luma.reshape(sent.rows, detail.rows(field.y_step), sent.columns, detail.reduce).mean(
        axis=(1, 3)
    )
    assert np.abs(grey_of(sent) - blocks).max() <= detail.step / 2 + 1.5


def test_each_step_of_the_ladder_takes_less_of_the_link() -> None:
    dark = np.random.default_rng(3).normal(30, 3, (288, 720)).clip(0, 255).astype(np.uint8)
    sizes = [len(grey_picture(Field.intact(dark, 0), None, detail).deflated) for detail in LADDER]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-1] < sizes[0] / 10


@pytest.mark.parametrize("detail", [WHOLE, *LADDER])
def test_what_is_clipped_is_told_from_what_is_nearly(detail: Detail) -> None:
    luma = np.full((8, 16), 100, np.uint8)
    luma[:4, :8], luma[:4, 8:], luma[4:, :8] = CLIPPED_LEVEL, CLIPPED_LEVEL - 1, 1
    grey = grey_of(grey_picture(Field.intact(luma, 0), None, detail))
    high, wide = grey.shape[0] // 2, grey.shape[1] // 2
    assert (grey[:high, :wide] == WHITE).all()
    assert (grey[high:, :wide] == BLACK).all()
    rest = np.concatenate([grey[:high, wide:], grey[high:, wide:]])
    assert WHITE not in rest
    assert BLACK not in rest


def test_a_single_clipped_pixel_survives_being_reduced() -> None:
    luma = np.full((8, 16), 20, np.uint8)
    luma[3, 6] = 255
    grey = grey_of(grey_picture(Field.intact(luma, 0), None, Detail(1, 4)))
    assert grey.tolist() == [[20, 20, 20, 20], [20, WHITE, 20, 20], [20, 20, 20, 20], [20, 20, 20, 20]]


def test_a_part_has_its_place_in_the_frame() -> None:
    field = noise()
    sent = grey_picture(field, Part(80, 41, 64, 20), WHOLE)
    assert (sent.x0, sent.y0, sent.columns, sent.rows) == (80, 41, 64, 10)
    assert (grey_of(sent) == field.luma[20:30, 80:144]).all()


def test_a_reduced_row_lies_in_the_middle_of_its_rows() -> None:
    sent = grey_picture(noise(), Part(83, 43, 60, 40), Detail(1, 4))
    assert (sent.x0, sent.x_step) == (80, 4)
    # Rows 20 and 21 of the lower field are the frame lines 41 and 43.
    assert (sent.y0, sent.y_step) == (42, 4)


def test_a_part_outside_the_frame_is_no_picture() -> None:
    assert grey_picture(noise(), Part(4000, 4000, 10, 10), WHOLE) == NO_PICTURE


def test_a_progressive_picture_is_reduced_alike_both_ways() -> None:
    luma = noise().luma
    sent = grey_picture(Field.progressive(luma), None, Detail(1, 2))
    assert (sent.columns, sent.rows, sent.x_step, sent.y_step) == (360, 144, 2, 2)
