import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.reports.notation import (
    common_exponent,
    count,
    fixed,
    measured,
    p_value,
    probability,
    significant,
)

SIGMAS = st.floats(1e-9, 1e4)


def number(text):
    value, _, power = text.replace("−", "-").partition(" × 10")
    return float(value) * 10.0 ** int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)


@pytest.mark.parametrize(
    ("value", "sigma", "exponent", "written"),
    [
        (8.03612, 0.0173, 0, ("8.036", "0.017")),
        (-63.897, 0.18, 0, ("−63.90", "0.18")),
        (364.08, 3.52, 0, ("364.1", "3.5")),
        (364.08, 35.2, 0, ("364", "35")),
        (1.0, 0.0996, 0, ("1.00", "0.10")),
        (-1.9634e-5, 5.3e-6, -5, ("−1.96", "0.53")),
        (-0.0004, 0.12, 0, ("0.00", "0.12")),
        (0.0, None, 0, ("0", "–")),
        (179.5, None, 0, ("179.5", "–")),
        (None, None, 0, ("–", "–")),
    ],
)
def test_sigma_has_two_digits_and_the_value_ends_at_the_same_place(value, sigma, exponent, written):
    assert measured(value, sigma, exponent) == written


@given(st.floats(-1e5, 1e5), SIGMAS)
def test_rounding_costs_no_more_than_a_twentieth_of_sigma(value, sigma):
    written = measured(value, sigma)
    assert abs(number(written.value) - value) <= 0.0501 * sigma + 1e-12 * abs(value)
    assert number(written.sigma) == pytest.approx(sigma, rel=0.051)


@given(st.floats(1e-12, 1e12), st.integers(2, 6), st.booleans())
def test_significant_digits_keep_the_value(value, digits, negative):
    value = -value if negative else value
    assert number(significant(value, digits)) == pytest.approx(
        value, rel=0.51 * 10.0 ** (1 - digits), abs=0.51 * (abs(value) >= 100)
    )


@given(st.floats(-1e6, 1e6), st.integers(0, 5))
def test_a_minus_is_a_minus_and_never_stands_before_nothing(value, places):
    written = fixed(value, places)
    assert "-" not in written
    assert written.startswith("−") == (round(value, places) < 0)


def test_what_is_not_known_is_a_dash():
    assert fixed(None, 2) == significant(None) == probability(None) == "–"


def test_small_probabilities_are_said_to_be_small():
    assert [probability(p) for p in (0.0, 0.0004, 0.0006, 0.05, 1.0)] == [
        "< 0.001",
        "< 0.001",
        "0.001",
        "0.050",
        "1.000",
    ]


def test_a_power_of_ten_is_taken_out_of_small_numbers_alone():
    assert common_exponent([3.2e-5, None, -1.1e-6]) == -5
    assert common_exponent([3.2e-5, 0.02]) == 0
    assert common_exponent([None, 0.0]) == 0


def test_whole_numbers_have_a_sign_where_it_is_asked_for():
    assert [count(2.0), count(-3), count(1, signed=True), count(None)] == ["2", "−3", "+1", "–"]


def test_a_probability_in_a_sentence_is_never_broken():
    assert [p_value(0.123), p_value(0.0)] == ["p\u00a0=\u00a00.123", "p\u00a0<\u00a00.001"]
