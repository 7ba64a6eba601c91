"""Groups compared, against the classical tests."""

import numpy as np
import pytest
from scipy import stats

from grabberd_liner.analysis.comparison import compare, holm
from grabberd_liner.analysis.mixed_model import observations

RNG = np.random.default_rng(5)
FIRST, SECOND = RNG.normal(size=6), RNG.normal(size=6) + 0.5
GROUP = np.repeat([0, 1], 6)


def exact(value, share=None):
    """Values without a σ of their own."""
    zeros = np.zeros(len(value))
    return observations(np.asarray(value, float), zeros, zeros, share or ["one"] * len(value))


def test_two_groups_are_the_t_test():
    found = compare(exact([*FIRST, *SECOND]), GROUP).differences[0].found
    known = stats.ttest_ind(SECOND, FIRST)
    assert (found.t, found.p, found.dof) == pytest.approx((known.statistic, known.pvalue, 10))
    low, high = known.confidence_interval(0.95)
    assert (found.value - found.half_width, found.value + found.half_width) == pytest.approx((low, high))


def test_groups_of_unequal_size_are_the_t_test_with_pooled_variance():
    found = compare(exact([*FIRST[:2], *SECOND]), GROUP[4:]).differences[0].found
    known = stats.ttest_ind(SECOND, FIRST[:2])
    assert (found.t, found.p) == pytest.approx((known.statistic, known.pvalue))


def test_every_cow_with_every_liner_is_the_paired_t_test():
    found = compare(exact([*FIRST, *SECOND]), GROUP, block=np.tile(np.arange(6), 2))
    known = stats.ttest_rel(SECOND, FIRST)
    assert found.paired
    assert (found.differences[0].found.t, found.differences[0].found.p) == pytest.approx(
        (known.statistic, known.pvalue)
    )


def test_captures_of_one_cow_are_no_replication():
    value = np.concatenate([FIRST, SECOND])
    noise = 0.01 * RNG.normal(size=(3, 12))
    repeated = compare(
        exact((value + noise - noise.mean(axis=0)).ravel()), np.tile(GROUP, 3), unit=np.tile(np.arange(12), 3)
    )
    once = compare(exact(value), GROUP)
    assert repeated.replicates == (6, 6)
    assert repeated.captures == (18, 18)
    assert repeated.differences[0].found.p == pytest.approx(once.differences[0].found.p)


def test_several_captures_of_a_cow_with_a_liner_are_one_pair_of_the_paired_test():
    value = np.concatenate([FIRST, SECOND])
    cow = np.tile(np.arange(6), 2)
    twice = compare(exact(np.tile(value, 2)), np.tile(GROUP, 2), block=np.tile(cow, 2))
    assert twice.differences[0].found.dof == pytest.approx(5)
    assert twice.differences[0].found.p == pytest.approx(stats.ttest_rel(SECOND, FIRST).pvalue)


def test_cows_that_had_one_liner_each_pair_nothing():
    found = compare(exact([*FIRST, *SECOND]), GROUP, block=np.arange(12))
    assert not found.paired
    assert found.differences[0].found.p == pytest.approx(stats.ttest_ind(SECOND, FIRST).pvalue)


def test_a_cow_that_missed_a_liner_takes_part_with_what_she_has():
    cow = np.tile(np.arange(6), 2)[:-1]
    found = compare(exact([*FIRST, *SECOND[:-1]]), GROUP[:-1], block=cow)
    assert found.paired
    assert 3.9 < found.differences[0].found.dof < 9


def test_three_groups_have_the_pooled_variance_of_all():
    third = RNG.normal(size=6)
    found = compare(exact([*FIRST, *SECOND, *third]), np.repeat([0, 1, 2], 6))
    pooled = np.mean([np.var(one, ddof=1) for one in (FIRST, SECOND, third)])
    assert found.within_sigma == pytest.approx(np.sqrt(pooled))
    assert [one.found.dof for one in found.differences] == pytest.approx([15, 15, 15])
    # With two groups in each pair of three: the analysis of variance, whose F is the mean of their t².
    squares = np.mean([one.found.t**2 for one in found.differences])
    assert squares == pytest.approx(stats.f_oneway(FIRST, SECOND, third).statistic)


def test_holm_multiplies_the_least_by_all_and_keeps_the_order():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5, 0.9]) == pytest.approx([1.0, 1.0])
    assert holm([float("nan"), 0.02]) == pytest.approx([float("nan"), 0.02], nan_ok=True)


def test_one_capture_a_group_gives_differences_by_sigma_alone():
    both = observations(np.array([40.0, 43.0]), np.array([0.5, 0.5]), np.array([0.3, 0.3]), ["A", "B"])
    found = compare(both, np.array([0, 1])).differences[0]
    assert found.found.sigma == pytest.approx(np.hypot(0.5, 0.5))
    assert np.isnan(found.found.p)
    assert np.isnan(found.adjusted_p)


def test_averaging_never_lessens_what_is_common():
    many = observations(RNG.normal(size=200), np.full(200, 0.5), np.full(200, 0.4), ["A"] * 200)
    mean = compare(many, np.zeros(200, int)).means[0]
    assert mean.common == pytest.approx(0.4)
    assert mean.sigma > 0.4


def test_scatter_is_held_against_the_own_sigma():
    rng = np.random.default_rng(6)
    value = rng.normal(size=(40, 5))
    group = np.repeat(np.arange(40), 5)
    right = compare(observations(value.ravel(), np.ones(200), np.zeros(200), ["A"] * 200), group).check
    wrong = compare(observations(3 * value.ravel(), np.ones(200), np.zeros(200), ["A"] * 200), group).check
    assert right.dof == wrong.dof == 160
    assert right.chi2 == pytest.approx(np.sum((value - value.mean(axis=1, keepdims=True)) ** 2))
    assert right.p > 0.01 > wrong.p
