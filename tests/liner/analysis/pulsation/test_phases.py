"""ISO's phases by the vacuum, wall phases by the movement."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drivers.fake.iso_phases import iso_phases_s
from grabberd.errors import AnalysisError
from grabberd_fake.vacuum import vacuum_log
from grabberd_liner.analysis.pulsation.movement import first_movement
from grabberd_liner.analysis.pulsation.phases import LASER_MM, iso_phases, wall_phases
from grabberd_liner.analysis.pulsation.pulsation import fit_pulsation
from grabberd_liner.analysis.vacuum.vacuum_log import VacuumLog, read_vacuum_log
from liner.analysis.pulsating import FIELD_S, LINER, capture, liner, times


def log(seconds=8, noise_kpa=0.0, options=LINER, **more):
    return read_vacuum_log(
        "\n".join(vacuum_log(options, 0, round(seconds * 1e9), noise_kpa=noise_kpa, **more))
    )


def movement_phases(options, from_end_mm=None):
    """Wall phases of the exact movement, a field each millisecond."""
    period_s = liner(**options).period_s
    (movement,) = first_movement([capture(np.arange(0, period_s, 0.001), 1e-6, **options)])
    value = (movement.value_mm - movement.value_mm.min()) / np.ptp(movement.value_mm)
    share = 0.1 if from_end_mm is None else from_end_mm / np.ptp(movement.value_mm)
    passed = [np.interp(level, value[:300], movement.time_s[:300]) for level in (share, 1 - share)]
    passed += [np.interp(-level, -value[300:], movement.time_s[300:]) for level in (1 - share, share)]
    return np.diff([*passed, passed[0] + period_s])


def test_wall_phases_are_those_of_the_exact_movement() -> None:
    found = wall_phases(fit_pulsation(first_movement([capture(times(200), period_s=0.975)])))
    assert_allclose(found.durations_s.value, movement_phases({"period_s": 0.975}), atol=1e-3)
    assert found.durations_s.value.sum() == pytest.approx(found.period_s.value)
    assert found.ratio.value == pytest.approx(0.5991, abs=1e-3)
    assert (found.durations_s.sigma < 5e-4).all()
    assert (found.defined_by, found.cycles) == ("wall", 4)


@pytest.mark.parametrize("period_s", [0.96, 0.965, 0.99])
@pytest.mark.parametrize("closing", [0.02, 0.04, 0.09])
def test_a_wall_that_closes_within_one_to_five_fields_is_timed_within_its_sigma(closing, period_s) -> None:
    """Where a cycle is a whole number of fields, .96 s, no capture is long enough: σ has to say so."""
    options = {"period_s": period_s, "opening": 1.4 * closing, "closing": closing}
    found = wall_phases(fit_pulsation(first_movement([capture(times(140), **options)]))).durations_s
    error = found.value - movement_phases(options)
    assert (np.abs(error) < 2.5 * found.sigma).all()
    assert (found.sigma < 0.5 * FIELD_S).all()


def test_no_wall_phase_is_known_better_than_the_fields_fall_into_it() -> None:
    """A cycle of a whole number of fields shows the same phases over and over, however long the capture."""
    whole, between = (
        wall_phases(fit_pulsation(first_movement([capture(times(300), period_s=period_s)]))).durations_s.sigma
        for period_s in (1.0, 0.985)
    )
    assert (whole > 1e-3).all()
    assert (between < whole / 3).all()


def test_wall_phases_by_a_millimetre_are_those_of_the_exact_movement() -> None:
    found = wall_phases(fit_pulsation(first_movement([capture(times(200), period_s=0.975)])), LASER_MM)
    assert_allclose(found.durations_s.value, movement_phases({"period_s": 0.975}, LASER_MM), atol=1.5e-3)
    assert found.durations_s.value.sum() == pytest.approx(found.period_s.value)
    assert (found.durations_s.sigma < 1e-3).all()


@pytest.mark.parametrize("closing", [0.04, 0.09])
def test_sigma_of_the_times_by_a_millimetre_is_that_of_their_errors(closing) -> None:
    options = {"period_s": 0.975, "opening": 1.4 * closing, "closing": closing}
    true = movement_phases(options, LASER_MM)
    off = []
    for seed in range(12):
        movements = first_movement([capture(times(150), 0.05, seed=seed, **options)])
        found = wall_phases(fit_pulsation(movements), LASER_MM).durations_s
        off.append((found.value - true) / found.sigma)
    assert np.mean(np.square(off)) < 1.4


def test_a_stroke_of_two_millimetres_has_no_times_by_a_millimetre() -> None:
    pulsation = fit_pulsation(first_movement([capture(times(200))]))
    half_mm = float(pulsation.stroke_mm.value) / 2
    with pytest.raises(AnalysisError, match="leaves nothing between"):
        wall_phases(pulsation, half_mm)


@pytest.mark.slow
@pytest.mark.parametrize("threshold_mm", [None, LASER_MM])
def test_wall_phases_scatter_by_their_sigma(threshold_mm) -> None:
    found = [
        wall_phases(
            fit_pulsation(first_movement([capture(times(150), 0.08, seed=k, period_s=0.975)])), threshold_mm
        )
        for k in range(8)
    ]
    durations = np.array([one.durations_s.value for one in found])
    sigma = np.array([one.durations_s.sigma for one in found]).mean(axis=0)
    assert_allclose(durations.std(axis=0, ddof=1) / sigma, 1.0, atol=0.6)


def test_iso_phases_are_those_between_the_thresholds() -> None:
    found = iso_phases(log())
    assert_allclose(found.durations_s.value, iso_phases_s(LINER), atol=1e-4)
    assert found.ratio.value == pytest.approx(sum(iso_phases_s(LINER)[:2]), abs=1e-4)
    assert (found.defined_by, found.cycles) == ("vacuum", 6)


@pytest.mark.parametrize("noise_kpa", [0.05, 0.3])
def test_noise_of_the_logger_costs_less_than_a_millisecond(noise_kpa: float) -> None:
    found = iso_phases(log(noise_kpa=noise_kpa))
    assert_allclose(found.durations_s.value, iso_phases_s(LINER), atol=8e-4)
    assert (found.durations_s.sigma < 1e-3).all()


def test_a_slow_logger_does_too_but_knows_less() -> None:
    found = iso_phases(log(rate_hz=100))
    assert_allclose(found.durations_s.value, iso_phases_s(LINER), atol=3e-3)
    assert (found.durations_s.sigma > 1e-3).all()


def test_iso_phases_and_wall_phases_differ_because_the_wall_lags() -> None:
    iso = iso_phases(log()).durations_s.value
    wall = wall_phases(fit_pulsation(first_movement([capture(times(200))]))).durations_s.value
    assert np.abs(iso - wall).max() > 0.005


def test_cycles_with_a_gap_in_the_log_do_not_count() -> None:
    whole = log()
    keep = (whole.time_s < 3.2) | (whole.time_s > 3.3)
    found = iso_phases(VacuumLog(whole.time_s[keep], whole.pulsation_kpa[keep]))
    assert found.cycles == 5
    assert_allclose(found.durations_s.value, iso_phases_s(LINER), atol=1e-4)


def test_less_than_a_cycle_of_log_has_no_phases() -> None:
    with pytest.raises(AnalysisError, match="hold no whole cycle"):
        iso_phases(log(0.9))


def test_a_chamber_that_never_comes_to_atmosphere_has_no_phases() -> None:
    whole = log()
    with pytest.raises(AnalysisError, match="hold no whole cycle") as caught:
        iso_phases(VacuumLog(whole.time_s, 5 + 0.8 * whole.pulsation_kpa))
    assert "rise and fall" in caught.value.hint
