"""Verdicts of checks: certain only where the value is two σ away from its limit."""

import math

import pytest

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.chain.guided_tests.outcome import Check, Question, worst

ASK = Question("length", "length of it", "cut it", "mm")


@pytest.mark.parametrize(
    ("value", "verdict"), [(0.7, "passed"), (0.9, "not certain"), (1.1, "not certain"), (1.3, "failed")]
)
def test_a_greatest_value_is_judged_by_two_sigma(value, verdict):
    check = ASK.at_most(Estimate.of(value, 0.1), 1.0)
    assert check.verdict == verdict
    assert check.limit == "at most 1 mm"
    assert (check.remedy == "cut it") == (verdict != "passed")
    assert bool(check.reason) == (verdict != "passed")


def test_a_least_value_is_judged_from_the_other_side():
    assert ASK.at_least(Estimate.of(1.3, 0.1), 1.0).verdict == "passed"
    assert ASK.at_least(Estimate.of(0.7, 0.1), 1.0).verdict == "failed"


@pytest.mark.parametrize(
    ("value", "verdict"), [(1.3, "passed"), (1.6, "not certain"), (1.9, "failed"), (0.1, "failed")]
)
def test_a_tolerance_holds_both_ways(value, verdict):
    assert ASK.within(Estimate.of(value, 0.1), 1.0, 0.6).verdict == verdict


@pytest.mark.parametrize(
    ("value", "verdict"), [(1.19, "passed"), (0.81, "passed"), (1.25, "not certain"), (1.31, "failed")]
)
def test_two_values_contradict_each_other_from_three_sigma_on(value, verdict):
    assert ASK.agrees(Estimate.of(value, 0.05), 1.0, 0.1).verdict == verdict


def test_what_was_not_found_is_not_checked():
    for check in (
        ASK.at_most(Estimate.of(math.nan, math.nan), 1.0),
        ASK.within(Estimate.of(math.nan, math.nan), 0.0, 1.0),
        ASK.agrees(Estimate.of(math.nan, math.nan), 0.0, 1.0),
    ):
        assert check.verdict == "not checked"
        assert check.reason


def test_the_worst_verdict_is_that_of_the_test_and_what_could_not_be_checked_does_not_count():
    checks = {
        verdict: Check("a", "a", verdict) for verdict in ("passed", "not checked", "not certain", "failed")
    }
    assert worst(checks.values()) == "failed"
    assert worst([checks["passed"], checks["not checked"], checks["not certain"]]) == "not certain"
    assert worst([checks["passed"], checks["not checked"]]) == "passed"
    assert worst([checks["not checked"]]) == "not checked"
