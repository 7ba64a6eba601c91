"""A pulsator by ISO 5707."""

import numpy as np
import pytest

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.phases import Phases, pulsator_limits, verdict


def phases(durations_s, sigma_s=0.001, defined_by="vacuum"):
    durations_s = np.array(durations_s)
    period_s = durations_s.sum()
    return Phases(
        Estimate(durations_s, np.full(4, sigma_s)),
        Estimate(np.asarray(period_s), np.asarray(sigma_s)),
        Estimate(np.asarray(durations_s[:2].sum() / period_s), np.asarray(sigma_s)),
        defined_by,
        np.full(4, np.nan),
        10,
    )


def test_a_usual_pulsator_meets_every_limit():
    found = pulsator_limits(phases([0.15, 0.45, 0.12, 0.28]))
    assert [one.verdict for one in found] == ["met"] * 3
    assert [one.value for one in found] == pytest.approx([0.45, 0.28, 0.28])


@pytest.mark.parametrize(
    ("durations_s", "verdicts"),
    [
        ([0.25, 0.25, 0.2, 0.3], ["not met", "met", "met"]),
        ([0.15, 0.6, 0.15, 0.1], ["met", "not met", "not met"]),
        ([0.1, 0.2, 0.06, 0.14], ["met", "met", "not met"]),
    ],
)
def test_too_short_a_phase_meets_its_limits_no_more(durations_s, verdicts):
    assert [one.verdict for one in pulsator_limits(phases(durations_s))] == verdicts


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.30, "not certain"),
        (0.319, "not certain"),
        (0.321, "met"),
        (0.281, "not certain"),
        (0.279, "not met"),
    ],
)
def test_within_two_sigma_of_the_limit_nothing_is_certain(value, expected):
    assert verdict(Estimate(np.asarray(value), np.asarray(0.01)), 0.30) == expected


def test_the_share_s_sigma_counts_phase_and_cycle_in_full():
    found = pulsator_limits(phases([0.15, 0.45, 0.12, 0.28], sigma_s=0.01))[0]
    assert found.sigma == pytest.approx(0.01 + 0.45 * 0.01)


@pytest.mark.parametrize("known", [None, phases([0.15, 0.45, 0.12, 0.28], defined_by="wall")])
def test_without_a_curve_of_the_vacuum_there_is_no_verdict(known):
    for one in pulsator_limits(known):
        assert np.isnan(one.value)
        assert not one.verdict
        assert "not known as a curve" in one.reason
