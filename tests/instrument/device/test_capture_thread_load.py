"""The capture thread on a busy computer: what it says of late fields, and how far it may go to take them."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace

import numpy as np
import pytest
from scripted import INFO, PERIOD_S, S, Scripted
from simulated_time import SMALL, START_NS, NoCaptures, Run, SimulatedClock, Until

from grabberd.core.ledger import LossCause, Outcome
from grabberd.documents.enums import DeviceState
from grabberd.errors import Cause, DeviceRefused, StreamFailed
from grabberd.instrument.acquisition import GrabbedField, Policy
from grabberd.instrument.device.capture_thread import DEQUEUE_TIMEOUT_S, POLL_S, CaptureThread
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.instrument.device.scheduling import ThreadTimes
from grabberd.instrument.device.status_board import StatusBoard


def test_a_thread_that_had_no_processor_says_so_of_what_it_lost() -> None:
    clock, account = SimulatedClock(), Account()
    grabber = Scripted(clock, 50, 100)
    dequeue = grabber.dequeue

    @contextmanager
    def late(timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        if grabber.script == [100]:
            clock.sleep(1.2)
            account.waited_ns += 1_200_000_000
        with dequeue(timeout_s) as fields:
            yield fields

    grabber.dequeue = late  # type: ignore[method-assign]
    one = Run(grabber, clock, 4.0, account=account)
    (lost,) = one.lost
    assert lost.reason == "computer busy (waited 1.2 s for a processor)"
    held_up = 1  # the field after it may be from before the standstill
    assert one.board.now.losses == {LossCause.COMPUTER: lost.count, LossCause.UNKNOWN: held_up}
    shown = one.board.standstills.shown
    assert shown
    assert shown.code is Cause.COMPUTER_BUSY


def test_a_thread_that_fell_behind_has_measuring_give_way_for_a_second() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, 20, 100)
    dequeue = grabber.dequeue

    @contextmanager
    def late(timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        if grabber.script == [100]:
            clock.sleep(0.3)
        with dequeue(timeout_s) as fields:
            yield fields

    grabber.dequeue = late  # type: ignore[method-assign]
    shedding = Run(grabber, clock, 1.3).pipeline.shedding
    late_s = START_NS / 1e9 + DEQUEUE_TIMEOUT_S + 20 * PERIOD_S + 0.3
    assert shedding.pause_s(round((late_s + 0.9) * 1e9)) > 0
    assert shedding.pause_s(round((late_s + 1.1) * 1e9)) == 0


@pytest.mark.parametrize("live", [True, False], ids=["a camera", "a recording"])
def test_real_time_is_asked_for_once_and_only_for_a_camera(
    live: bool, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    clock, account = SimulatedClock(), Account()
    grabber = Scripted(clock, 5, StreamFailed("no buffer", ""), 100, info=replace(INFO, live=live))
    Run(grabber, clock, 1.0, account=account)
    assert grabber.asked.count("restart") == 1
    assert account.asked_to_come_first == live
    assert caplog.text.count("device test: fields are taken in turn") == live


def test_a_thread_that_may_not_come_first_warns_of_it_in_the_devices_status() -> None:
    class Refused(Account):
        def come_first(self) -> str:
            raise DeviceRefused("fields are not taken in real time", "permit it")

    clock = SimulatedClock()
    board = Run(Scripted(clock, 5), clock, 0.3, account=Refused()).board
    assert board.now.warnings == ("fields are not taken in real time; permit it",)
    assert board.state is DeviceState.READY


def test_a_device_that_does_not_wait_for_a_field_is_asked_with_pauses_and_given_up() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, 5)
    dequeue, asked_s = grabber.dequeue, []

    @contextmanager
    def at_once(timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        asked_s.append(clock.passed_s)
        with dequeue(timeout_s) if grabber.script else nullcontext([]) as fields:
            yield fields

    grabber.dequeue = at_once  # type: ignore[method-assign]
    one = Run(grabber, clock, 1.0)
    assert one.states[:3] == [S.OPENING, S.READY, S.RECOVERING]
    assert np.diff(asked_s).min() == pytest.approx(POLL_S)


def test_a_thread_that_takes_too_much_in_real_time_says_that_it_runs_like_others_again(
    caplog: pytest.LogCaptureFixture,
) -> None:
    clock, account = SimulatedClock(), Account()
    account.says = "like others"
    Run(Scripted(clock, 50), clock, 0.9, account=account)
    assert "device test: fields are taken like others" in caplog.text


class SlowReader(Until):
    """Reads one field of the ring at every other pause of the capture thread, and never else."""

    def __init__(self, clock: SimulatedClock, end_s: float, pipeline: FieldPipeline) -> None:
        super().__init__(clock, end_s)
        self.reader = pipeline.ring.reader(Policy.COUNT)
        self.pauses = 0

    def wait(self, timeout: float | None = None) -> bool:
        if timeout != POLL_S:
            return super().wait(timeout)
        self.pauses += 1
        if self.pauses % 2 == 0:
            self.reader.take(0.0)
        return self.is_set()  # no time passes: fields come as regularly as ever


def test_fields_that_have_waited_are_taken_no_faster_than_the_ring_is_read() -> None:
    clock = SimulatedClock()
    grabber = Scripted(clock, 200)
    grabber.found_empty = False
    pipeline, board = FieldPipeline(SMALL), StatusBoard("test", clock)
    stopping = SlowReader(clock, 4.0, pipeline)
    captures = NoCaptures(lambda _: None, lambda _: None)
    CaptureThread("test", grabber, pipeline, board, clock, captures, stopping).run()
    assert board.now.outcomes[Outcome.RECEIVED] > 4 * pipeline.ring.slots
    assert pipeline.ring.slots // 2 <= stopping.reader.deepest < pipeline.ring.slots


class Account:
    """An account of a thread that waits when the test says so."""

    waited_ns = 0
    asked_to_come_first = 0
    says = ""

    def thread(self) -> ThreadTimes:
        return ThreadTimes(0, self.waited_ns)

    def come_first(self) -> str:
        self.asked_to_come_first += 1
        return "in turn"

    def keep_to_share(self, now_ns: int) -> str:
        return self.says

    def program_ns(self) -> int:
        return 0
