"""Readings without a time of their own."""

import pytest

from grabberd.core.channels import ArrivalDating


def test_readings_of_a_packet_are_spread_since_the_one_before() -> None:
    dating = ArrivalDating()
    dating.date(1, 1_000_000_000)
    dated = dating.date(4, 1_016_000_000)
    assert dated.time_ns.tolist() == [1_004_000_000, 1_008_000_000, 1_012_000_000, 1_016_000_000]
    assert dated.sigma_ns == pytest.approx(16_000_000 / 12**0.5, rel=1e-6)


def test_the_first_ones_are_older_than_anybody_knows() -> None:
    assert ArrivalDating().date(2, 1_000_000_000).sigma_ns > 10_000_000


def test_times_ascend_where_two_packets_come_at_once() -> None:
    dating = ArrivalDating()
    first, second = dating.date(3, 1_000_000_000), dating.date(3, 1_000_000_000)
    times = [*first.time_ns.tolist(), *second.time_ns.tolist()]
    assert times == sorted(set(times))
