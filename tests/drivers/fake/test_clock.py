"""The clocks that the simulated world runs on."""

import time

from grabberd_fake import JumpingClock, RealClock


def test_a_jumping_clock_stands_still_until_somebody_sleeps() -> None:
    clock = JumpingClock(5)
    assert (clock.now_ns(), clock.now_ns()) == (5, 5)
    clock.sleep_until_ns(100)
    assert clock.now_ns() == 100


def test_a_jumping_clock_never_goes_back() -> None:
    clock = JumpingClock(50)
    clock.sleep_until_ns(20)
    assert clock.now_ns() == 50


def test_the_real_clock_is_the_machines_monotonic_one() -> None:
    before, told, after = time.monotonic_ns(), RealClock().now_ns(), time.monotonic_ns()
    assert before <= told <= after


def test_the_real_clock_sleeps_as_long_as_it_should_and_not_for_what_has_passed() -> None:
    clock = RealClock()
    until = clock.now_ns() + 2_000_000
    clock.sleep_until_ns(until)
    assert clock.now_ns() >= until
    clock.sleep_until_ns(0)
