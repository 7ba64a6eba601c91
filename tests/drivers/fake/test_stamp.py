"""Field number and parity in the picture's corner."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.core.field import Field, double_lines, quantise, unpack
from grabberd_fake.stamp import COLUMNS, ROWS, Stamp, read_stamp, write_stamp

numbers = st.integers(0, 2**32 - 1)


def stamped(number: int, parity: int, background: int = 20) -> np.ndarray:
    luma = np.full((288, 720), background, np.uint8)
    write_stamp(luma, Stamp(number, parity))
    return luma


@given(numbers, st.integers(0, 1), st.integers(0, 255))
def test_what_was_stamped_is_read(number: int, parity: int, background: int) -> None:
    assert read_stamp(stamped(number, parity, background)) == (number, parity)


@given(numbers, st.integers(0, 1), st.sampled_from([1, 2, 4, 8]))
def test_it_is_read_from_thresholded_and_quantised_fields(number: int, parity: int, bits: int) -> None:
    field = Field.intact(stamped(number, parity), parity)
    assert read_stamp(unpack(quantise(field, bits, 100)).luma) == (number, parity)


@given(numbers, st.integers(0, 1))
def test_it_is_read_from_doubled_lines(number: int, parity: int) -> None:
    assert read_stamp(double_lines(Field.intact(stamped(number, parity), parity)).luma) == (number, parity)


def test_it_keeps_to_its_corner() -> None:
    assert (ROWS, COLUMNS) == (8, 160)
    luma = stamped(0xFFFFFFFF, 1, background=77)
    assert (luma[ROWS:] == 77).all()
    assert (luma[:, COLUMNS:] == 77).all()


def test_it_survives_noise() -> None:
    noisy = stamped(123456, 1).astype(int) + np.random.default_rng(0).integers(-60, 61, (288, 720))
    assert read_stamp(np.clip(noisy, 0, 255).astype(np.uint8)) == (123456, 1)


@pytest.mark.parametrize("grey", [0, 41, 255])
def test_a_picture_without_a_stamp_has_none(grey: int) -> None:
    assert read_stamp(np.full((288, 720), grey, np.uint8)) is None


def test_a_spoilt_stamp_is_not_believed() -> None:
    luma = stamped(5, 0)
    luma[:ROWS, 40:44] = 255 - luma[:ROWS, 40:44]
    assert read_stamp(luma) is None


def test_numbers_wrap_at_32_bits() -> None:
    assert read_stamp(stamped(2**32 + 7, 0)) == (7, 0)
