"""The line under delays: it follows those that nothing held up, whatever happened to the others."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.core.channels.dating import lower_envelope

X = np.arange(120) * 500e6


def delays(seed: int = 0, drift: float = 3e-5, mean_ns: float = 2e6) -> np.ndarray:
    return 5e6 + drift * X + np.random.default_rng(seed).exponential(mean_ns, len(X))


def values(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    line = lower_envelope(x, y)
    return np.array([line.at(one) for one in x])


@given(st.integers(0, 1000), st.sampled_from([0.0, 3e-5, -2e-4, 5e-3]))
def test_no_delay_lies_below_it(seed: int, drift: float) -> None:
    y = delays(seed, drift)
    assert (y - values(X, y) > -1.0).all()


@pytest.mark.parametrize("drift", [0.0, 3e-5, -2e-4, 5e-3])
def test_it_finds_drift_and_shortest_delay(drift: float) -> None:
    line = lower_envelope(X, delays(drift=drift))
    assert line.slope == pytest.approx(drift, abs=2e-6)
    assert values(X, delays(drift=drift)).tolist() == pytest.approx((5e6 + drift * X).tolist(), abs=150e3)


def test_a_minute_of_load_does_not_tilt_it() -> None:
    y = delays()
    y[70:115] += 8e6
    assert lower_envelope(X, y).slope == pytest.approx(3e-5, abs=1e-5)


def test_few_delays_are_no_reason_to_believe_in_a_drift() -> None:
    y = np.array([5e6, 9e6, 6e6])
    assert lower_envelope(X[:3], y).slope == 0.0


def test_its_excess_is_what_the_better_half_is_late_by() -> None:
    late = delays(mean_ns=2e6)
    assert 0.2e6 < lower_envelope(X, late).excess < 1.2e6
