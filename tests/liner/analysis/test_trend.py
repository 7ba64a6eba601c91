"""Trends over milkings and days, against regressions."""

import numpy as np
import pytest
from scipy import stats

from grabberd_liner.analysis.comparison import straight_line, trend
from grabberd_liner.analysis.mixed_model import observations

RNG = np.random.default_rng(7)
X = np.array([0.0, 400, 900, 1600, 2500])


def exact(value):
    zeros = np.zeros(len(value))
    return observations(np.asarray(value, float), zeros, zeros, ["A"] * len(value))


def test_a_line_is_the_regression():
    y = 40 - 0.002 * X + 0.3 * RNG.normal(size=5)
    line, known = straight_line(exact(y), X), stats.linregress(X, y)
    assert (line.slope.value, line.slope.sigma, line.slope.p) == pytest.approx(
        (known.slope, known.stderr, known.pvalue)
    )
    assert (line.offset.value, line.offset.sigma) == pytest.approx((known.intercept, known.intercept_stderr))


def test_what_all_share_is_in_the_offset_and_not_in_the_slope():
    y = observations(np.array([1.0, 2.0, 3.0, 4.2, 5.0]), np.full(5, 0.5), np.full(5, 0.4), ["A"] * 5)
    line = straight_line(y, X)
    assert line.offset.common == pytest.approx(0.4)
    assert line.slope.common == pytest.approx(0.0, abs=1e-12)


def test_a_shared_error_in_proportion_to_the_value_is_in_the_slope_in_the_same_proportion():
    y = 2.0 + 0.001 * X
    line = straight_line(observations(y, 0.1 * y, 0.08 * y, ["A"] * 5), X)
    assert line.slope.common == pytest.approx(0.08 * line.slope.value)


def test_two_points_have_a_slope_with_their_own_sigma_and_no_test():
    line = straight_line(observations(np.array([1.0, 3.0]), np.full(2, 0.5), np.zeros(2), ["A"] * 2), X[:2])
    assert line.slope.value == pytest.approx(2 / 400)
    assert line.slope.sigma == pytest.approx(0.5 * np.sqrt(2) / 400)
    assert np.isnan(line.slope.p)


def test_lines_that_end_nowhere_are_refused():
    with pytest.raises(ValueError, match="not determined"):
        straight_line(exact([1.0, 2.0]), np.array([3.0, 3.0]))


def test_groups_have_slopes_of_their_own_and_one_in_common():
    first, second = 40 - 0.002 * X, 30 + 0.004 * X
    group = np.repeat([0, 1], 5)
    noise = 0.01 * RNG.normal(size=10)
    found = trend(exact(np.concatenate([first, second]) + noise), np.tile(X, 2), group)
    assert [one.value for one in found.slopes if one] == pytest.approx([-0.002, 0.004], abs=1e-4)
    assert found.common.value == pytest.approx(0.001, abs=1e-4)
    assert found.slopes[0].dof == pytest.approx(6)
    assert found.common.dof == pytest.approx(7)


def test_a_group_at_one_place_has_no_slope():
    found = trend(exact(RNG.normal(size=7)), np.append(X, [5.0, 5.0]), np.repeat([0, 1], [5, 2]))
    assert found.slopes[1] is None
    assert found.slopes[0] is not None


def test_captures_of_one_milking_count_once():
    y = 40 - 0.002 * X + 0.3 * RNG.normal(size=5)
    found = trend(exact(np.tile(y, 3)), np.tile(X, 3), np.zeros(15, int), unit=np.zeros(15, int))
    assert found.common.p == pytest.approx(stats.linregress(X, y).pvalue)


def test_cows_that_are_followed_keep_a_level_of_their_own():
    cows, slope = 6, 0.003
    level = 10 * RNG.normal(size=(cows, 1))
    y = level + slope * X + 0.1 * RNG.normal(size=(cows, 5))
    x, cow = np.tile(X, cows), np.repeat(np.arange(cows), 5)
    found = trend(exact(y.ravel()), x, np.zeros(30, int), unit=cow)
    # Every cow at every x: the slope is judged by the scatter about each cow's own line of that slope.
    centred = y - y.mean(axis=1, keepdims=True)
    known = stats.linregress(x, centred.ravel())
    assert found.common.value == pytest.approx(known.slope)
    assert found.common.dof == pytest.approx(cows * 4 - 1)
    assert found.common.sigma == pytest.approx(known.stderr * np.sqrt(28 / 23))
