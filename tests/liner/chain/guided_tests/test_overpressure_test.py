"""The test of overpressure: two ways to it, their difference, and what lacks."""

import numpy as np
import pytest

from grabberd.core.chain.columns import make_table
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.chain.analysis.columns import TABLES
from grabberd_liner.chain.guided_tests.overpressure_test import overpressure_test
from liner.chain.guided_tests.evidence import by_name, evidence

LACKS = "milk_flow was not given"


def capture(**found):
    """A capture with overpressures: (value, σ, common part), or the reason why there is none."""
    names = [
        f"{what}_{way}_kpa" for what in ("overpressure", "flow_stop") for way in ("derived", "raised", "map")
    ]
    parts = [found.get(name.removesuffix("_kpa").rpartition("_")[2], LACKS) for name in names]
    known = [part if isinstance(part, tuple) else (np.nan, np.nan, np.nan) for part in parts]
    value, sigma, common = (np.array(column) for column in zip(*known, strict=True))
    words = np.array(["."] * len(names))
    rows = {
        "name": np.array(names),
        "title": np.array(names),
        "value": Estimate(value, sigma),
        "sigma_common": common,
        "unit": np.array(["kPa"] * len(names)),
        "verdict": np.array([""] * len(names)),
        "reason": np.array([part if isinstance(part, str) else "" for part in parts]),
        "definition": words,
        "source": words,
    }
    return evidence(tables={"quantities": make_table("quantities", TABLES["quantities"], rows)})


PULSATING = capture(derived=(9.0, 0.2, 0.1), raised="the chamber's vacuum pulsates")
RAISED = capture(derived="the chamber's vacuum does not pulsate", raised=(8.2, 0.3, 0.1))


def found_of(*captures):
    return {one.quantity.name: one for one in overpressure_test(captures).findings}


def test_two_ways_that_agree_pass_with_their_difference():
    outcome = overpressure_test([PULSATING, RAISED])
    assert {one.verdict for one in outcome.checks} == {"passed"}
    apart = found_of(PULSATING, RAISED)["overpressure_disagreement_kpa"]
    assert apart.value == pytest.approx(0.8)
    assert apart.sigma == pytest.approx(np.hypot(0.2, 0.3))
    assert "derived, less" in apart.quantity.definition
    assert "2.0 kPa" in by_name(outcome)["agreement"].limit or "2 kPa" in by_name(outcome)["agreement"].limit


def test_two_ways_that_differ_by_more_than_those_of_the_literature_fail():
    far = capture(raised=(4.0, 0.3, 0.1))
    check = by_name(overpressure_test([PULSATING, far]))["agreement"]
    assert check.verdict == "failed"
    assert "overpressure falls while a cow is milked" in check.remedy


def test_a_difference_near_the_limit_is_not_certain():
    near = capture(raised=(7.2, 0.3, 0.1))
    assert by_name(overpressure_test([PULSATING, near]))["agreement"].verdict == "not certain"


def test_repeated_captures_are_averaged_down_to_what_they_share():
    once, often = (found_of(*[PULSATING] * count)["overpressure_derived_kpa"] for count in (1, 4))
    assert (once.sigma, once.common) == (pytest.approx(0.2), pytest.approx(0.1))
    assert often.sigma == pytest.approx(np.sqrt(0.1**2 + (0.2**2 - 0.1**2) / 4))


def test_one_way_alone_says_what_the_other_lacks():
    checks = by_name(overpressure_test([PULSATING]))
    assert checks["derived"].verdict == "passed"
    assert checks["raised"].verdict == "failed"
    assert checks["raised"].reason == "the chamber's vacuum pulsates"
    assert checks["agreement"].verdict == "not checked"


def test_the_map_is_the_second_way_where_there_is_no_other():
    with_map = capture(derived=(9.0, 0.2, 0.1), map=(10.0, 1.0, 0.8))
    assert found_of(with_map)["overpressure_disagreement_kpa"].value == pytest.approx(-1.0)


def test_a_capture_that_was_not_analysed_says_why():
    failed = evidence(problem="it has no points")
    assert by_name(overpressure_test([failed]))["derived"].reason == "it has no points"
