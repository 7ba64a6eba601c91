import numpy as np
import pytest
from scipy.stats import kurtosis, skew

from core.calibration.networks import network, tied
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.residuals import normality, normality_of


def test_normal_errors_give_normal_residuals_in_every_view_and_altogether():
    found = normality(adjust(network(), tied()))
    assert [one.of for one in found] == ["left", "right", "all"]
    assert [one.count for one in found] == [216, 216, 432]
    assert all(one.p > 0.001 for one in found)
    assert all(abs(one.skewness) < 0.5 for one in found)


def test_skewness_and_kurtosis_are_the_moments_of_the_residuals():
    values = np.random.default_rng(2).exponential(size=50)
    found = normality_of(values, "some")
    assert found.skewness == pytest.approx(skew(values))
    assert found.kurtosis == pytest.approx(kurtosis(values))
    assert found.p < 1e-4


@pytest.mark.parametrize("count", [20, 100, 1000])
def test_the_test_rejects_normal_values_about_as_often_as_it_says(count):
    rng = np.random.default_rng(3)
    p = np.array([normality_of(rng.normal(size=count), "noise").p for _ in range(2000)])
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.02)


@pytest.mark.parametrize(
    "values", [np.random.default_rng(4).uniform(size=300), np.random.default_rng(4).standard_t(3, 300)]
)
def test_other_distributions_are_noticed(values):
    assert normality_of(values, "other").p < 0.001


@pytest.mark.parametrize("values", [np.arange(7.0), np.ones(20), np.full(20, np.nan)])
def test_where_nothing_can_be_said_nothing_is(values):
    assert np.isnan(normality_of(values, "few").p)
