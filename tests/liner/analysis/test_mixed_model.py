"""The model against analysis of variance, published fits, and the likelihood written down a second time."""

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize

from grabberd_liner.analysis.mixed_model import fit, identifiable, observations

# Davies and Goldsmith (1972), yield of dyestuff, six batches of five; fits as given with R's lme4.
DYESTUFF = [
    [1545, 1440, 1440, 1520, 1580],
    [1540, 1555, 1490, 1560, 1495],
    [1595, 1550, 1605, 1510, 1560],
    [1445, 1440, 1595, 1465, 1545],
    [1595, 1630, 1515, 1635, 1625],
    [1520, 1455, 1450, 1480, 1445],
]
# Wretenberg, Arborelius and Lindberg (1993), effort to rise from four stools, nine subjects; as in R's nlme.
STOOLS = [
    [12, 15, 12, 10],
    [10, 14, 13, 12],
    [7, 14, 13, 9],
    [7, 11, 10, 9],
    [8, 11, 8, 7],
    [9, 11, 11, 10],
    [8, 12, 12, 11],
    [7, 11, 8, 7],
    [9, 13, 10, 8],
]


def without_sigma(value):
    """Values of which only the scatter is known."""
    value = np.asarray(value, float).ravel()
    unknown = np.full(len(value), np.nan)
    return observations(value, unknown, np.zeros(len(value)), ["one"] * len(value))


def indicators(levels):
    return (np.asarray(levels)[:, None] == np.unique(levels)) * 1.0


def test_the_yield_of_dyestuff_comes_out_as_published():
    batch = np.repeat(np.arange(6), 5)
    fitted = fit(without_sigma(DYESTUFF), np.ones((30, 1)), [batch])
    assert fitted.variances == pytest.approx([2451.25, 1764.05], abs=0.01)
    mean = fitted.contrast(np.ones(1))
    assert (mean.value, mean.sigma, mean.dof) == pytest.approx((1527.5, 19.383, 5.0), abs=0.001)


def test_the_stools_come_out_as_published():
    stool, subject = np.tile(np.arange(4), 9), np.repeat(np.arange(9), 4)
    fitted = fit(without_sigma(STOOLS), indicators(stool), [subject])
    assert np.sqrt(fitted.variances) == pytest.approx([1.100295, 1.332465], abs=1e-6)
    second = fitted.contrast(np.array([-1.0, 1, 0, 0]))
    assert (second.value, second.sigma, second.dof) == pytest.approx((3.8889, 0.5187, 24.0), abs=1e-4)


def test_without_effects_it_is_ordinary_regression():
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0, 9, 12), rng.normal(size=12)
    slope = fit(without_sigma(y), np.column_stack([np.ones(12), x])).contrast(np.array([0.0, 1.0]))
    known = stats.linregress(x, y)
    assert (slope.value, slope.sigma, slope.p) == pytest.approx((known.slope, known.stderr, known.pvalue))


def test_a_balanced_nest_has_the_variances_of_its_analysis_of_variance():
    batches, repeats = 5, 3
    value = np.random.default_rng(2).normal(size=(batches, repeats))
    value -= 0.7 * value.mean(axis=1, keepdims=True)
    within = np.sum((value - value.mean(axis=1, keepdims=True)) ** 2) / (batches * (repeats - 1))
    between = repeats * np.var(value.mean(axis=1), ddof=1)
    assert between < within  # so that the effect's variance is negative
    fitted = fit(without_sigma(value), np.ones((15, 1)), [np.repeat(np.arange(batches), repeats)])
    assert fitted.variances == pytest.approx([within, (between - within) / repeats])


INCOMPLETE = np.array([0, 1, 1, 2, 0, 2, 0, 1, 2, 0, 1, 2, 2])
BLOCK = np.array([0, 0, 1, 1, 2, 2, 3, 3, 3, 4, 4, 5, 5])


def restricted(variances, value, design, block):
    """Twice the negative restricted logarithmic likelihood, by error contrasts instead of a projection."""
    contrasts = np.linalg.svd(design)[0][:, design.shape[1] :]
    whole = variances[0] * np.eye(len(value)) + variances[1] * indicators(block) @ indicators(block).T
    inner = contrasts.T @ whole @ contrasts
    if np.linalg.eigvalsh(whole)[0] <= 0:
        return np.inf
    left = contrasts.T @ value
    return np.linalg.slogdet(inner)[1] + left @ np.linalg.solve(inner, left)


def test_incomplete_blocks_have_the_variances_of_the_greatest_likelihood():
    rng = np.random.default_rng(3)
    value = rng.normal(size=13) + 1.5 * rng.normal(size=6)[BLOCK] + INCOMPLETE
    design = indicators(INCOMPLETE)
    fitted = fit(without_sigma(value), design, [BLOCK])
    best = minimize(
        restricted, [1.0, 1.0], (value, design, BLOCK), "Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}
    )
    assert fitted.variances == pytest.approx(best.x, rel=1e-4)
    whole = best.x[0] * np.eye(13) + best.x[1] * indicators(BLOCK) @ indicators(BLOCK).T
    known = np.linalg.solve(
        design.T @ np.linalg.solve(whole, design), design.T @ np.linalg.solve(whole, value)
    )
    assert fitted.coefficients == pytest.approx(known, rel=1e-4)


def test_in_incomplete_blocks_a_variance_is_never_negative():
    rng = np.random.default_rng(8)
    value = rng.normal(size=13)
    value -= 0.9 * (indicators(BLOCK) @ (indicators(BLOCK).T @ value / indicators(BLOCK).sum(axis=0)))
    fitted = fit(without_sigma(value), indicators(INCOMPLETE), [BLOCK])
    assert fitted.variances[1] == 0
    # With nothing between blocks, the coefficients are those of least squares.
    means = [value[group == INCOMPLETE].mean() for group in range(3)]
    assert fitted.coefficients == pytest.approx(means)


@pytest.mark.parametrize("seed", range(40))
def test_two_cows_of_which_one_missed_a_liner_always_have_an_answer(seed):
    rng = np.random.default_rng(seed)
    group, cow = np.array([0, 0, 1, 1, 2, 3, 3]), np.array([0, 1, 0, 1, 1, 0, 1])
    fitted = fit(without_sigma(rng.normal(size=7)), indicators(group), [cow])
    found = fitted.contrast(np.array([-1.0, 1.0, 0.0, 0.0]))
    assert 0 < found.sigma < 10
    assert 0.5 < found.dof < 6


def test_a_small_sample_makes_the_variance_of_incomplete_blocks_larger_never_smaller():
    rng = np.random.default_rng(4)
    fitted = fit(without_sigma(rng.normal(size=13)), indicators(INCOMPLETE), [BLOCK])
    difference = np.array([1.0, -1.0, 0.0])
    assert difference @ fitted.covariance @ difference >= difference @ fitted.plain @ difference
    assert 2 < fitted.contrast(difference).dof < 10


def test_what_all_share_is_in_a_mean_and_not_in_a_difference():
    value = np.array([1.0, 2.0, 4.0, 5.0])
    shared = observations(value, np.full(4, 0.5), np.full(4, 0.5), ["liner A"] * 4)
    fitted = fit(shared, indicators([0, 0, 1, 1]))
    assert fitted.contrast(np.array([1.0, 0.0])).common == pytest.approx(0.5)
    assert fitted.contrast(np.array([-1.0, 1.0])).common == pytest.approx(0.0, abs=1e-12)


def test_what_two_groups_do_not_share_is_in_their_difference_and_has_no_end_of_freedom():
    value = np.array([1.0, 2.0, 4.0, 5.0])
    shared = observations(value, np.full(4, 3.0), np.full(4, 3.0), ["A", "A", "B", "B"])
    difference = fit(shared, indicators([0, 0, 1, 1])).contrast(np.array([-1.0, 1.0]))
    scatter = 0.5
    assert difference.common == pytest.approx(np.sqrt(18))
    assert difference.sigma == pytest.approx(np.sqrt(18 + scatter))
    assert difference.dof == pytest.approx(2 * ((18 + scatter) / scatter) ** 2)


def test_a_scatter_smaller_than_the_own_sigma_does_not_count():
    value = np.array([1.0, 1.0, 2.0, 2.0001])
    found = fit(
        observations(value, np.full(4, 0.2), np.zeros(4), ["one"] * 4), indicators([0, 0, 1, 1])
    ).contrast(np.array([-1.0, 1.0]))
    assert found.by_sigma
    assert found.sigma == pytest.approx(0.2)
    assert found.dof == pytest.approx(2)


def test_of_a_sigma_that_cannot_be_split_the_worse_counts():
    sigma = np.full(4, 0.5)
    value = np.array([1.0, 1.001, 2.0, 2.001])
    fitted = fit(observations(value, sigma, np.full(4, np.nan), ["A"] * 4), indicators([0, 0, 1, 1]))
    mean, difference = (fitted.contrast(np.array(of)) for of in ([1.0, 0.0], [-1.0, 1.0]))
    assert mean.common == pytest.approx(0.5)  # as if all were shared
    assert (difference.common, difference.sigma) == pytest.approx((0.0, 0.5), abs=1e-12)  # as if none were
    apart = fit(
        observations(value, sigma, np.full(4, np.nan), ["A", "A", "B", "B"]), indicators([0, 0, 1, 1])
    )
    assert apart.contrast(np.array([-1.0, 1.0])).sigma == pytest.approx(0.5 * np.sqrt(2), rel=1e-4)


def test_one_value_a_group_has_a_sigma_and_no_test():
    found = fit(
        observations(np.array([1.0, 2.0]), np.full(2, 0.3), np.zeros(2), ["one"] * 2), np.eye(2)
    ).contrast(np.array([-1.0, 1.0]))
    assert found.sigma == pytest.approx(0.3 * np.sqrt(2))
    assert np.isnan([found.dof, found.t, found.p, found.half_width]).all()


def test_equal_values_of_unknown_sigma_are_no_proof_of_anything():
    found = fit(without_sigma([1.0, 1.0, 2.0, 2.0]), indicators([0, 0, 1, 1])).contrast(np.array([-1.0, 1.0]))
    assert found.sigma == 0
    assert np.isnan(found.p)


def test_an_effect_that_groups_or_single_values_hide_is_not_identifiable():
    design = indicators([0, 0, 1, 1])
    assert identifiable(design, [np.array([0, 0, 1, 1])]) == []
    assert identifiable(design, [np.arange(4)]) == []
    assert identifiable(design, [np.array([0, 1, 0, 1])]) == [0]
    assert identifiable(design, [np.array([0, 1, 0, 1])] * 2) == [0]


def test_a_design_that_determines_nothing_is_refused():
    with pytest.raises(ValueError, match="not determined"):
        fit(without_sigma([1.0, 2.0]), np.ones((2, 2)))
