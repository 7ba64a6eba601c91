"""Liner compression above the liner's gas and above atmosphere, load and massage: of made-up loads, and of a
solved wall.
"""

import numpy as np
import pytest

from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.liner_truth import closed_liner_quantities
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.liner_compression import (
    AT_END_SHARE,
    BEYOND_FLOW_STOP,
    COMPRESSION_SHARE,
    QUANTITIES,
    above_atmosphere,
    liner_compression,
)
from grabberd_liner.analysis.load.load_profile import Noise
from grabberd_liner.analysis.pulsation.phases import Phases
from liner.analysis.load.profiles import DIFFERENCES_KPA, TEAT_END_MM, X_MM, closed, solved_profiles

PHASE = np.arange(20) / 20
WALL = Phases(
    Estimate(np.array([0.1, 0.5, 0.1, 0.3]), np.full(4, 0.002)),
    Estimate(np.asarray(1.0), np.asarray(0.001)),
    Estimate(np.asarray(0.6), np.asarray(0.002)),
    "wall",
    np.full(4, np.nan),
    8,
)
FLOW_STOP = Estimate(np.asarray(9.0), np.asarray(1.0))
LINER = Estimate(np.full(20, 40.0), np.full(20, 0.3))
TEAT = X_MM <= TEAT_END_MM
END_MM = TEAT_END_MM + 5.0 * (11.6 - 1.3) / (11.6 - 0.1)
"""Where the walls come to meet, as `test_closed_liner` has it."""


def cycle(closing):
    """Profiles of a cycle: open up to phase .7, then closed by those given."""
    return [closed(pressed=False)] * 14 + list(closing)


def found_of(profiles, flow_stop=FLOW_STOP, liner_kpa=LINER):
    found = liner_compression(PHASE, profiles, WALL, flow_stop, liner_kpa=liner_kpa)
    return {finding.quantity.name: finding for finding in found.findings}


@pytest.fixture(scope="module")
def even():
    return found_of(cycle([closed()] * 6))


def test_every_quantity_is_found_with_sigma(even):
    assert list(even) == list(QUANTITIES)
    for finding in even.values():
        assert np.isfinite(finding.value), finding
        assert finding.sigma > 0, finding
        assert not finding.reason


def test_compression_is_the_mean_over_the_teat_and_not_over_walls_that_meet(even):
    profile = closed()
    fine_mm = np.linspace(X_MM[0], END_MM, 100_000)
    true = profile.compression_kpa.value[np.abs(X_MM - fine_mm[:, np.newaxis]).argmin(axis=1)].mean()
    assert even["liner_compression_mean_kpa"].value == pytest.approx(true, rel=1e-4)


def test_the_greatest_compression_has_its_height(even):
    true = closed().compression_kpa.value[TEAT].max()
    assert even["liner_compression_greatest_kpa"].value == pytest.approx(true)
    assert even["liner_compression_greatest_x_mm"].value == TEAT_END_MM


def test_compression_at_the_teat_s_end_is_that_of_its_last_centimetre(even):
    fine_mm = np.linspace(END_MM - 10.0, END_MM, 100_000)
    last = closed().compression_kpa.value[np.abs(X_MM - fine_mm[:, np.newaxis]).argmin(axis=1)]
    assert even["liner_compression_teat_end_kpa"].value == pytest.approx(last.mean(), rel=1e-4)
    assert even["teat_end_x_mm"].value == pytest.approx(END_MM)


def test_the_force_on_a_side_is_the_sum_over_the_teat(even):
    profile = closed()
    assert even["teat_load_n"].value == pytest.approx(
        profile.load_n_per_mm.value @ profile.spans_within(X_MM[0], END_MM)
    )
    assert even["teat_load_peak_n_per_mm"].value == pytest.approx(profile.load_n_per_mm.value[TEAT].max())


def test_what_is_not_noise_of_the_points_is_common_to_captures(even):
    assert even["teat_load_n"].common == even["teat_load_n"].sigma
    assert even["massage_time_s"].common == 0
    noise = noise_of(load=0.25 * closed().load_n_per_mm.covariance)
    split = found_of(cycle([closed()._replace(noise=noise)] * 6))["teat_load_n"]
    spans_mm = closed().spans_within(X_MM[0], END_MM)
    own = 0.5 * closed().load_n_per_mm.summed(spans_mm).sigma
    assert split.sigma == pytest.approx(even["teat_load_n"].sigma)
    assert np.hypot(split.common, own) == pytest.approx(split.sigma)


def test_noise_in_where_the_teat_ends_is_part_of_each_capture_s_own_sigma():
    """The compression falls by 14 kPa at the last height of the teat, and the gap is known to .5 mm."""
    sure, unsure = (
        found_of(cycle([closed()._replace(noise=noise_of(gap=sigma_mm**2 * np.eye(len(X_MM))))] * 6))
        for sigma_mm in (1e-6, 0.5)
    )
    for name in ("liner_compression_teat_end_kpa", "teat_load_n"):
        own = np.sqrt(unsure[name].sigma ** 2 - unsure[name].common ** 2)
        assert own > 0.01 * unsure[name].sigma
        assert sure[name].sigma == pytest.approx(sure[name].common)
        assert unsure[name].common == pytest.approx(sure[name].common)


def noise_of(load=0.0, gap=0.0):
    """Noise of the load and of the gap alone."""
    count = len(X_MM)
    own = np.zeros((3 * count, 3 * count))
    own[count : 2 * count, count : 2 * count] = load
    own[2 * count :, 2 * count :] = gap
    return Noise(own, 0 * own)


def test_the_pressure_that_stops_the_flow_is_common_to_captures_that_are_given_it():
    exact, vague = (
        found_of(cycle([closed()] * 6), FLOW_STOP._replace(sigma=np.asarray(sigma)))[BEYOND_FLOW_STOP]
        for sigma in (0.0, 3.0)
    )
    assert vague.common == pytest.approx(np.hypot(exact.common, 3.0))


def test_massage_lasts_for_wall_phase_d(even):
    assert even["massage_time_s"].value == 0.3
    assert even["massage_time_s"].sigma == 0.002


def test_pressure_beyond_flow_stop_is_that_at_full_closure_less_what_stops_the_flow():
    uneven = found_of(cycle([closed(scale) for scale in (0.8, 1.0, 1.2, 1.2, 1.0, 0.8)]))
    end_kpa = 1.2 * uneven["liner_compression_teat_end_kpa"].value
    assert uneven[BEYOND_FLOW_STOP].value == pytest.approx(end_kpa - 9.0)
    assert uneven[BEYOND_FLOW_STOP].sigma > FLOW_STOP.sigma


COMPRESSIONS = (
    "liner_compression_mean_kpa",
    "liner_compression_greatest_kpa",
    "liner_compression_teat_end_kpa",
)


@pytest.mark.parametrize("name", COMPRESSIONS)
def test_a_compression_above_atmosphere_is_less_by_the_liner_s_vacuum(even, name):
    gauge, above = even[name], even[above_atmosphere(name)]
    assert above.value == pytest.approx(gauge.value - 40.0)
    assert above.sigma == pytest.approx(np.hypot(gauge.sigma, 0.3))
    assert above.common == pytest.approx(np.hypot(gauge.common, 0.3))
    assert "above atmosphere" in above.quantity.title
    assert "above the gas" in gauge.quantity.definition


@pytest.mark.parametrize("liner_kpa", [20.0, 42.0])
def test_a_snug_mandrel_shows_nothing_above_atmosphere(liner_kpa):
    """It is pressed by the pressure difference alone, which in phase d is the liner's vacuum."""
    mandrel = closed()
    at_rest = mandrel.compression_kpa._replace(value=np.where(TEAT, liner_kpa, 0.0))
    vacuum = Estimate(np.full(20, liner_kpa), np.full(20, 0.3))
    found = found_of(cycle([mandrel._replace(compression_kpa=at_rest)] * 6), liner_kpa=vacuum)
    name, of_last_height = "liner_compression_mean_kpa", 2.0  # which is half on the teat
    assert found[name].value == pytest.approx(liner_kpa, abs=of_last_height)
    assert found[above_atmosphere(name)].value == pytest.approx(found[name].value - liner_kpa)
    assert found[above_atmosphere(name)].value == pytest.approx(0.0, abs=of_last_height)


def test_without_the_liner_s_vacuum_nothing_is_known_above_atmosphere():
    found = found_of(cycle([closed()] * 6), liner_kpa=None)
    assert found["liner_compression_mean_kpa"].value > 0
    reasons = {found[above_atmosphere(name)].reason for name in COMPRESSIONS}
    assert reasons == {"the vacuum in the liner is not known"}


def test_sigma_is_never_less_than_the_model_s_share(even):
    mean = even["liner_compression_mean_kpa"]
    assert mean.sigma > COMPRESSION_SHARE * mean.value


def test_without_the_pressure_that_stops_the_flow_there_is_none_beyond_it():
    found = found_of(cycle([closed()] * 6), flow_stop=None)
    assert np.isnan(found[BEYOND_FLOW_STOP].value)
    assert "flow_stop was not given" in found[BEYOND_FLOW_STOP].reason


def test_without_the_teat_s_end_only_what_needs_it_is_missing():
    found = found_of(cycle([closed(below=False)] * 6))
    missing = {name for name, one in found.items() if one.reason}
    at_end = "liner_compression_teat_end_kpa"
    assert missing == {at_end, above_atmosphere(at_end), "teat_end_x_mm", BEYOND_FLOW_STOP}
    assert "nowhere do opposite walls meet" in found[BEYOND_FLOW_STOP].reason


def test_without_a_teat_every_pressure_says_so():
    found = found_of(cycle([closed(empty=True)] * 6))
    assert "there is no teat" in found["teat_load_n"].reason
    assert found["massage_time_s"].value == 0.3


def test_without_loads_in_phase_d_every_pressure_says_so():
    found = found_of([closed(pressed=False)] * 14 + [None] * 6)
    assert found["teat_load_n"].reason == "no load is known at any of the 6 phases within wall phase d"


def test_without_phases_in_phase_d_every_pressure_says_so():
    found = liner_compression(np.array([0.1, 0.5]), [closed(), closed()], WALL, None)
    assert "none of the 2 phases of the mean cycle lies within wall phase d" in found.findings[0].reason


def test_sigma_of_the_mean_is_that_of_errors_that_are_drawn():
    rng = np.random.default_rng(1)
    profile = closed()
    root = np.linalg.cholesky(profile.compression_kpa.covariance + 1e-9 * np.eye(len(X_MM)))
    drawn = []
    for _ in range(200):
        off = profile.compression_kpa.value + root @ rng.normal(size=len(X_MM))
        noisy = profile._replace(compression_kpa=profile.compression_kpa._replace(value=off))
        drawn.append(found_of(cycle([noisy] * 6)))
    for name in ("liner_compression_mean_kpa", "liner_compression_teat_end_kpa", BEYOND_FLOW_STOP):
        values = np.array([one[name].value for one in drawn])
        # The σ of the model, of what stops the flow, and of the end's height are in it but were not drawn.
        end_mm = drawn[0]["teat_end_x_mm"]
        limits_kpa = np.interp([end_mm.value - 10, end_mm.value], X_MM, profile.compression_kpa.value)
        end = 0.0 if name == "liner_compression_mean_kpa" else np.diff(limits_kpa)[0] / 10 * end_mm.sigma
        stop = FLOW_STOP if name == BEYOND_FLOW_STOP else Estimate(0.0, 0.0)
        share = COMPRESSION_SHARE if name == "liner_compression_mean_kpa" else AT_END_SHARE
        model = share * (drawn[0][name].value + stop.value)
        sigma = np.sqrt(drawn[0][name].sigma ** 2 - model**2 - stop.sigma**2 - end**2)
        assert 0.7 < values.var() / sigma**2 < 1.4


@pytest.mark.parametrize("wall", ["reference-round", "reference-pointed", "reference-blunt"])
def test_a_wall_solved_as_a_solid_has_its_teat_s_end_load_and_compression_found(wall):
    liner_kpa = LINER._replace(value=np.full(20, LinerOptions(wall).wave.liner_kpa))
    found = found_of(cycle([solved_profiles(wall)[-1]] * 6), liner_kpa=liner_kpa)
    true = closed_liner_quantities(LinerOptions(wall), [DIFFERENCES_KPA[-1]])
    for name, true_value in true.items():
        if name in found:
            assert abs(found[name].value - true_value) < 3 * found[name].sigma, name
    assert found["teat_load_n"].value == pytest.approx(true["teat_load_n"], rel=0.15)
    assert found["teat_load_peak_n_per_mm"].value == pytest.approx(true["teat_load_peak_n_per_mm"], rel=0.15)
    assert found["teat_end_x_mm"].value == pytest.approx(true["teat_end_x_mm"], abs=0.6)
