"""The vacuum at the fields' times: constants, a pulsator's settings, a log on the camera's clock."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from grabberd.errors import InputError
from grabberd_fake.vacuum import pulsation_kpa, vacuum_log
from grabberd_liner.analysis.pulsation.phases import iso_phases
from grabberd_liner.analysis.vacuum.vacuum import ConstantVacuum, LoggedVacuum, PulsatorWave
from grabberd_liner.analysis.vacuum.vacuum_log import read_vacuum_log
from liner.analysis.pulsating import LINER

WAVE = PulsatorWave(60.0, 0.6, 0.12, 0.1, 42.0, 0.5)


def logged(offset_s=0.0, sigma_s=0.0, noise_kpa=0.0, seconds=5):
    log = read_vacuum_log("\n".join(vacuum_log(LINER, 0, round(seconds * 1e9), offset_s, noise_kpa)))
    return LoggedVacuum(log, log.pulsation_kpa, offset_s, sigma_s)


def test_a_constant_is_constant() -> None:
    found = ConstantVacuum(42.0, 0.5).at(np.arange(3.0))
    assert (found.value.tolist(), found.sigma.tolist()) == ([42.0] * 3, [0.5] * 3)


def test_a_constant_of_another_unit_is_refused() -> None:
    with pytest.raises(InputError, match="420 kPa"):
        ConstantVacuum(420.0, 1.0)


@given(
    st.floats(45, 75), st.floats(0.5, 0.72), st.floats(0.06, 0.15), st.floats(0.05, 0.12), st.floats(30, 55)
)
def test_a_pulsators_wave_has_the_phases_it_was_set_to(
    rate: float, ratio: float, a_s: float, c_s: float, kpa: float
) -> None:
    wave = PulsatorWave(rate, ratio, a_s, c_s, kpa, 0.5, start_s=0.37)
    found = iso_phases(wave.log(0.0, 6.0))
    period_s = 60 / rate
    wanted = [a_s, ratio * period_s - a_s, c_s, (1 - ratio) * period_s - c_s]
    assert_allclose(found.durations_s.value, wanted, atol=2e-3)
    assert wave.kpa(np.array([0.37])) == pytest.approx(4.0)


def test_sigma_of_a_wave_grows_on_its_slopes() -> None:
    found = PulsatorWave(60.0, 0.6, 0.12, 0.1, 42.0, 0.5, 0.0, 0.002).at(np.array([0.06, 0.3, 0.9]))
    assert found.sigma[0] == pytest.approx(34 / 0.12 * 0.002, rel=0.2)
    assert found.sigma[1:] == pytest.approx([0.5, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"rate_per_min": 6.0}, "rate_per_min 6"),
        ({"rate_per_min": 0.0}, "rate_per_min 0"),
        ({"rate_per_min": -60.0}, "rate_per_min -60"),
        ({"ratio": 60.0}, "60:40 is .6"),
        ({"a_s": 0.0}, "must be longer than 0"),
        ({"system_kpa": 420.0}, "system_kpa 420"),
        ({"c_s": 0.39}, "no room"),
    ],
)
def test_settings_of_no_pulsator_are_refused(change: dict[str, float], said: str) -> None:
    settings = {"rate_per_min": 60.0, "ratio": 0.6, "a_s": 0.12, "c_s": 0.1, "system_kpa": 42.0}
    with pytest.raises(InputError, match=said):
        PulsatorWave(**{**settings, **change}, sigma_kpa=0.5)


def test_a_log_is_read_on_the_cameras_clock() -> None:
    at_s = np.arange(50) * 0.02 + 1.003
    found = logged(offset_s=0.37).at(at_s)
    assert_allclose(found.value, pulsation_kpa(LINER, at_s), atol=0.25)


def test_sigma_of_a_log_is_its_noise_and_on_slopes_the_offsets() -> None:
    at_s = np.array([1.3, 1.62, 1.9])
    found = logged(sigma_s=0.002, noise_kpa=0.2).at(at_s)
    assert found.sigma[[0, 2]] == pytest.approx(0.2, abs=0.12)
    assert found.sigma[1] == pytest.approx(np.hypot(420 * 0.002, 0.2), rel=0.15)


def test_errors_of_the_vacuum_lie_within_its_sigma() -> None:
    at_s = 1 + np.arange(100) * 0.02
    source = logged(offset_s=0.5, sigma_s=0.003, noise_kpa=0.2)
    late = LoggedVacuum(source.log, source.kpa, 0.503, 0.003)
    found = late.at(at_s)
    assert np.sqrt((((found.value - pulsation_kpa(LINER, at_s)) / found.sigma) ** 2).mean()) < 1.3


def test_a_log_that_does_not_cover_the_fields_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"covers 0.00 to 5.00 s .* 50 of 100 fields have no vacuum"
    ) as caught:
        logged().at(4.01 + np.arange(100) * 0.02)
    assert "whole capture" in caught.value.hint


def test_a_gap_of_the_log_is_not_filled() -> None:
    source = logged()
    keep = (source.log.time_s < 2.0) | (source.log.time_s > 2.1)
    log = type(source.log)(source.log.time_s[keep], source.log.pulsation_kpa[keep])
    cut = LoggedVacuum(log, log.pulsation_kpa, 0.0, 0.0)
    assert len(log.gaps_s) == 1
    with pytest.raises(InputError, match=r"a gap from 1.999 to 2.101 s .* 5 fields"):
        cut.at(np.arange(100) * 0.02 + 1.001)
    cut.at(np.array([1.0, 3.0]))
