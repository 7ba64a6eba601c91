"""The pressure difference at flow stop: of chambers whose course and flow stop are known in closed form."""

import numpy as np
import pytest

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.vacuum.milk_flow import (
    DifferenceCurve,
    FlowCurve,
    derived_flow_stop,
    raised_flow_stop,
)

LINER_KPA, STOP_KPA, TOP_KPA = 42.0, 34.0, 42.0
OVER_KPA = LINER_KPA - STOP_KPA
RISING_S, OPEN_S, FALLING_S = 0.12, 0.48, 0.10
FLOW_S = OPEN_S + STOP_KPA / TOP_KPA * (RISING_S + FALLING_S)
"""How long a trapezoid from 0 to 42 kPa has more than 8 kPa, a difference of less than 34."""


def chamber_kpa(time_s, starts_s):
    """A trapezoid that begins to rise at each of these times."""
    since = time_s - starts_s[np.clip(np.searchsorted(starts_s, time_s, side="right") - 1, 0, None)]
    ends = np.cumsum([0.0, RISING_S, OPEN_S, FALLING_S])
    return np.interp(since, ends, [0.0, TOP_KPA, TOP_KPA, 0.0])


def pulsating(
    seed=0,
    *,
    rate_hz=1000.0,
    noise_kpa=0.0,
    flow_noise=0.0,
    delay_s=0.08,
    jitter_s=0.004,
    seconds=20.0,
    stop_kpa=STOP_KPA,
    slow_s=(0.0, 0.0),
    gauge_kpa=0.0,
):
    """Readings of a pulsating chamber and of the milk, which comes to the sensor later.

    Args:
        jitter_s: σ of the length of a cycle.
        slow_s: for how long the sensor rises, and falls.
        gauge_kpa: error of the gauges' zero.
    """
    rng = np.random.default_rng(seed)
    period_s = rng.uniform(0.95, 1.05)
    starts_s = np.cumsum(np.r_[-3.3, rng.normal(period_s, jitter_s, int(seconds) + 8)])
    time_s = rng.uniform(0, 1 / rate_hz) + np.arange(int(seconds * rate_hz)) / rate_hz
    chamber = chamber_kpa(time_s, starts_s)
    level = sensed(time_s - delay_s, starts_s, stop_kpa, slow_s)
    noisy = chamber + rng.normal(0, noise_kpa, len(time_s)) + gauge_kpa
    difference = LINER_KPA - chamber - gauge_kpa + rng.normal(0, noise_kpa, len(time_s))
    curve = DifferenceCurve(time_s, noisy, difference, noise_kpa, abs(gauge_kpa))
    return curve, FlowCurve(time_s, 1.0 + 3.0 * level + rng.normal(0, flow_noise, len(time_s)))


def sensed(time_s, starts_s, stop_kpa, slow_s):
    """The flow from 0 to 1, of a sensor that rises and falls in straight lines round each passage."""
    begins_s = starts_s + (LINER_KPA - stop_kpa) / TOP_KPA * RISING_S
    ends_s = starts_s + RISING_S + OPEN_S + stop_kpa / TOP_KPA * FALLING_S
    rising, falling = (max(one, 1e-9) for one in slow_s)
    at = np.clip(np.searchsorted(begins_s - rising / 2, time_s, side="right") - 1, 0, None)
    up = np.clip((time_s - begins_s[at]) / rising + 0.5, 0, 1)
    down = np.clip((time_s - ends_s[at]) / falling + 0.5, 0, 1)
    return up - down


def raised(seed=0, rate_kpa_per_s=0.4, noise_kpa=0.1, delay_s=0.0, times=1, opens_kpa=0.0, rate_hz=200.0):
    """Readings of a chamber whose vacuum is raised from rest to 12 kPa, once or several times.

    Args:
        opens_kpa: range of the difference over which the flow comes to its full.
    """
    rng = np.random.default_rng(seed)
    time_s = np.arange(int(40 * times * rate_hz)) / rate_hz
    rises_s = 12.0 / rate_kpa_per_s

    def chamber(at_s):
        return np.interp(np.mod(at_s, 40.0), [0, 5, 5 + rises_s, 39, 40], [0, 0, 12, 12, 0])

    below = STOP_KPA - (LINER_KPA - chamber(time_s - delay_s))
    flow = np.clip(below / opens_kpa, 0, 1) if opens_kpa else (below > 0).astype(float)
    kpa = chamber(time_s)
    noise = rng.normal(0, noise_kpa, (2, len(time_s)))
    return (
        DifferenceCurve(time_s, kpa + noise[0], LINER_KPA - kpa + noise[1], noise_kpa),
        FlowCurve(time_s, flow + rng.normal(0, 0.01, len(time_s))),
    )


def chi_squared(found, truth_kpa=OVER_KPA):
    off = [(float(one.value) - truth_kpa) / float(one.sigma) for one in found]
    return float(np.mean(np.square(off)))


def test_a_known_flow_stop_gives_exactly_that_overpressure():
    curve, flow = pulsating(rate_hz=2000.0, slow_s=(0.02, 0.02), jitter_s=0.0)
    found = derived_flow_stop(curve, flow)
    assert found.difference_kpa.value == pytest.approx(STOP_KPA, abs=1e-3)
    assert found.overpressure_kpa.value == pytest.approx(OVER_KPA, abs=1e-3)
    assert found.duration_s.value == pytest.approx(FLOW_S, abs=1e-5)


@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.25])
def test_the_milk_s_way_to_the_sensor_changes_nothing(delay_s):
    found = derived_flow_stop(*pulsating(slow_s=(0.02, 0.02), delay_s=delay_s))
    assert found.overpressure_kpa.value == pytest.approx(OVER_KPA, abs=0.02)


def test_the_zero_of_the_gauges_cancels():
    exact, off = (derived_flow_stop(*pulsating(slow_s=(0.02, 0.02), gauge_kpa=one)) for one in (0.0, 1.0))
    assert off.overpressure_kpa.value == pytest.approx(exact.overpressure_kpa.value, abs=0.02)
    assert off.difference_kpa.value == pytest.approx(exact.difference_kpa.value - 1.0, abs=0.02)
    assert off.common_kpa == pytest.approx(1.0 * OVER_KPA / LINER_KPA, rel=0.05)


@pytest.mark.parametrize(
    "readings",
    [
        {"rate_hz": 200.0, "noise_kpa": 0.1, "flow_noise": 0.02},
        {"rate_hz": 100.0, "noise_kpa": 0.1, "flow_noise": 0.02},
        {"noise_kpa": 0.1, "flow_noise": 0.02},
        {"rate_hz": 200.0, "noise_kpa": 0.3, "flow_noise": 0.1, "slow_s": (0.04, 0.04)},
        {"rate_hz": 200.0, "noise_kpa": 0.1, "seconds": 6.0},
    ],
    ids=["200 Hz", "100 Hz", "1000 Hz", "slow and noisy", "six seconds"],
)
def test_sigma_of_the_derived_overpressure_is_that_of_its_errors(readings):
    # Readings round a duration to their step, each duration in its own way.
    stops_kpa = np.random.default_rng(7).uniform(30, 38, 200)
    over_kpa = [
        derived_flow_stop(*pulsating(seed, stop_kpa=stop, **readings)).overpressure_kpa
        for seed, stop in enumerate(stops_kpa)
    ]
    off = [
        one._replace(value=one.value - LINER_KPA + stop)
        for one, stop in zip(over_kpa, stops_kpa, strict=True)
    ]
    assert 0.7 < chi_squared(off, 0.0) < 1.4


def test_a_pulsator_in_step_with_the_logger_is_not_averaged_into_certainty():
    """All cycles have their readings at the same phases, so twenty of them know no more than one."""
    time_s = np.arange(4000) / 200.0
    starts_s = np.arange(-3.0, 30.0) + 0.3123
    kpa = chamber_kpa(time_s, starts_s)
    flow = FlowCurve(time_s, sensed(time_s, starts_s, STOP_KPA, (0.0, 0.0)))
    found = derived_flow_stop(DifferenceCurve(time_s, kpa, LINER_KPA - kpa), flow).overpressure_kpa
    assert float(found.sigma) > 0.3
    assert abs(float(found.value) - OVER_KPA) < 2.5 * float(found.sigma)


def test_a_sensor_that_falls_more_slowly_than_it_rises_is_trusted_less():
    even, uneven = (
        derived_flow_stop(*pulsating(slow_s=slow_s)).overpressure_kpa
        for slow_s in ((0.04, 0.04), (0.0, 0.08))
    )
    assert float(uneven.sigma) > 5 * float(even.sigma)
    assert abs(float(uneven.value) - OVER_KPA) < 2 * float(uneven.sigma)


def test_cycles_with_a_gap_in_their_readings_do_not_count():
    curve, flow = pulsating(slow_s=(0.02, 0.02))
    keep = (curve.time_s < 5.0) | (curve.time_s > 5.3)
    shorter = DifferenceCurve(*(part[keep] for part in curve[:3]), *curve[3:])
    whole, cut = derived_flow_stop(curve, flow), derived_flow_stop(shorter, flow)
    assert cut.averaged in (whole.averaged - 1, whole.averaged - 2)
    assert cut.overpressure_kpa.value == pytest.approx(OVER_KPA, abs=0.02)


def test_a_flow_that_stops_on_neither_flank_has_no_overpressure():
    curve, _ = pulsating()
    always = pulsating(stop_kpa=LINER_KPA - 0.1)[1]
    with pytest.raises(AnalysisError, match="it stops on neither of them"):
        derived_flow_stop(curve, always)


def test_the_wrong_sense_of_the_sensor_is_noticed():
    curve, flow = pulsating(slow_s=(0.02, 0.02))
    with pytest.raises(AnalysisError, match="stops on neither") as caught:
        derived_flow_stop(curve, flow._replace(level=-flow.level))
    assert "which reading means that it flows" in caught.value.hint


@pytest.mark.parametrize("level", [0.0, np.random.default_rng(0).normal(0, 1, 20_000)], ids=["dead", "noise"])
def test_a_sensor_that_shows_no_flow_is_refused(level):
    curve, flow = pulsating()
    with pytest.raises(AnalysisError, match=r"all the time|cannot be told from noise"):
        derived_flow_stop(curve, flow._replace(level=level + np.zeros(len(flow.level))))


def test_a_flow_that_comes_in_drips_is_refused():
    curve, flow = pulsating(rate_hz=200.0)
    dripping = flow.level * (np.sin(2 * np.pi * 6 * flow.time_s) > 0)
    with pytest.raises(AnalysisError, match="begins and ends once in"):
        derived_flow_stop(curve, flow._replace(level=dripping))


def test_raising_the_vacuum_until_milk_flows_gives_the_same_overpressure():
    found = raised_flow_stop(*raised(noise_kpa=0.0))
    assert found.difference_kpa.value == pytest.approx(STOP_KPA, abs=0.01)
    assert found.overpressure_kpa.value == pytest.approx(OVER_KPA, abs=0.01)
    assert found.duration_s is None


def test_sigma_of_the_raised_overpressure_is_that_of_the_milk_s_way_and_of_noise():
    ways_s = np.abs(np.random.default_rng(1).normal(0, 0.2, 200))
    found = [
        raised_flow_stop(*raised(seed, delay_s=way, noise_kpa=0.03)).overpressure_kpa
        for seed, way in enumerate(ways_s)
    ]
    assert 0.7 < chi_squared(found) < 1.4


def test_a_flow_that_opens_gradually_starts_where_the_first_milk_comes():
    found = raised_flow_stop(*raised(opens_kpa=2.0)).overpressure_kpa
    assert abs(float(found.value) - OVER_KPA) < 2.0 * float(found.sigma)
    assert float(found.sigma) < 0.5


def test_several_starts_are_averaged():
    found = raised_flow_stop(*raised(times=3))
    assert found.averaged == 3
    assert found.overpressure_kpa.value == pytest.approx(OVER_KPA, abs=0.2)


def test_a_vacuum_that_is_raised_too_fast_gives_none():
    with pytest.raises(
        AnalysisError, match="never while the chamber's vacuum rises from rest by less than 2 kPa/s"
    ):
        raised_flow_stop(*raised(rate_kpa_per_s=4.0))


def test_a_flow_before_the_vacuum_is_raised_is_no_start():
    curve, flow = raised()
    at_rest = flow._replace(level=np.where((curve.time_s > 2) & (curve.time_s < 4), 1.0, 0.0))
    with pytest.raises(AnalysisError, match="milk starts to flow 1 time"):
        raised_flow_stop(curve, at_rest)


def test_each_way_refuses_the_other_s_capture():
    with pytest.raises(AnalysisError, match="pulsates instead of being raised"):
        raised_flow_stop(*pulsating())
    with pytest.raises(AnalysisError, match="does not pulsate"):
        derived_flow_stop(*raised())
