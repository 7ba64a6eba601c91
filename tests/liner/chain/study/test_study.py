"""A study of captures: which take part, what is compared, what is left out and why."""

import numpy as np
import pytest
from scipy import stats

from grabberd.errors import InputError
from grabberd_liner.chain.study.study import LeftOut, Study, StudyQuestion, make_study, natural
from liner.chain.study.captured import COMPRESSION, OPENING, TOUCH, capture, found, herd, missing

BY_LINER = StudyQuestion(by="liner")


def values_of(study: Study, liner: str, name: str = COMPRESSION) -> list[float]:
    return [one.found[name].value for one in study.captures if one.labels["liner"] == liner]


def test_groups_of_captures_are_compared_quantity_by_quantity() -> None:
    study = make_study(BY_LINER, herd())
    assert study.groups == ("A", "B", "C")
    assert [one.name for one in study.quantities] == [COMPRESSION, OPENING]
    difference = study.quantities[0].comparison.differences[0]
    assert difference.found.value == pytest.approx(
        np.mean(values_of(study, "B")) - np.mean(values_of(study, "A"))
    )


def test_within_cows_it_is_the_paired_test_and_the_liners_common_parts_add_to_it() -> None:
    captures = herd("AB")
    exact = [one._replace(found={COMPRESSION: found(one.found[COMPRESSION].value, 0.0)}) for one in captures]
    paired = make_study(BY_LINER._replace(within="cow"), exact).quantities[0].comparison
    known = stats.ttest_rel(
        [one.found[COMPRESSION].value for one in captures if one.labels["liner"] == "B"],
        [one.found[COMPRESSION].value for one in captures if one.labels["liner"] == "A"],
    )
    assert paired.paired
    assert paired.differences[0].found.p == pytest.approx(known.pvalue)
    shared = make_study(BY_LINER._replace(within="cow"), captures).quantities[0].comparison
    assert shared.differences[0].found.common == pytest.approx(0.1 * np.sqrt(2))


def test_what_is_common_to_one_liner_is_in_no_difference_of_cows() -> None:
    study = make_study(StudyQuestion(by="cow"), [one for one in herd() if one.labels["liner"] == "A"])
    assert study.quantities[0].comparison.differences[0].found.common == pytest.approx(0.0, abs=1e-12)


def test_all_of_a_sigma_counts_as_common_where_the_analysis_does_not_tell() -> None:
    captures = [capture(n, found={COMPRESSION: found(40.0 + n, 0.5, None)}) for n in range(4)]
    studied = make_study(StudyQuestion(), captures).quantities[0]
    assert studied.comparison.means[0].common == pytest.approx(0.5)
    assert "4 of 4 analyses do not tell" in studied.remarks[0]


def test_captures_of_unknown_liners_share_within_their_group_and_not_between() -> None:
    known = {COMPRESSION: found(40.0, 0.5, 0.5)}
    captures = [capture(n, "AABB"[n], found=known)._replace(liner="") for n in range(4)]
    study = make_study(BY_LINER, captures)
    compared = study.quantities[0].comparison
    assert [one.common for one in compared.means] == pytest.approx([0.5, 0.5])
    assert compared.differences[0].found.common == pytest.approx(0.5 * np.sqrt(2))
    assert "nothing tells the liner of 4 of 4 captures" in study.remarks[0]


def test_a_value_without_a_sigma_counts_by_its_scatter() -> None:
    captures = [capture(n, found={COMPRESSION: found(40.0 + n, float("nan"), None)}) for n in range(4)]
    studied = make_study(StudyQuestion(), captures).quantities[0]
    assert studied.comparison.means[0].sigma == pytest.approx(np.std(range(4), ddof=1) / 2)
    assert any("have no σ" in remark for remark in studied.remarks)


def test_a_capture_without_the_label_is_left_out_with_the_reason() -> None:
    odd = capture(50)._replace(labels={"liner": "A"})
    study = make_study(BY_LINER._replace(within="cow", unit="teat"), [odd])
    assert study.left_out == (LeftOut("c050", "", "it has no cow and no teat"),)
    assert study.captures == study.quantities == ()


def test_a_quantity_that_a_capture_lacks_is_left_out_with_the_reason_of_its_analysis() -> None:
    without = capture(1)._replace(found={COMPRESSION: missing("flow_stop was not given")})
    study = make_study(StudyQuestion(), [capture(0), without, capture(2)])
    assert LeftOut("c001", COMPRESSION, "flow_stop was not given") in study.left_out
    assert any(one[:2] == ("c001", OPENING) and "analyse it again" in one.reason for one in study.left_out)
    assert study.quantities[0].captures == (0, 2)


def test_a_quantity_of_another_unit_is_left_out() -> None:
    other = capture(1)._replace(found={OPENING: found(120.0, 1.0, unit="ms")})
    study = make_study(StudyQuestion(quantities=(OPENING,)), [capture(0), other, capture(2)])
    assert LeftOut("c001", OPENING, "its unit is 'ms', not 's': analyse it again") in study.left_out


def test_quantities_that_nobody_has_are_left_out_unless_they_are_asked_for() -> None:
    assert TOUCH not in {one.quantity for one in make_study(StudyQuestion(), herd()).left_out}
    asked = make_study(StudyQuestion(quantities=(TOUCH,)), herd())
    assert asked.quantities == ()
    assert {one.quantity for one in asked.left_out} == {TOUCH}


def test_an_unknown_quantity_is_refused_with_those_there_are() -> None:
    with pytest.raises(InputError, match="no capture has the quantity strok_mm") as refused:
        make_study(StudyQuestion(quantities=("strok_mm",)), herd())
    assert COMPRESSION in refused.value.hint


def test_ramps_and_milkings_are_studied_side_by_side() -> None:
    ramp = capture(9)._replace(
        found={TOUCH: found(11.0), COMPRESSION: missing("there is no teat")}, labels={"test": "ramp"}
    )
    milking = capture(1)._replace(labels={"test": "milking"})
    study = make_study(StudyQuestion(), [milking, ramp])
    assert {one.name: one.captures for one in study.quantities}[TOUCH] == (1,)
    assert LeftOut("c009", COMPRESSION, "there is no teat") in study.left_out
    assert any("milking, ramp" in remark for remark in study.remarks)


def test_the_trend_runs_over_a_label_with_numbers() -> None:
    study = make_study(StudyQuestion(over="milkings"), [capture(n) for n in range(5)])
    trend = study.quantities[0].trend
    assert trend is not None
    assert trend.common.value == pytest.approx(0.01)


def test_the_trend_runs_over_days() -> None:
    captures = [capture(n)._replace(captured_utc=f"2026-11-{1 + 2 * n:02d}T06:00:00Z") for n in range(4)]
    study = make_study(StudyQuestion(over="date"), captures)
    trend = study.quantities[0].trend
    assert trend is not None
    assert trend.common.value == pytest.approx(0.5)
    assert study.quantities[0].place[0] - study.origin == pytest.approx(0.25)


def test_a_capture_without_a_number_takes_part_in_the_comparison_alone() -> None:
    captures = [capture(n) for n in range(5)]
    captures[2] = captures[2]._replace(labels={"liner": "A", "milkings": "many"})
    study = make_study(StudyQuestion(by="liner", over="milkings"), captures)
    assert study.quantities[0].comparison.captures == (5,)
    assert any(one.capture == "c002" and "not in the trend" in one.reason for one in study.left_out)
    assert study.quantities[0].trend is not None


def test_a_group_without_any_number_has_no_trend_and_keeps_its_place() -> None:
    captures = [capture(n, "ABC"[n % 3]) for n in range(12)]
    captures = [
        one._replace(labels={"liner": "B"}) if one.labels["liner"] == "B" else one for one in captures
    ]
    trend = make_study(BY_LINER._replace(over="milkings"), captures).quantities[0].trend
    assert trend is not None
    assert [one is None for one in trend.slopes] == [False, True, False]


def test_captures_at_one_place_have_no_trend() -> None:
    captures = [capture(n)._replace(labels={"milkings": "100"}) for n in range(3)]
    assert make_study(StudyQuestion(over="milkings"), captures).quantities[0].trend is None


def test_names_are_in_the_order_in_which_people_count() -> None:
    assert natural(["cow 10", "cow 9", "Cow 1", "cow 9"]) == ["Cow 1", "cow 9", "cow 10"]
    assert natural(["2", "10", "a", "²"]) == ["2", "10", "a", "²"]
