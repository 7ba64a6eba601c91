"""The vacuum of an analysis from the capture's own channels: on the fields' clock, with the logger's σ."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from core.chain.milking import FAKE, grid, still, whole
from drivers.fake.iso_phases import iso_phases_s
from grabberd.errors import InputError
from grabberd_fake.vacuum import pulsation_kpa
from grabberd_liner.analysis.vacuum.light_clock import FoundLight, LightClock
from grabberd_liner.analysis.vacuum.vacuum import ChannelCurve
from grabberd_liner.chain.analysis.analyse import analyse
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.vacuum_inputs import read_vacuum

TIME_S = np.arange(100) * 0.02
BOTH = {"pulsation": "channel", "liner": "channel"}
ORIGIN = "channel pulsation of the logger tank, calibrated 2026-02-03"


def curve(name, kpa, time_s, **changes):
    about = {"sigma_kpa": 0.3, "time_sigma_s": 0.001, "origin": ORIGIN, **changes}
    return ChannelCurve(name, time_s, kpa, **about)


def channels(first_s=-0.25, last_s=2.25, step_s=0.005, **changes):
    time_s = np.arange(first_s, last_s, step_s)
    shown = pulsation_kpa(FAKE.ellipse, time_s)
    return {
        "pulsation": curve("pulsation", shown, time_s, **changes),
        "liner": curve("liner", np.full(len(time_s), 42.0), time_s),
    }


def vacuum(document, recorded=None, time_s=TIME_S, pulsation=None):
    return read_vacuum(document, pulsation, time_s, channels=channels() if recorded is None else recorded)


def refusal(document, recorded=None):
    with pytest.raises(InputError) as caught:
        vacuum(document, recorded).at(TIME_S)
    return f"{caught.value.message}; {caught.value.hint}"


def test_channels_need_neither_a_file_nor_an_offset_nor_a_lag() -> None:
    found = vacuum(BOTH)
    at = found.at(TIME_S)
    assert_allclose([one.pulsation_kpa for one in at], pulsation_kpa(FAKE.ellipse, TIME_S), atol=0.05)
    assert {one.liner_kpa for one in at} == {42.0}
    assert_allclose(found.phases.durations_s.value, iso_phases_s(FAKE.ellipse), atol=0.003)
    assert found.is_curve
    assert found.remarks == ()


def test_sigma_is_that_of_the_gauge_and_of_the_loggers_clock() -> None:
    found = vacuum(BOTH)
    assert found.time_sigma_s == 0.001
    assert_allclose([one.liner_sigma_kpa for one in found.at(TIME_S)], 0.3)


def test_the_gauge_sigma_of_the_inputs_goes_before_that_of_the_calibration() -> None:
    found = vacuum({**BOTH, "gauge_sigma_kpa": 0.8})
    assert_allclose([one.liner_sigma_kpa for one in found.at(TIME_S)], 0.8)


def test_an_offset_corrects_the_clock_and_adds_its_sigma() -> None:
    found = vacuum({**BOTH, "offset": {"s": 0.05, "sigma_s": 0.002}})
    told = [one.pulsation_kpa for one in found.at(TIME_S)]
    assert_allclose(told, pulsation_kpa(FAKE.ellipse, TIME_S - 0.05), atol=0.05)
    assert found.time_sigma_s == pytest.approx(np.hypot(0.001, 0.002))


def test_one_chamber_may_be_a_constant() -> None:
    found = vacuum({"pulsation": "channel", "liner": {"kpa": 40, "sigma_kpa": 0.5}})
    assert {one.liner_kpa for one in found.at(TIME_S)} == {40.0}


def test_times_of_arrival_are_remarked_upon_unless_they_are_corrected() -> None:
    late = channels(remark="dated by arrival")
    assert vacuum(BOTH, late).remarks == ("dated by arrival",)
    assert vacuum({**BOTH, "offset": {"s": 0.01, "sigma_s": 0.002}}, late).remarks == ()


@pytest.mark.parametrize("key", ["log", "lag"])
def test_a_log_or_a_lag_beside_channels_is_refused(key) -> None:
    assert f"vacuum.{key} is given beside a recorded channel" in refusal({**BOTH, key: "time_s"})


def test_a_channel_that_was_not_recorded_is_named_with_those_that_were() -> None:
    words = refusal(BOTH, {"pulsation": channels()["pulsation"]})
    assert "the capture's own channel liner" in words
    assert "its channels are: pulsation" in words


def test_a_gap_at_a_field_is_refused_and_not_filled() -> None:
    recorded = channels()
    whole = recorded["pulsation"]
    kept = (whole.time_s < 0.5) | (whole.time_s > 0.8)
    recorded["pulsation"] = curve("pulsation", whole.kpa[kept], whole.time_s[kept])
    assert "the recorded channel pulsation has a gap from 0.495 to 0.800 s" in refusal(BOTH, recorded)


def test_channels_that_end_before_the_fields_are_refused() -> None:
    assert "the recorded channel pulsation covers -0.25 to 1.00 s" in refusal(BOTH, channels(last_s=1.0))


def test_a_channel_that_nobody_asked_for_costs_the_pressure_and_not_the_shape() -> None:
    read = read_inputs({"vacuum": BOTH}, grid(), channels(last_s=0.01))
    with pytest.raises(InputError, match="covers"):
        analyse([still(3)], grid(), read)
    found = analyse([still(3)], grid(), replace(read, taken=frozenset(BOTH)))
    assert len(found.states) == 3
    assert any(words.startswith("no pressure: the recorded channel") for words in found.problems)


def test_numbers_in_another_unit_are_refused() -> None:
    recorded = channels()
    whole = recorded["pulsation"]
    recorded["pulsation"] = curve("pulsation", whole.kpa * 10, whole.time_s)
    assert "the recorded channel pulsation reaches 420" in refusal(BOTH, recorded)


def test_on_one_clock_the_walls_lag_is_a_result() -> None:
    found = vacuum(BOTH, pulsation=whole().cycle.pulsation)
    assert found.lag.opening_shift_s == pytest.approx(0.0334, abs=2e-3)
    assert found.lag.closing_shift_s == pytest.approx(0.0326, abs=2e-3)


BY_LIGHT = {**BOTH, "offset": "light"}


def light(offset_s=0.03, **changes):
    """A light that was seen so much later in the picture than its logger switched it."""
    clock = LightClock(offset_s, 1e-4, 1.0, 0.0, 0.0, 0.0, 300, 1.0, 0.0)
    return FoundLight(clock, 600.0, 24.0, **{"logger": "lamp", "delay_sigma_s": 2e-5, **changes})


def dated(found, **changes):
    recorded = channels(time_sigma_s=0.005, delay_sigma_s=0.004, **changes)
    return read_vacuum(BY_LIGHT, None, TIME_S, found, recorded)


def test_a_recorded_light_dates_the_channels_by_the_fields_themselves() -> None:
    told = [one.pulsation_kpa for one in dated(light()).at(TIME_S)]
    assert_allclose(told, pulsation_kpa(FAKE.ellipse, TIME_S - 0.03), atol=0.05)


def test_what_all_readings_of_a_logger_are_late_by_its_own_light_has_seen_as_well() -> None:
    assert dated(light(logger="tank"), logger="tank").time_sigma_s == pytest.approx(np.hypot(0.003, 1e-4))
    apart = dated(light(), logger="tank").time_sigma_s
    assert apart == pytest.approx(np.sqrt(0.005**2 + 2e-5**2 + 1e-4**2))


def test_captures_without_a_light_are_not_related_by_one() -> None:
    assert "lack a channel light" in refusal(BY_LIGHT)


def test_a_channel_without_vacuum_is_taken_as_it_is() -> None:
    """A liner at atmosphere: the unit of a channel is configured, and not guessed."""
    time_s = np.arange(-0.25, 2.25, 0.005)
    recorded = {name: curve(name, np.full(len(time_s), 0.1), time_s) for name in ("pulsation", "liner")}
    assert_allclose([one.difference_kpa for one in vacuum(BOTH, recorded).at(TIME_S)], 0.0, atol=1e-9)
