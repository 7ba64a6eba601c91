"""A light that is switched here says when: every switching lies between the two readings round it."""

from itertools import cycle

import numpy as np
import pytest

from drivers.loggers.light_lines import light_on
from grabberd.core.channels import Dating, Readings
from grabberd.errors import DeviceLost
from grabberd.testing import ManualClock
from grabberd_loggers.light.switched_light import (
    BIT_NS,
    OTHER_HAND,
    SLOW,
    SLOW_NS,
    STEP_NS,
    Found,
)

TAKES_NS = 800_000


class Lamp:
    """A line that takes a while to be switched, and knows when it was: half of the way in."""

    driver = "bench"

    def __init__(self, clock: ManualClock, takes_ns: int = TAKES_NS) -> None:
        self.clock, self.takes_ns = clock, takes_ns
        self.on = False
        self.switched_ns: list[int] = []
        self.gone = False

    def open(self) -> Found:
        self.on = False
        return Found("bench lamp", {"line": "7"}, 30_000)

    def switch(self, on: bool) -> None:
        self.clock.time_ns += self.takes_ns // 2
        self.on = on
        self.switched_ns.append(self.clock.time_ns)
        self.clock.time_ns += self.takes_ns - self.takes_ns // 2

    def is_on(self) -> bool:
        if self.gone:
            raise DeviceLost("it is gone", "plug it in")
        return self.on

    def close(self) -> None:
        self.on = False


class Run:
    """A light that was switched for a while, by a pattern that is repeated."""

    def __init__(self, pattern: str = "10", takes_ns: int = TAKES_NS) -> None:
        self.clock = ManualClock()
        self.lamp = Lamp(self.clock, takes_ns)
        states = cycle(one == "1" for one in pattern)
        self.light = light_on(self.lamp, self.clock, lambda: next(states))
        self.info = self.light.open()
        self.start_ns = self.clock.time_ns
        self.parts: list[Readings] = []

    def read(self, seconds: float) -> "Run":
        end_ns = self.clock.time_ns + round(seconds * 1e9)
        while self.clock.time_ns < end_ns:
            self.parts.append(self.light.read(0.1))
        return self

    @property
    def time_ns(self) -> np.ndarray:
        return np.concatenate([part.time_ns for part in self.parts])

    @property
    def states(self) -> np.ndarray:
        return np.concatenate([part.values[:, 0] for part in self.parts])


def test_each_switching_lies_between_the_readings_round_it() -> None:
    run = Run("110100").read(5.0)
    changes = np.flatnonzero(np.diff(run.states))
    before, after = run.time_ns[changes], run.time_ns[changes + 1]
    assert len(changes) == len(run.lamp.switched_ns) > 20
    assert (before < run.lamp.switched_ns).all()
    assert (run.lamp.switched_ns < after).all()
    assert (after - before == TAKES_NS).all()
    assert {part.time_sigma_ns for part in run.parts if len(part.time_ns)} <= {
        1_000,
        round(TAKES_NS / np.sqrt(12)),
    }


def test_it_is_switched_at_bits_that_do_not_keep_step_with_fields() -> None:
    run = Run().read(3.0)
    bits = (np.array(run.lamp.switched_ns) - TAKES_NS // 2 - run.start_ns) / BIT_NS
    assert bits == pytest.approx(np.arange(1, len(bits) + 1))


def test_in_between_its_state_is_told_every_ten_milliseconds() -> None:
    run = Run("1111100000").read(3.0)
    assert np.median(np.diff(run.time_ns)) == STEP_NS
    assert np.diff(run.time_ns).max() < 1.6 * STEP_NS
    assert (np.diff(run.time_ns) > 0).all()


def test_by_itself_it_goes_by_chance_and_never_repeats() -> None:
    clock = ManualClock()
    lamp = Lamp(clock)
    light = light_on(lamp, clock)
    light.open()
    end_ns = clock.time_ns + 400 * BIT_NS
    while clock.time_ns < end_ns:
        light.read(0.1)
    assert 120 < len(lamp.switched_ns) < 280
    bits = np.diff(np.rint(np.array(lamp.switched_ns) / BIT_NS)).astype(int)
    assert len(set(bits.tolist())) > 3


def test_it_says_what_its_times_go_by() -> None:
    info = Run().info
    assert (info.channels, info.units, info.dating) == (("light",), (None,), Dating.MONOTONIC)
    assert (info.driver, info.model, info.delay_sigma_ns) == ("bench", "bench lamp", 30_000)


def test_somebody_else_who_switches_it_is_named_and_nothing_is_said_of_the_time_before() -> None:
    run = Run("1").read(0.3)
    run.lamp.on = False
    told = run.light.read(0.1)
    assert [(one.reason, one.example) for one in told.anomalies] == [(OTHER_HAND, "off")]
    assert told.values[:, 0].tolist() == [0.0, 1.0]
    assert run.light.read(0.1).anomalies == ()


def test_a_switching_that_takes_long_is_named_and_has_its_sigma() -> None:
    run = Run(takes_ns=2 * SLOW_NS)
    told = run.light.read(0.1)
    assert [(one.reason, one.example) for one in told.anomalies] == [(SLOW, "20.0 ms")]
    assert told.time_sigma_ns == pytest.approx(2 * SLOW_NS / np.sqrt(12), abs=1)


def test_a_computer_that_slept_says_nothing_of_that_time_and_leaves_bits_out() -> None:
    run = Run("10").read(1.0)
    before_ns = run.time_ns[-1]
    run.clock.time_ns += 60_000_000_000
    slept = run.light.read(0.1)
    assert slept.time_ns[0] - before_ns >= 60_000_000_000
    assert len(slept.time_ns) <= 2
    assert run.light._due_ns > run.clock.time_ns
    assert run.light._due_ns <= run.clock.time_ns + BIT_NS


def test_a_line_that_is_gone_says_so_and_what_came_before_stays_true() -> None:
    run = Run().read(0.5)
    run.lamp.gone = True
    with pytest.raises(DeviceLost):
        run.read(0.2)


def test_it_is_off_when_it_is_left() -> None:
    run = Run("1").read(0.3)
    assert run.lamp.on
    run.light.close()
    assert not run.lamp.on
