"""Results of a study in sentences."""

import re
from typing import Any

import pytest

from grabberd_liner.chain.study.study import Studied, StudyQuestion, make_study
from grabberd_liner.chain.study.study_document import study_document, tables
from grabberd_liner.studies.report import answer, trend_answer
from liner.chain.study.captured import COMPRESSION, capture, found, herd

QUESTION = StudyQuestion(by="liner", within="cow", over="milkings")
BY_LINER = StudyQuestion(by="liner")


def compression(captures: list[Studied], question: StudyQuestion = QUESTION) -> dict[str, Any]:
    study = make_study(question, captures)
    about = {"created_utc": "2026-11-02T00:00:00Z", "version": "1"}
    quantity: dict[str, Any] = study_document(study, tables(study), about)["quantities"][0]
    return quantity


def one_each(*values: float, sigma: float = 0.3) -> list[Studied]:
    return [capture(n, "ABC"[n], found={COMPRESSION: found(one, sigma)}) for n, one in enumerate(values)]


def test_groups_that_differ_are_named_with_by_how_much() -> None:
    quantity = compression(herd())
    assert quantity["verdict"] == "differ"
    assert answer(quantity).startswith("B is ")
    assert "kPa above" in answer(quantity)
    assert "p\u00a0<\u00a00.001" in answer(quantity)


def test_the_lesser_is_never_said_to_be_above() -> None:
    assert answer(compression(herd("AB", effects=(3.0, 0.0)))).startswith("A is 3.")


def test_without_a_difference_the_greatest_is_told() -> None:
    quantity = compression(herd(effects=(0.0, 0.0, 0.0)))
    assert quantity["verdict"] == "no difference shown"
    assert answer(quantity).startswith("At most, ")


def test_with_one_capture_a_group_sigma_alone_tells_and_nothing_is_tested() -> None:
    quantity = compression(one_each(40.0, 43.0), BY_LINER)
    assert quantity["verdict"] == "not tested"
    assert answer(quantity) == "B is 3.00 ± 0.42 kPa above A, by the captures' own σ alone."


def test_where_the_common_part_decides_it_is_told() -> None:
    captures = [
        capture(n, "AB"[n % 2], found={COMPRESSION: found(40.0 + 0.01 * n, 1.0, 0.99)}) for n in range(8)
    ]
    assert "σ is mostly common." in answer(compression(captures, BY_LINER))


def test_one_group_has_its_mean() -> None:
    captures = [capture(n, found={COMPRESSION: found(40.0 + n % 2)}) for n in range(4)]
    assert answer(compression(captures, StudyQuestion())) == "40.50 ± 0.29 kPa, mean of 4 captures."
    assert answer(compression(captures[:1], StudyQuestion())) == "40.00 ± 0.10 kPa, one capture."


@pytest.mark.parametrize(("slope", "verdict"), [(1.0, "changes"), (0.0, "no change shown")])
def test_a_trend_has_a_verdict_and_small_slopes_a_power_of_ten(slope: float, verdict: str) -> None:
    scatter = (0.1, -0.2, 0.15, -0.05, 0.02)
    captures = [capture(n, found={COMPRESSION: found(40.0 + slope * n + scatter[n], 0.01)}) for n in range(5)]
    quantity = compression(captures, StudyQuestion(over="milkings"))
    assert quantity["trend"]["verdict"] == verdict
    assert re.search("× 10⁻[³⁴] kPa per milking", trend_answer(quantity, "milking"))


def test_two_places_have_a_slope_and_no_test() -> None:
    quantity = compression(one_each(40.0, 43.0), StudyQuestion(over="milkings"))
    assert quantity["trend"]["verdict"] == "not tested"
    assert trend_answer(quantity, "milking") == (
        "0.0300 ± 0.0042 kPa per milking, by the captures' own σ alone."
    )


def test_one_place_has_no_trend() -> None:
    quantity = compression(one_each(40.0), StudyQuestion(over="milkings"))
    assert trend_answer(quantity, "milking") == "No group has captures at two different places."
