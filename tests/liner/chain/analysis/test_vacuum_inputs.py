"""The vacuum of an analysis: constants, a pulsator's settings or a logger's file, on the camera's clock."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from core.chain.milking import FAKE, PERIOD_S, log, whole
from drivers.fake.iso_phases import iso_phases_s
from grabberd.errors import GrabberdError, InputError
from grabberd_fake.vacuum import pulsation_kpa
from grabberd_liner.analysis.vacuum.light_clock import FoundLight, LightClock
from grabberd_liner.chain.analysis.vacuum_inputs import read_vacuum

TIME_S = np.arange(50) * 0.02
LOGGED = {"pulsation": "log", "liner": "log", "offset": {"s": -0.3, "sigma_s": 0.002}}
PHASES_S = iso_phases_s(FAKE.ellipse)
WAVE = {
    "rate_per_min": 60 / PERIOD_S,
    "ratio": sum(PHASES_S[:2]) / PERIOD_S,
    "a_s": PHASES_S[0],
    "c_s": PHASES_S[2],
    "system_kpa": 42.0,
    "sigma_kpa": 0.5,
}
LAG = {"opening_s": 0.0334, "closing_s": 0.0326, "sigma_s": 0.004, "near_s": 0.0}
"""Of the simulated liner: how its wall follows the chamber."""


def vacuum(document, pulsation=None, time_s=TIME_S):
    return read_vacuum(document, pulsation, time_s)


def refusal(document, **more):
    with pytest.raises(GrabberdError) as caught:
        vacuum(document, **more).at(TIME_S)
    return f"{caught.value.message}; {caught.value.hint}"


def test_constants_are_the_same_at_every_field() -> None:
    found = vacuum({"pulsation": {"kpa": 1, "sigma_kpa": 0.5}, "liner": {"kpa": 42, "sigma_kpa": 0.3}})
    assert found.phases is None
    for one in found.at(TIME_S):
        assert one[:4] == (1.0, 42.0, 0.5, 0.3)
        assert (one.pulsation_slope_kpa_per_s, one.time_sigma_s) == (0.0, 0.0)


def test_one_chamber_alone_is_no_vacuum() -> None:
    assert vacuum({"pulsation": {"kpa": 0, "sigma_kpa": 0.5}}) is None
    assert vacuum({}) is None


def test_a_logger_is_read_at_the_fields_times_by_its_offset() -> None:
    found = vacuum({**LOGGED, "log": log(1.6, start_s=-0.3)})
    at = found.at(TIME_S)
    assert_allclose([one.pulsation_kpa for one in at], pulsation_kpa(FAKE.ellipse, TIME_S), atol=0.01)
    assert {one.time_sigma_s for one in at} == {0.002}
    assert max(abs(one.pulsation_slope_kpa_per_s) for one in at) > 100
    assert_allclose(found.phases.durations_s.value, PHASES_S, atol=0.002)


def test_a_pulsators_settings_are_a_curve() -> None:
    rise_s = -FAKE.ellipse.vacuum.opening_lag * PERIOD_S
    begun_s = rise_s + 4 / 42 * FAKE.ellipse.vacuum.rising * PERIOD_S
    found = vacuum({"pulsation": {**WAVE, "start_s": begun_s}, "liner": {"kpa": 42, "sigma_kpa": 0.5}})
    told = [one.pulsation_kpa for one in found.at(TIME_S)]
    assert_allclose(told, pulsation_kpa(FAKE.ellipse, TIME_S), atol=0.5)
    assert_allclose(found.phases.durations_s.value, PHASES_S, atol=0.002)


def test_the_walls_lag_sets_the_clock_of_a_logger() -> None:
    document = {
        "pulsation": "log",
        "liner": "log",
        "lag": {**LAG, "near_s": 5.0},
        "log": log(2.4, -0.6, 5.6),
    }
    found = vacuum(document, whole().cycle.pulsation)
    assert found.offset is not None
    assert abs(found.offset.offset_s - 5.0) < 3 * found.time_sigma_s < 0.02


def test_the_walls_lag_sets_the_beginning_of_a_pulsators_wave() -> None:
    document = {"pulsation": WAVE, "liner": {"kpa": 42, "sigma_kpa": 0.5}, "lag": LAG}
    found = vacuum(document, whole().cycle.pulsation)
    resting = np.array([0.25, 0.52, 0.85])
    told = [one.pulsation_kpa for one in found.at(resting)]
    assert_allclose(told, pulsation_kpa(FAKE.ellipse, resting), atol=0.1)


LIGHT = LightClock(
    offset_s=-0.3,
    offset_sigma_s=0.0002,
    middle_s=0.5,
    drift=0.0,
    drift_sigma=0.0,
    asymmetry_s=0.0,
    edges=300,
    agreement=0.97,
    scatter_s=1e-4,
)
BY_LIGHT = {"pulsation": "log", "liner": "log", "offset": "light", "log": log(2.4, -0.6, -0.3)}


def test_a_light_relates_the_clocks_and_the_walls_lag_is_a_result() -> None:
    found = read_vacuum(BY_LIGHT, whole().cycle.pulsation, TIME_S, FoundLight(LIGHT, 330.0, 550.0))
    at = found.at(TIME_S)
    assert_allclose([one.pulsation_kpa for one in at], pulsation_kpa(FAKE.ellipse, TIME_S), atol=0.01)
    assert {one.time_sigma_s for one in at} == {0.0002}
    assert found.lag.opening_shift_s == pytest.approx(LAG["opening_s"], abs=2e-3)
    assert found.lag.closing_shift_s == pytest.approx(LAG["closing_s"], abs=2e-3)


def test_a_drift_stretches_the_loggers_clock_about_the_middle_of_the_capture() -> None:
    slow = FoundLight(LIGHT._replace(drift=0.01, drift_sigma=0.001), 330.0, 550.0)
    found = read_vacuum(BY_LIGHT, None, TIME_S, slow)
    own_s = TIME_S + 0.3 - 0.01 * (TIME_S - 0.5)
    told = [one.pulsation_kpa for one in found.at(TIME_S)]
    assert_allclose(told, pulsation_kpa(FAKE.ellipse, own_s - 0.3), atol=0.01)
    assert found.time_sigma_s > 0.0002
    assert found.lag is None


def test_a_logger_that_does_not_cover_the_capture_is_refused() -> None:
    assert "cover" in refusal({**LOGGED, "log": log(1.25, start_s=-0.3)})
    assert "cover" in refusal({**LOGGED, "offset": {"s": 0.5, "sigma_s": 0.002}, "log": log(1.6)})


@pytest.mark.parametrize(("factor", "unit"), [(10, "mbar"), (1000, "Pa"), (0.01, "bar")])
def test_a_logger_in_another_unit_is_refused_with_what_it_looks_like(factor: float, unit: str) -> None:
    head, *lines = log(1.6).splitlines()
    rows = [[float(part) for part in line.split(",")] for line in lines]
    text = "\n".join([head, *(f"{t},{a * factor},{b * factor}" for t, a, b in rows)])
    assert unit in refusal({**LOGGED, "log": text})


def test_a_logger_that_lacks_a_reading_is_refused_and_nothing_is_filled_in() -> None:
    lines = log(1.6).splitlines()
    lines[7] = lines[7].split(",")[0] + ",,42"
    assert "line 8" in refusal({**LOGGED, "log": "\n".join(lines)})


@pytest.mark.parametrize(
    ("document", "named"),
    [
        (LOGGED, "vacuum.log"),
        ({**LOGGED, "offset": {"s": 1}, "log": log(1.6)}, "sigma_s"),
        ({**LOGGED, "offset": "light", "log": log(1.6)}, "column light"),
        ({**LOGGED, "offset": "bright", "log": log(1.6)}, "vacuum.offset"),
        ({"pulsation": "log", "liner": "log", "log": log(1.6)}, "vacuum.offset or vacuum.lag"),
        ({"pulsation": "log", "liner": "log", "lag": LAG, "log": log(1.6)}, "pulsation in the capture"),
        ({"pulsation": 42, "liner": {"kpa": 42, "sigma_kpa": 1}}, "vacuum.pulsation"),
        ({"pulsation": {"kpa": 42}, "liner": {"kpa": 42, "sigma_kpa": 1}}, "sigma_kpa"),
        ({"pulsation": {"rate_per_min": 60}, "liner": {"kpa": 42, "sigma_kpa": 1}}, "system_kpa"),
    ],
)
def test_what_lacks_is_named(document: dict[str, object], named: str) -> None:
    assert named in refusal(document)


def test_a_logger_without_the_liners_vacuum_asks_for_it() -> None:
    text = "\n".join(line.rsplit(",", 1)[0] for line in log(1.6).splitlines())
    with pytest.raises(InputError, match=r"no column for vacuum\.liner"):
        vacuum({**LOGGED, "log": text})
