"""Readings as kPa below atmosphere, by each channel's calibration."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.core.channels import Anomaly, Dating, LoggerInfo, Quantity, Readings
from grabberd.core.channels.vacuum import IMPOSSIBLE, PRESSURE_UNITS, Channel, Reference, VacuumChannels
from grabberd.errors import InputError

INFO = LoggerInfo("fake", "bench", ("p1", "p2"), ("mbar", None), 100.0, Dating.MONOTONIC, 1000)


def channel(**changes) -> Channel:
    return Channel(
        **{"name": "pulsation", "quantity": Quantity.PULSATION, "column": "p1", "sigma_kpa": 0.3} | changes
    )


def readings(*values: float, anomalies: tuple[Anomaly, ...] = ()) -> Readings:
    time_ns = np.arange(len(values), dtype=np.int64) * 10_000_000 + 5_000_000_000
    return Readings(time_ns, np.array([[value, value] for value in values]), anomalies, 77)


def kpa(made: Channel, *values: float) -> list[float]:
    return VacuumChannels([made], INFO).vacuum(readings(*values)).kpa[:, 0].tolist()


def test_the_unit_that_the_logger_states_is_taken() -> None:
    assert kpa(channel(), 419.0) == pytest.approx([41.9])


def test_a_unit_is_given_where_the_logger_states_none() -> None:
    assert kpa(channel(column="p2", unit="mmHg"), 300.0) == pytest.approx([39.9966])


@given(st.sampled_from(sorted(PRESSURE_UNITS)), st.floats(1, 60))
def test_every_unit_of_pressure_is_turned_into_kpa(unit: str, wanted: float) -> None:
    value = wanted / PRESSURE_UNITS[unit]
    assert kpa(channel(column="p2", unit=unit), value) == pytest.approx([wanted])


def test_a_voltage_is_turned_by_its_gain_and_offset() -> None:
    assert kpa(channel(column="p2", unit="mV", gain=25.0, offset_kpa=-5.0), 1800.0) == pytest.approx([40.0])


def test_a_calibration_corrects_a_pressure_linearly() -> None:
    assert kpa(channel(gain=1.02, offset_kpa=-0.4), 400.0) == pytest.approx([40.4])


def test_gauge_pressure_is_negative_below_atmosphere() -> None:
    assert kpa(channel(reference=Reference.GAUGE), -400.0) == pytest.approx([40.0])


def test_absolute_pressure_is_taken_from_that_of_the_air() -> None:
    made = channel(reference=Reference.ABSOLUTE, atmosphere_kpa=98.5)
    assert kpa(made, 585.0) == pytest.approx([40.0])


def test_times_sigma_and_anomalies_pass_and_the_delay_is_taken_off() -> None:
    noticed = (Anomaly(1, "not a number", "x"),)
    found = VacuumChannels([channel()], INFO, delay_ns=3_000_000).vacuum(readings(400.0, anomalies=noticed))
    assert found.time_ns.tolist() == [4_997_000_000]
    assert (found.time_sigma_ns, found.anomalies) == (77, noticed)


def test_two_channels_may_share_a_column() -> None:
    both = VacuumChannels([channel(), channel(name="liner", quantity=Quantity.LINER)], INFO)
    assert both.vacuum(readings(400.0)).kpa.tolist() == [[40.0, 40.0]]
    assert both.sigma_kpa == (0.3, 0.3)


@pytest.mark.parametrize(
    ("value", "advice"),
    [(4190.0, "mbar"), (1013.0, "absolute pressure"), (-400.0, "gauge"), (90_000.0, "Pa")],
)
def test_an_impossible_vacuum_is_left_out_and_its_cause_guessed(value: float, advice: str) -> None:
    found = VacuumChannels([channel()], INFO).vacuum(readings(400.0, value, value, 410.0))
    assert np.isnan(found.kpa[:, 0]).tolist() == [False, True, True, False]
    (anomaly,) = found.anomalies
    assert (anomaly.reason, anomaly.lost) == (IMPOSSIBLE, 2)
    assert advice in anomaly.example


def test_a_channel_without_a_reading_stays_without() -> None:
    found = VacuumChannels([channel()], INFO).vacuum(readings(np.nan))
    assert np.isnan(found.kpa[0, 0])
    assert found.anomalies == ()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"column": "p9"}, "no column p9; it has p1, p2"),
        ({"column": "p2"}, "does not state the unit of p2"),
        ({"unit": "kPa"}, "states mbar for p1, the configuration kPa"),
        ({"column": "p2", "unit": "V"}, "need a gain, in kPa for each V"),
    ],
)
def test_a_channel_that_the_logger_cannot_measure_says_why(changes: dict, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        VacuumChannels([channel(**changes)], INFO)
    assert "grabberd logger" in caught.value.hint


def test_units_of_one_size_are_the_same() -> None:
    assert kpa(channel(unit="hPa"), 400.0) == pytest.approx([40.0])


def test_all_problems_are_named_at_once() -> None:
    with pytest.raises(InputError, match=r"p8.*p9"):
        VacuumChannels([channel(column="p8"), channel(name="liner", column="p9")], INFO)
