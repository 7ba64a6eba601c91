"""The thread of a logger: it takes what comes, opens anew what fails, and never faster than it recovers."""

import dataclasses

import numpy as np
from scripted_loggers import INFO, STEP_NS, LoggerRun, readings_at
from simulated_time import START_NS

from grabberd.core.channels import Anomaly
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused, StreamEnded, StreamFailed
from grabberd.instrument.channels.logger_board import DOUBTFUL_NS

ABSENT = DeviceAbsent("there is no such port", "plug it in")
LOST = DeviceLost("it was unplugged", "plug it in")


def test_readings_of_its_channels_go_into_the_feed_in_their_order() -> None:
    run = LoggerRun(50, end_s=0.5)
    parts = run.parts
    assert sum(len(one.time_ns) for one in parts) == 50
    assert parts[0].values.tolist() == [[41.0, 40.0]]
    assert (run.board.now.state, run.board.now.readings) == ("ready", 50)
    assert run.logger.asked == ["open", "close"]


def test_one_that_is_absent_is_looked_for_every_second() -> None:
    run = LoggerRun(*[ABSENT] * 100, end_s=20)
    assert 18 <= run.logger.asked.count("open") <= 25
    assert run.told == ["absent: there is no such port"]
    assert run.board.now.hint == "plug it in"


def test_one_that_refuses_is_asked_every_ten_seconds_at_most() -> None:
    run = LoggerRun(*[DeviceRefused("it is in use", "end the other program")] * 100, end_s=100)
    assert 10 <= run.logger.asked.count("open") <= 16
    assert run.told == ["failed: it is in use"]


def test_one_that_was_unplugged_goes_on_when_it_is_back_and_the_gap_has_its_reason() -> None:
    run = LoggerRun(20, LOST, ABSENT, 20, end_s=3)
    assert run.told == ["ready", "absent: it was unplugged", "absent: there is no such port", "ready"]
    assert [one.interruption for one in run.parts if one.interruption] == ["unplugged", "unplugged"]
    assert run.board.now.openings == 2


def test_silence_is_a_failure_and_it_is_opened_anew() -> None:
    run = LoggerRun(20, end_s=6)
    assert run.told[:2] == ["ready", "failed: no reading for 3 s"]
    assert run.logger.asked[:3] == ["open", "close", "open"]


def test_a_slow_logger_may_be_silent_for_longer() -> None:
    run = LoggerRun(1, end_s=15, info=dataclasses.replace(INFO, rate_hz=0.5))
    assert run.told == ["ready"]


def test_a_fault_of_the_driver_does_not_end_the_thread() -> None:
    run = LoggerRun(5, ValueError("a bug"), 5, end_s=3)
    assert run.told[:3] == ["ready", "failed: ValueError: a bug", "ready"]
    assert run.board.now.readings == 10


def test_a_recording_that_has_ended_is_not_opened_again() -> None:
    run = LoggerRun(5, StreamEnded("no further reading", "start it again"), end_s=30)
    assert run.logger.asked == ["open", "close"]
    assert run.told == ["ready", "ended: no further reading"]


def test_a_column_that_is_not_there_is_named_with_those_that_are() -> None:
    run = LoggerRun(5, end_s=0.4, info=dataclasses.replace(INFO, channels=("p1", "x", "y")))
    assert run.told == ["failed: pulsation: the logger has no column p2; it has p1, x, y"]


def test_a_logger_that_states_another_unit_is_refused() -> None:
    run = LoggerRun(5, end_s=0.4, info=dataclasses.replace(INFO, units=("kPa", "mbar", None)))
    assert run.told == ["failed: pulsation: the logger states mbar for p2, the configuration kPa"]


def test_another_unit_is_told_by_its_magnitude_and_left_out() -> None:
    run = LoggerRun(readings_at([START_NS], kpa=420.0), 5, end_s=0.5)
    (first, *_) = run.parts
    assert first.values.tolist() == [[421.0, 420.0]]
    assert np.isnan(first.kpa).all()
    assert [(one.reason, one.lost) for one in first.anomalies] == [("an impossible vacuum", 1)] * 2


def test_readings_are_as_much_earlier_as_they_come_late() -> None:
    run = LoggerRun(50, end_s=0.5, delay_ms=30)
    times = np.concatenate([one.time_ns for one in run.parts])
    assert (np.diff(times) == STEP_NS).all()
    assert times[0] == START_NS + STEP_NS - 30_000_000


def test_nonsense_is_told_for_some_seconds_and_counted_for_ever() -> None:
    nonsense = readings_at([], Anomaly(START_NS, "not a number", "4x2", 1))
    run = LoggerRun(nonsense, 5, nonsense, 2000, end_s=0.1)
    assert run.board.now.doubt is not None
    run = LoggerRun(nonsense, 5, nonsense, 2000, end_s=DOUBTFUL_NS / 1e9 + 1)
    assert run.board.now.doubt is None
    assert [one[1:4] for one in run.board.now.anomalies] == [("not a number", 2, 2)]


def test_a_driver_that_gives_times_of_the_future_keeps_the_thread_going() -> None:
    run = LoggerRun(5, readings_at([START_NS + 10**18]), 5, end_s=0.5)
    times = np.concatenate([one.time_ns for one in run.parts])
    assert len(times) == 10
    assert (np.diff(times) == STEP_NS).all()


def test_a_refusal_after_a_failure_has_its_own_cause() -> None:
    run = LoggerRun(5, StreamFailed("it does not answer", "look"), DeviceRefused("busy", "x"), end_s=1.2)
    assert run.told[1:3] == ["failed: it does not answer", "failed: busy"]
    assert run.board.now.code in (Cause.DEVICE_REFUSED, None)
