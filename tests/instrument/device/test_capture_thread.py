"""The capture thread over a scripted grabber: its states, its signal, what it asks of the device."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scripted import INFO, PERIOD_S, S, Scripted, run
from simulated_time import SMALL, START_NS, NoCaptures, Run, SimulatedClock

from grabberd.core.ledger import Outcome
from grabberd.errors import (
    Cause,
    DeviceAbsent,
    DeviceError,
    DeviceLost,
    DeviceRefused,
    PictureError,
    StreamEnded,
    StreamFailed,
)
from grabberd.instrument.acquisition import GrabbedField, Signal, StreamInfo
from grabberd.instrument.device.capture_thread import DEQUEUE_TIMEOUT_S, CaptureThread
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.instrument.device.status_board import StatusBoard
from grabberd.runtime import SystemClock


def test_it_is_ready_when_its_first_fields_have_their_numbers() -> None:
    one, _ = run(0, 200, end_s=2.0)
    assert one.states == [S.OPENING, S.READY]
    assert one.first(S.READY) == pytest.approx(DEQUEUE_TIMEOUT_S + 8 * PERIOD_S)


def test_fields_go_into_the_ring_in_order() -> None:
    one, _ = run(4, end_s=0.5)
    newest = one.pipeline.ring.newest
    assert newest
    assert newest.n == 3
    assert one.board.now.outcomes[Outcome.RECEIVED] == 4


def test_an_absent_device_is_absent_until_it_is_there_and_that_is_said_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO")
    one, _ = run(*[DeviceAbsent("not there", "plug it in")] * 9, 500, end_s=10.0)
    assert one.states == [S.OPENING, S.ABSENT, S.OPENING, S.READY]
    assert [record.message for record in caplog.records] == [
        "device test is absent: not there; plug it in",
        "device test is ready",
    ]


def test_a_device_that_says_no_has_failed_with_its_hint_and_is_tried_again() -> None:
    one, grabber = run(*[DeviceRefused("busy", "end that program", Cause.DEVICE_BUSY)] * 3, 10, end_s=2.0)
    assert one.states[:2] == [S.OPENING, S.FAILED]
    assert grabber.asked.count("open") == 3
    now = one.board.now
    assert (now.cause, now.hint, now.code) == ("busy", "end that program", Cause.DEVICE_BUSY)


def test_a_lost_device_is_closed_and_opened_again_but_not_restarted() -> None:
    one, grabber = run(2, DeviceLost("gone", ""), 100, end_s=1.0)
    assert one.states == [S.OPENING, S.READY, S.RECOVERING, S.OPENING, S.READY]
    assert "restart" not in grabber.asked
    assert grabber.asked.index("close", 1) < grabber.asked.index("open", 2)
    assert one.board.now.openings == 2


def test_a_stream_that_does_not_start_again_is_opened_again() -> None:
    for refusal in (StreamFailed("does not start", ""), DeviceRefused("another picture", "")):
        one, grabber = run(2, StreamFailed("no buffer", ""), refusal, 100, end_s=1.0)
        assert [asked for asked in grabber.asked if asked != "close"] == ["open", "restart", "open"]
        assert one.states[-1] is S.READY


def test_a_device_is_always_closed_before_it_is_opened() -> None:
    errors = [StreamFailed("a", ""), DeviceLost("b", ""), DeviceAbsent("c", ""), DeviceRefused("d", "")]
    _, grabber = run(*(item for error in errors for item in (error, 2)), end_s=100.0)
    before = [grabber.asked[i - 1] for i, asked in enumerate(grabber.asked) if asked == "open"]
    assert set(before) <= {"close", "reset"}
    assert all(grabber.asked[i - 1] == "close" for i, asked in enumerate(grabber.asked) if asked == "reset")
    assert grabber.asked[-1] == "close"


def test_it_is_closed_before_the_wait_for_its_return() -> None:
    one, grabber = run(2, DeviceLost("gone", ""), *[DeviceAbsent("not there", "")] * 2)
    assert grabber.asked[:7] == ["close", "open", "close", "close", "open", "close", "close"]
    assert S.ABSENT in one.states


def test_no_field_for_eight_tenths_of_a_second_is_a_failure_noticed_within_one() -> None:
    one, _ = run(10)
    stalled_s = 10 * PERIOD_S
    noticed_s = one.first(S.RECOVERING) - stalled_s
    assert 0.8 <= noticed_s < 0.9
    assert one.board.now.last_failure == "no field for 0.8 s"


def test_a_computer_that_stood_still_is_not_taken_for_a_grabber_that_did() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, 10, 0, 100)
    dequeue = grabber.dequeue

    @contextmanager
    def after_a_pause(timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        stood_still = grabber.script[:1] == [0]
        with dequeue(timeout_s) as fields:
            clock.sleep(5.0 if stood_still else 0.0)
            yield fields

    grabber.dequeue = after_a_pause  # type: ignore[method-assign]
    assert S.RECOVERING not in Run(grabber, clock, 7.0).states


def test_without_a_camera_a_grabber_that_delivers_nothing_is_not_helped() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, 5)
    grabber.reading = Signal.ABSENT
    one = Run(grabber, clock, 60.0)
    assert one.states == [S.OPENING, S.NO_SIGNAL]
    assert one.recoveries == {}
    assert one.pipeline.interruption == "no signal"


def test_when_the_signal_is_back_but_no_field_it_is_helped() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, 5)
    grabber.signal = lambda: Signal.ABSENT if clock.passed_s < 10 else Signal.PRESENT  # type: ignore[method-assign]
    one = Run(grabber, clock, 20.0)
    assert 10.8 <= one.first(S.RECOVERING) <= 12.0


def test_a_decoder_that_takes_seconds_to_answer_is_asked_rarely() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, *[50] * 100)
    asked_s: list[float] = []

    def signal() -> Signal:
        asked_s.append(clock.passed_s)
        clock.sleep(2.0)
        return Signal.UNKNOWN

    grabber.signal = signal  # type: ignore[method-assign]
    Run(grabber, clock, 90.0)
    assert 2 <= len(asked_s) <= 4
    assert min(np.diff(asked_s)) >= 38.0


def test_a_recording_may_pause() -> None:
    one, _ = run(2, *[0] * 100, 2, StreamEnded("over", ""), end_s=60.0, info=replace(INFO, live=False))
    assert one.states == [S.OPENING, S.READY, S.ENDED]


def test_without_signal_the_state_says_so() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, 5)
    grabber.reading = Signal.ABSENT
    one = Run(grabber, clock, 0.2)
    assert one.states == [S.OPENING, S.NO_SIGNAL]
    assert one.board.now.outcomes[Outcome.NO_SIGNAL] == 5


def test_no_field_is_thrown_away_when_the_signal_is_back() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, 200)
    grabber.signal = lambda: Signal.ABSENT if 1.0 <= clock.passed_s < 1.5 else Signal.PRESENT  # type: ignore[method-assign]
    one = Run(grabber, clock, 3.0)
    without = [slot for slot in one.taken if slot.outcome is Outcome.NO_SIGNAL]
    assert without
    assert max(slot.time_ns for slot in without) <= START_NS + 1_500_000_000


def test_a_wait_ends_when_it_is_stopped() -> None:
    clock = SystemClock()
    board = StatusBoard("test", clock)
    grabber = Scripted(SimulatedClock(), *[DeviceRefused("busy", "")] * 1000)
    captures = NoCaptures(lambda _: None, lambda _: None)
    thread = CaptureThread("test", grabber, FieldPipeline(SMALL), board, clock, captures)
    thread.start()
    with board.changed:
        assert board.changed.wait_for(lambda: board.state is S.FAILED, 20.0)
    thread.stop()
    thread.join(20.0)
    assert not thread.is_alive()
    assert grabber.asked[-1] == "close"


def test_a_fault_of_the_program_does_not_end_the_thread_and_is_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    one, _ = run(1, ValueError("a fault"), 1, ValueError("a fault"), 100)
    assert one.board.now.outcomes[Outcome.RECEIVED] == 102
    assert caplog.text.count("the capture thread failed") == 1


def test_the_end_of_a_recording_is_told() -> None:
    for error in (StreamEnded("the script is over", ""), PictureError("torn", "")):
        one, _ = run(1, error)
        assert [ended.message for ended in one.ended] == [error.message]
        assert one.board.state is S.ENDED


def test_what_a_person_has_to_know_is_logged_once_and_stays() -> None:
    one, _ = run(5, DeviceLost("gone", ""), 5, end_s=0.5, info=replace(INFO, remarks=("25 Hz only",)))
    assert one.board.now.warnings == ("25 Hz only",)


def test_a_remark_is_logged_at_the_first_opening(caplog: pytest.LogCaptureFixture) -> None:
    run(5, DeviceLost("gone", ""), 5, end_s=0.5, info=replace(INFO, remarks=("25 Hz only",)))
    assert caplog.text.count("25 Hz only") == 1


def test_a_reset_that_is_refused_is_a_warning_and_the_device_is_opened_all_the_same(
    caplog: pytest.LogCaptureFixture,
) -> None:
    one, grabber = run(5, end_s=300.0)
    assert one.board.now.warnings == ()
    grabber = Scripted(SimulatedClock(), 5)
    grabber.reset = refuse  # type: ignore[method-assign]
    one = Run(grabber, grabber.clock, 300.0)
    assert one.board.now.warnings == ("no rights to reset it; install the udev rule",)
    assert one.recoveries["reset"] > 1
    assert caplog.text.count("no rights") == 1


def refuse() -> None:
    raise DeviceRefused("no rights to reset it", "install the udev rule")


def test_other_pictures_than_before_begin_a_new_ring_and_are_told() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, 5, DeviceLost("gone", ""), 10)
    opening = grabber.open

    def smaller() -> StreamInfo:
        info = opening()
        if grabber.asked.count("open") == 2:
            grabber.info = info = replace(INFO, field_rows=24, standard="NTSC")
        return info

    grabber.open = smaller  # type: ignore[method-assign]
    one = Run(grabber, clock, 0.25)
    (change,) = one.ended
    assert "NTSC 64 × 24" in change.message
    assert "not script PAL 64 × 32" in change.message
    newest = one.pipeline.ring.newest
    assert newest
    assert newest.n < 10, "numbered anew"
    assert newest.numbered
    assert newest.numbered.packed.rows == 24


def test_the_same_pictures_go_on_in_the_same_ring() -> None:
    one, _ = run(5, DeviceLost("gone", ""), 10, end_s=0.25)
    assert one.ended == []
    newest = one.pipeline.ring.newest
    assert newest
    assert newest.n >= 11


errors = st.sampled_from(
    [
        StreamFailed("a", ""),
        DeviceLost("b", ""),
        DeviceAbsent("c", ""),
        DeviceRefused("d", ""),
        DeviceError("e", ""),
        ValueError("f"),
    ]
)


@settings(max_examples=30)
@given(st.lists(errors | st.integers(0, 20), max_size=20))
def test_whatever_happens_no_state_follows_that_may_not_and_the_device_is_closed_at_the_end(
    script: list[Exception | int],
) -> None:
    one, grabber = run(*script, end_s=60.0)
    assert one.states[0] is S.OPENING
    assert grabber.asked[-1] == "close"
    assert not one.ended


@pytest.mark.parametrize(
    "script",
    [
        [10_000],
        [DeviceAbsent("not there", "")] * 10_000,
        [DeviceRefused("busy", "")] * 10_000,
        [StreamFailed("no buffer", "")] * 10_000,
        [5, StreamEnded("the end", "")],
        [],
    ],
    ids=["streaming", "absent", "refused", "failing", "ended", "silent"],
)
def test_it_beats_at_least_every_second_whatever_the_device_does(script: list[Exception | int]) -> None:
    one, _ = run(*script, end_s=100.0)
    assert len(one.beats_s) > 90
    assert max(np.diff([0.0, *one.beats_s])) <= 1.1


def test_it_beats_without_a_camera() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, 5)
    grabber.reading = Signal.ABSENT
    one = Run(grabber, clock, 60.0)
    assert one.states[-1] is S.NO_SIGNAL
    assert max(np.diff(one.beats_s)) <= 1.1
