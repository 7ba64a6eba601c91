"""Units of a vacuum, told from the numbers that it reaches."""

import pytest

from grabberd.core.channels.vacuum import PRESSURE_UNITS, likely_unit


@pytest.mark.parametrize(
    ("unit", "kpa", "words"),
    [("mbar", 42, "mbar"), ("Pa", 42, "Pa"), ("mmHg", 42, "mmHg"), ("inHg", 42, "inHg"), ("bar", 42, "bar")],
)
def test_a_milking_machines_vacuum_in_another_unit_is_recognised(unit: str, kpa: float, words: str) -> None:
    assert words in likely_unit(kpa / PRESSURE_UNITS[unit])


def test_the_pressure_of_the_air_is_an_absolute_one() -> None:
    assert "absolute" in likely_unit(101.3)


def test_what_fits_nothing_is_said_so() -> None:
    assert "no unit" in likely_unit(1e7)
