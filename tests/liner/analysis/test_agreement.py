"""Bias and limits of agreement, against the published example and closed forms."""

import numpy as np
import pytest
from scipy import stats

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.agreement import agreement
from grabberd_liner.analysis.estimate import Estimate, Joint

WRIGHT = [494, 395, 516, 434, 476, 557, 413, 442, 650, 433, 417, 656, 267, 478, 178, 423, 427]
MINI = [512, 430, 520, 428, 500, 600, 364, 380, 658, 445, 432, 626, 260, 477, 259, 350, 451]
"""Peak expiratory flow by two meters, l/min, first readings: table 1 of Bland and Altman, Lancet 1986."""


def compared(first, second, first_covariance, second_sigma, difference_covariance=None):
    first, second = np.asarray(first, float), np.asarray(second, float)
    sigma = np.broadcast_to(second_sigma, second.shape).astype(float)
    covariance = (
        first_covariance + np.diag(sigma**2) if difference_covariance is None else difference_covariance
    )
    apart = first - second
    inverse = np.linalg.inv(covariance)
    rest = apart - inverse.sum(axis=0) @ apart / inverse.sum()
    return agreement(
        Joint(apart, covariance),
        Joint(first, first_covariance),
        Estimate(second, sigma),
        float(rest @ inverse @ rest),
        len(apart) - 1,
    )


def of_meters():
    """With σ that are too small to matter."""
    return compared(WRIGHT, MINI, 1e-6 * np.eye(17), 1e-3)


def test_the_published_example_has_its_published_bias_and_confidence_interval():
    found = of_meters()
    assert (round(float(found.bias.value), 1), round(found.sd, 1)) == (-2.1, 38.8)
    assert [round(one, 1) for one in (found.bias_low, found.bias_high)] == pytest.approx(
        [-22.0, 17.8], abs=0.11
    )


def test_its_limits_are_those_of_1_96_standard_deviations_with_the_confidence_of_1999():
    found, apart = of_meters(), np.subtract(WRIGHT, MINI)
    sd, reach = apart.std(ddof=1), stats.t.ppf(0.975, 16)
    sigma = sd * np.sqrt(1 / 17 + 1.96**2 / (2 * 16))
    for limit, side in ((found.lower, -1), (found.upper, 1)):
        at = apart.mean() + side * 1.96 * sd
        assert limit == pytest.approx((at, at - reach * sigma, at + reach * sigma))
    assert found.independent == pytest.approx(16)


def test_the_slope_between_equally_certain_methods_is_that_of_ordinary_least_squares():
    random = np.random.default_rng(4)
    true = np.linspace(0, 50, 40)
    first, second = 1.1 * true + random.normal(size=40), true + random.normal(size=40)
    found = compared(first, second, np.eye(40), 1.0)
    line = stats.linregress((first + second) / 2, first - second)
    assert float(found.slope.value) == pytest.approx(line.slope)
    assert float(found.slope.value) == pytest.approx(0.1 / 1.05, abs=3 * float(found.slope.sigma))


def test_a_method_that_is_less_certain_alone_makes_no_proportional_bias():
    random = np.random.default_rng(5)
    true = random.normal(20, 6, 30)
    slopes = [
        compared(true + random.normal(0, 4, 30), true + random.normal(0, 0.5, 30), 16 * np.eye(30), 0.5).slope
        for _ in range(300)
    ]
    naive = 0.5 * (16 - 0.25) / (36 + (16 + 0.25) / 4)
    assert abs(np.mean([one.value for one in slopes])) < 0.2 * naive


def scattered(covariance, sigma, draws, bias=0.0, share=1.0):
    """Agreements of methods with errors of these σ, but for a share by which the first one's are larger."""
    random = np.random.default_rng(6)
    root = np.linalg.cholesky(covariance)
    true = np.linspace(5, 40, len(covariance))
    for _ in range(draws):
        first = true + bias + share * root @ random.normal(size=len(true))
        yield compared(first, true + sigma * random.normal(size=len(true)), covariance, sigma)


def smooth(count=40):
    """Errors of 3 kPa that neighbours share, and .5 kPa that all do."""
    at = np.arange(count)
    return 9 * np.exp(-0.5 * ((at[:, None] - at) / 2.5) ** 2) + 0.25 + 1e-6 * np.eye(count)


def test_errors_that_go_together_scatter_as_expected_and_leave_the_bias_uncertain():
    found = list(scattered(smooth(), 1.0, 400))
    assert np.mean([one.chi2 / one.dof for one in found]) == pytest.approx(1, abs=0.05)
    assert np.mean([(one.bias.value / one.bias.sigma) ** 2 for one in found]) == pytest.approx(1, abs=0.3)
    assert np.mean([one.sd**2 for one in found]) == pytest.approx(found[0].expected_sd ** 2, rel=0.05)
    assert found[0].independent < 20
    assert np.mean([one.p < 0.05 for one in found]) == pytest.approx(0.05, abs=0.03)


def test_the_limits_confidence_interval_holds_the_true_limit_in_95_of_100():
    found = list(scattered(smooth(), 1.0, 400, bias=2.0))
    centre = np.eye(40) - 1 / 40
    true_sd = np.sqrt(np.trace(centre @ (smooth() + np.eye(40))) / 39)
    held = [one.upper.low < 2.0 + 1.96 * true_sd < one.upper.high for one in found]
    assert np.mean(held) > 0.9


def test_a_sigma_that_is_too_small_is_found_out_and_enlarges_that_of_the_bias():
    (honest,), (boasting,) = (list(scattered(smooth(), 0.3, 1, share=share)) for share in (1.0, 3.0))
    assert boasting.p < 1e-6
    assert boasting.sd > 2 * boasting.expected_sd
    assert boasting.bias.sigma > 2 * honest.bias.sigma


def test_methods_that_agree_everywhere_have_no_slope_where_nothing_changes():
    assert np.isnan(compared(np.ones(12), np.ones(12), np.eye(12), 1.0).slope.value)


def test_two_places_say_nothing():
    with pytest.raises(AnalysisError, match="2 differences"):
        compared([1, 2], [2, 1], np.eye(2), 1.0)
