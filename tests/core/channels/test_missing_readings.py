"""Readings that never came, by the steps of the logger's own time."""

import numpy as np

from grabberd.core.channels import MissingReadings
from grabberd.core.channels.dating import MISSING

STEADY = np.arange(100) * 5_000_000


def test_a_steady_logger_misses_nothing_and_its_rate_is_learnt() -> None:
    missing = MissingReadings()
    assert missing.rate_hz is None
    assert missing.look(STEADY, 1) == ()
    assert missing.rate_hz == 200.0


def test_a_gap_is_counted_in_readings() -> None:
    missing = MissingReadings()
    missing.look(STEADY, 1)
    (anomaly,) = missing.look(np.array([STEADY[-1] + 20_000_000]), 77)
    assert (anomaly.reason, anomaly.lost, anomaly.time_ns) == (MISSING, 3, 77)


def test_a_timer_that_jitters_loses_nothing() -> None:
    jitter = np.random.default_rng(0).uniform(-1_000_000, 1_000_000, len(STEADY)).astype(int)
    assert MissingReadings().look(STEADY + jitter, 1) == ()


def test_a_clock_that_was_set_has_lost_nothing() -> None:
    missing = MissingReadings()
    missing.look(STEADY, 1)
    missing.begin_anew()
    assert missing.look(STEADY + 3_600_000_000_000, 2) == ()
