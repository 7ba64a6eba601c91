"""Times by LSL's clock, from clocks that are told what to show."""

from datetime import UTC, datetime

import numpy as np
import pytest

from grabberd.documents.points_frame import PointsFrame
from grabberd_lsl.outlets import LslClock

START_NS = 5_000_000_000_000
UTC_NS = 1_800_000_000_000_000_000


class Clocks:
    """One computer's: every look takes 100 ns; LSL's may be ahead of the monotonic one."""

    def __init__(self, ahead_ns: int = 0) -> None:
        self.ahead_ns = ahead_ns
        self.utc_step_ns = 0
        self._now_ns = START_NS

    def monotonic_ns(self) -> int:
        self._now_ns += 100
        return self._now_ns

    def utc_ns(self) -> int:
        return self.monotonic_ns() - START_NS + UTC_NS + self.utc_step_ns

    def lsl_s(self) -> float:
        return (self.monotonic_ns() + self.ahead_ns) / 1e9

    def clock(self) -> LslClock:
        return LslClock(self.lsl_s, self.monotonic_ns, self.utc_ns)


def frame(time_ns: int, utc_ns: int) -> PointsFrame:
    none = np.zeros(0, np.float32)
    return PointsFrame(0, time_ns, utc_ns // 1000, 0, 0, 1, none.astype(np.uint32), *[none] * 4)  # type: ignore[arg-type]


def test_where_both_clocks_are_one_times_stay_as_they_are() -> None:
    clock = Clocks().clock()
    assert clock.monotonic == (0, 100)
    one = frame(START_NS - 123_456_789, UTC_NS)
    assert clock.time_of(one, of_this_computer=True) == (START_NS - 123_456_789) / 1e9


def test_where_they_differ_the_difference_is_added() -> None:
    clock = Clocks(ahead_ns=7_000_000_000).clock()
    assert clock.monotonic.offset_ns == pytest.approx(7_000_000_000, abs=1000)
    one = frame(START_NS, UTC_NS)
    assert clock.time_of(one, of_this_computer=True) == pytest.approx(START_NS / 1e9 + 7, abs=1e-6)


def test_a_field_of_this_computer_is_known_by_its_two_times() -> None:
    clock = Clocks().clock()
    assert clock.is_of_this_computer(frame(START_NS - 20_000_000, UTC_NS - 20_000_000))
    assert not clock.is_of_this_computer(frame(START_NS - 40_000_000_000, UTC_NS))


def test_one_of_another_computer_goes_by_utc_even_after_that_was_set() -> None:
    clocks = Clocks()
    clock = clocks.clock()
    elsewhere = frame(42, UTC_NS - 1_000_000_000)
    assert clock.time_of(elsewhere, of_this_computer=False) == pytest.approx(START_NS / 1e9 - 1, abs=1e-4)
    clocks.utc_step_ns = 3_000_000_000
    assert clock.time_of(elsewhere, of_this_computer=False) == pytest.approx(START_NS / 1e9 - 4, abs=1e-4)


def test_a_moment_of_utc_has_its_time() -> None:
    moment = datetime.fromtimestamp(UTC_NS / 1e9, UTC)
    assert Clocks().clock().time_at(moment) == pytest.approx(START_NS / 1e9, abs=1e-4)
