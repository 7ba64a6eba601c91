"""The same liner over months: changed, not changed or not certain."""

import pytest

from grabberd_liner.chain.guided_tests.wear_test import wear_test
from liner.chain.guided_tests.evidence import by_name, profile, with_quantities


def captures(values, sigma=0.2, common=0.1, milkings=(0, 800, 1600, 2400), label="milkings"):
    """Captures of a liner whose touch point takes these values."""
    return [
        with_quantities(
            {"touch_kpa": (value, sigma, common)},
            id=f"c{at}",
            captured_utc=f"2026-0{at + 1}-01T09:30:00.000Z",
            labels={"liner": "A", **({label: str(age)} if label else {})},
        )
        for at, (value, age) in enumerate(zip(values, milkings, strict=True))
    ]


def test_a_liner_that_stays_the_same_passes():
    outcome = wear_test(captures((15.0, 15.1, 14.9, 15.0)))
    check = by_name(outcome)["touch_kpa_unchanged"]
    assert check.verdict == "passed"
    assert outcome.findings[0].verdict == "not changed"


def test_a_liner_that_stiffens_by_a_fifth_fails():
    outcome = wear_test(captures((15.0, 16.0, 17.0, 18.0)))
    check = by_name(outcome)["touch_kpa_unchanged"]
    assert check.verdict == "failed"
    assert check.value == pytest.approx(20.0, abs=0.1)
    slope = outcome.findings[0]
    assert slope.quantity.name == "touch_kpa_per_1000_milkings"
    assert slope.value == pytest.approx(1.25, abs=0.01)
    assert slope.verdict == "changed"


def test_values_that_are_not_known_well_decide_nothing():
    outcome = wear_test(captures((15.0, 15.5, 16.0, 16.5), sigma=2.0))
    assert by_name(outcome)["touch_kpa_unchanged"].verdict == "not certain"
    assert outcome.findings[0].verdict == "not certain"


def test_the_liner_s_profile_tells_its_age_where_no_label_does():
    made = [
        one._replace(liner=profile(age_milkings=1000 * at))
        for at, one in enumerate(captures((15.0, 15.4, 15.8, 16.2), label=None))
    ]
    assert wear_test(made).findings[0].value == pytest.approx(0.4, abs=0.01)


def test_without_milkings_it_goes_by_the_date():
    slope = wear_test(captures((15.0, 16.0, 17.0, 18.0), label=None)).findings[0]
    assert slope.quantity.name == "touch_kpa_per_100_days"
    assert slope.value == pytest.approx(3.3, abs=0.2)


def test_two_captures_make_no_trend():
    found = by_name(wear_test(captures((15.0, 16.0), milkings=(0, 800))))
    assert found["captures"].verdict == "failed"
    assert found["touch_kpa_unchanged"].verdict == "not checked"


def test_captures_of_several_liners_fail():
    first, *others = captures((15.0, 15.0, 15.0, 15.0))
    check = by_name(wear_test([first._replace(labels={"liner": "B", "milkings": "0"}), *others]))["one_liner"]
    assert check.verdict == "failed"
    assert check.reason == "they are labelled A, B"


def test_captures_and_trend_are_drawn_over_the_milkings():
    points, line = wear_test(captures((15.0, 16.0, 17.0, 18.0))).curves
    assert points.x.tolist() == [0.0, 800.0, 1600.0, 2400.0]
    assert line.y.tolist() == pytest.approx([15.0, 18.0])
