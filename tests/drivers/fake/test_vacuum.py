"""The simulated vacuum and its logger."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drivers.fake.iso_phases import iso_phases_s
from grabberd_fake.liner import closure
from grabberd_fake.options import FakeOptions
from grabberd_fake.vacuum import LOG_HEADER, pulsation_kpa, vacuum_log

LINER = FakeOptions().ellipse


@given(st.floats(0, 100))
def test_it_stays_between_atmosphere_and_the_systems_vacuum_and_repeats_itself(time_s: float) -> None:
    kpa = pulsation_kpa(LINER, np.array([time_s, time_s + 1.0]))
    assert ((kpa >= 0) & (kpa <= 42 + 1e-9)).all()
    assert kpa[0] == pytest.approx(kpa[1], abs=1e-6)


def test_the_wall_moves_after_the_vacuum_has_begun_to_change() -> None:
    at = np.arange(0, 1, 0.001)
    closed = np.array([closure(LINER, round(t * 1e9)) for t in at])
    kpa = pulsation_kpa(LINER, at)
    assert kpa[at < 0.02].min() > 4
    assert closed[0] == 1.0
    starts_to_fall = at[(at > 0.3) & (kpa < 42 - 1e-9)][0]
    starts_to_close = at[(at > 0.3) & (closed > 1e-9)][0]
    assert starts_to_close - starts_to_fall == pytest.approx(0.03, abs=0.002)
    assert kpa[(closed == 0) & (at < 0.5)].min() == 42.0


def test_its_slopes_are_finite() -> None:
    kpa = pulsation_kpa(LINER, np.arange(0, 2, 0.001))
    assert np.abs(np.diff(kpa)).max() == pytest.approx(42 / 100, rel=1e-6)


def test_iso_phases_are_the_times_between_the_thresholds() -> None:
    at = np.arange(0, 1, 1e-5)
    kpa = pulsation_kpa(LINER, at)
    rising = np.roll(kpa, -1) > kpa + 1e-9
    falling = np.roll(kpa, -1) < kpa - 1e-9
    between = (kpa > 4) & (kpa < 38)
    counted = [(between & rising).mean(), (kpa >= 38).mean(), (between & falling).mean(), (kpa <= 4).mean()]
    assert_allclose(iso_phases_s(LINER), counted, atol=3e-5)


def test_the_logger_writes_on_its_own_clock() -> None:
    lines = list(vacuum_log(LINER, 2_000_000_000, 4_000_000_000, offset_s=0.25, rate_hz=500))
    assert lines[0] == LOG_HEADER
    rows = np.array([[float(value) for value in line.split(",")] for line in lines[1:]])
    assert rows.shape == (1001, 3)
    assert_allclose(rows[:, 0], np.arange(1001) / 500 - 0.25, atol=1e-6)
    assert_allclose(rows[:, 1], pulsation_kpa(LINER, 2 + rows[:, 0] + 0.25), atol=1e-4)
    assert_allclose(rows[:, 2], 42.0)


def test_its_noise_is_seeded() -> None:
    first, again = (list(vacuum_log(LINER, 0, 2_000_000_000, noise_kpa=0.2, seed=3)) for _ in range(2))
    assert first == again
    plain = list(vacuum_log(LINER, 0, 2_000_000_000))
    noise = [
        float(a.split(",")[1]) - float(b.split(",")[1]) for a, b in zip(first[1:], plain[1:], strict=True)
    ]
    assert np.std(noise) == pytest.approx(0.2, rel=0.05)


@pytest.mark.parametrize(
    ("vacuum", "said"),
    [({"rising": 0.62}, "before it has risen"), ({"falling": 0.4}, "before it has fallen")],
)
def test_a_vacuum_that_does_not_fit_into_the_cycle_is_refused(vacuum: dict[str, float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        FakeOptions.read({"ellipse": {"vacuum": vacuum}})
