"""Latencies: the newest ones, and all of them in classes."""

import numpy as np
import pytest

from grabberd.service.device.latency import BOUNDS_S, Latency


def test_every_latency_is_in_one_class() -> None:
    latency = Latency()
    for milliseconds in (0.5, 1.0, 3.0, 3.0, 5000.0):
        latency.add(round(milliseconds * 1e6))
    histogram = latency.histogram
    assert dict(zip((*BOUNDS_S, np.inf), histogram.counts, strict=True)) == {
        **dict.fromkeys(BOUNDS_S, 0), 0.001: 2, 0.005: 2, np.inf: 1
    }  # fmt: skip
    assert histogram.sum_s == pytest.approx(5.0075)


def test_there_are_no_percentiles_of_nothing() -> None:
    assert Latency().percentiles_ms() is None


def test_percentiles_are_of_the_newest() -> None:
    latency = Latency()
    for milliseconds in (900, 1, 2, 3):
        latency.add(milliseconds * 1_000_000)
    assert latency.percentiles_ms(3) == pytest.approx({"p50": 2.0, "p99": 2.98, "max": 3.0})
