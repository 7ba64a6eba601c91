"""Readings as bytes: what goes in comes out, bit for bit, and what is damaged is told."""

import numpy as np
import pytest

from grabberd.archive.capture.reading_groups import (
    MOST_READINGS,
    ChannelCalibration,
    decode_times,
    decode_values,
    encode_times,
    encode_values,
)


def test_times_come_back_to_the_nanosecond() -> None:
    rng = np.random.default_rng(0)
    for count in (1, 2, 500):
        time_ns = 7_000_000_000_000 + np.cumsum(rng.integers(1, 20_000_000, count))
        np.testing.assert_array_equal(decode_times(encode_times(time_ns), count), time_ns)


def test_values_come_back_bit_for_bit() -> None:
    value = np.array([0.0, -0.0, 42.1, 1e-300, -1e300, np.pi, 5e-324])
    assert decode_values(encode_values(value), len(value)).tobytes() == value.tobytes()


def test_even_steps_and_short_decimals_take_little_room() -> None:
    time_ns = 10**13 + np.arange(100) * 5_000_000
    value = np.round(40 + 2 * np.sin(np.arange(100) / 9), 1)
    assert len(encode_times(time_ns)) < 100
    assert len(encode_values(value)) < 8 * 100


@pytest.mark.parametrize("count", [0, -1, 99, 101, MOST_READINGS + 1, 2**40, 1.5, None, "100"])
def test_another_number_of_readings_is_refused(count) -> None:
    time_ns = 10**13 + np.arange(100) * 5_000_000
    with pytest.raises(ValueError, match=r"group of|bytes than"):
        decode_times(encode_times(time_ns), count)
    with pytest.raises(ValueError, match=r"group of|bytes than"):
        decode_values(encode_values(np.zeros(100)), count)


@pytest.mark.parametrize("times", [[5, 5], [9, 5], [-3, 5], [1, 2**62]])
def test_times_that_no_clock_can_have_shown_are_damage(times) -> None:
    with pytest.raises(ValueError, match="do not ascend"):
        decode_times(encode_times(np.array(times)), 2)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_damage(value) -> None:
    with pytest.raises(ValueError, match="not a number"):
        decode_values(encode_values(np.array([1.0, value])), 2)


def test_a_value_that_is_too_large_for_its_calibration_has_no_kpa() -> None:
    kpa = ChannelCalibration("mbar", -10.0, 0.0, 0.1).kpa(np.array([1e308, 2.0]))
    assert np.isnan(kpa[0])
    assert kpa[1] == -20.0
