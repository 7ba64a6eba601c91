"""A capture in simulated time; capture thread, ring, recorder and file are the real ones.

Nothing sleeps. The capture thread runs until its clock has come to the recorder's next deadline or a field is
in the ring; then the recorder runs until it waits.
"""

import threading
from dataclasses import asdict
from pathlib import Path

from simulated_time import SMALL, NoCaptures, SimulatedClock, Until

from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.config import RingConfig
from grabberd.core.ledger import Slot
from grabberd.instrument.acquisition import RingReader, StreamInfo
from grabberd.instrument.capture.edges import Begin, fields_before
from grabberd.instrument.capture.recorder import Backlog, Recorder
from grabberd.instrument.device.capture_thread import CaptureThread
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.instrument.device.scheduling import ThreadTimes
from grabberd.instrument.device.status_board import StatusBoard
from grabberd_fake import FakeGrabber
from grabberd_fake.faults import PERIOD_NS, Freeze
from recorded_world import RecordedWorld

from .cases import LASTS_S, Case

BITS = 8
AFTER_S = 20.0
"""Simulated time after the stop, for whatever recovers."""


class PausedGrabber(FakeGrabber):
    """A simulated grabber, and the kernel's account of the program that it keeps from running.

    A busy computer lets the program wait for a processor; a frozen one does neither run nor wait.
    """

    waited_ns = 0

    def _pause_program(self) -> None:
        is_busy = self._script.at(self._number_now(), Freeze) is None
        before_ns = self._clock.now_ns()
        super()._pause_program()
        self.waited_ns += (self._clock.now_ns() - before_ns) * is_busy

    def thread(self) -> ThreadTimes:
        """Times of the capture thread."""
        return ThreadTimes(0, self.waited_ns)

    def program_ns(self) -> int:
        """Processor time of the program, which nothing takes in simulated time."""
        return 0

    def come_first(self) -> str:
        """Nobody else is there."""
        return ""

    def keep_to_share(self, now_ns: int) -> str:
        """It takes no share."""
        return ""


class Turns:
    """Two threads that run by turns, never side by side."""

    def __init__(self) -> None:
        self._turn = {"camera": threading.Semaphore(0), "recorder": threading.Semaphore(0)}

    def hand_over(self, to: str, me: str) -> None:
        """Lets the other run until it hands back."""
        self._turn[to].release()
        self._turn[me].acquire()

    def wait(self, me: str) -> None:
        """Waits for the first turn."""
        self._turn[me].acquire()

    def leave(self, to: str) -> None:
        """Hands over for good."""
        self._turn[to].release()


class Simulation:
    """One run of a case.

    Attributes:
        recorder: Of the capture, once it has been asked for.
        start_ns, stop_ns: When the capture was asked for, and stopped.
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.clock = SimulatedClock()
        self.clock.ns += case.seed % 1000 * 123_457_000  # fields do not begin with the simulation
        self._begin_ns = self.clock.ns
        self._board = StatusBoard("cup", self.clock)
        self._stopping = Until(self.clock, self.clock.passed_s + LASTS_S + AFTER_S)
        ring = RingConfig(bits=BITS, lines="field")
        self.pipeline = FieldPipeline(SMALL.model_copy(update={"ring": ring}))
        self.recorder: Recorder | None = None
        self.backlog: Backlog[Slot] = Backlog(10_000)
        self.start_ns = self.stop_ns = 0
        self.before = 0
        self._recorded = False
        self._turns = Turns()

    def run(self) -> None:
        """Runs until the capture is over."""
        grabber = PausedGrabber(
            clock=self.clock,
            seed=self.case.seed,
            buffers=self.case.buffers,
            driver=self.case.driver,
            faults=self.case.faults,
        )
        grabber._pictures = RecordedWorld(grabber.options)
        self._board.beat = self._go_on  # type: ignore[method-assign]
        captures = NoCaptures(lambda _: None, lambda _: None)
        CaptureThread(
            "cup", grabber, self.pipeline, self._board, self.clock, captures, self._stopping, grabber
        ).run()
        assert self._recorded, "the capture has not ended"

    def write(self, path: Path) -> None:
        """Writes what was recorded as a capture file."""
        assert self.recorder is not None
        ledger, stream = self.recorder.ledger, self._board.now.stream
        assert stream is not None
        meta = CaptureMeta(
            id=path.stem,
            created_utc="2026-01-01T00:00:00.000Z",
            start_ns=self.start_ns,
            device={"name": "cup", "driver": "fake", "options": {}, "stream": asdict(stream)},
            config={},
            site={},
            labels={},
            note="",
            bits=BITS,
            lines="field",
            rate_hz=1e9 / PERIOD_NS,
            version="",
            extra={"trigger": {"n": self.before}},
        )
        writer = CaptureWriter.create(path.with_suffix(".grab.part"), meta)
        writer.append(self.backlog.from_index(0, 0))
        writer.seal(ledger, complete=ledger.complete, ended_because=self.recorder.ended_because or "")

    @property
    def _passed_s(self) -> float:
        return (self.clock.ns - self._begin_ns) / 1e9

    def _go_on(self) -> None:
        """What happens beside the capture thread, each time that it comes round."""
        if self.recorder is None and self._passed_s >= self.case.start_s and self._board.now.stream:
            self._start(self._board.now.stream)
        if self.recorder is not None and not self._recorded:
            if self.recorder.recording and self._passed_s >= self.case.stop_s:
                self.stop_ns = self.clock.ns
                self.recorder.stop("stopped by the operator")
            self._turns.hand_over("recorder", me="camera")
        if self._recorded:
            self._stopping.set()

    def _start(self, stream: StreamInfo) -> None:
        self.start_ns = self.clock.ns
        ring = self.pipeline.ring
        reader = ring.reader(back=self.case.pre_fields)
        begin = Begin.of(reader, self.start_ns, self.case.pre_fields, PERIOD_NS)
        self.before = fields_before(reader, ring.newest, begin, self.start_ns)
        self._wait_in_simulated_time(reader)
        fields, pipeline = self.case.fields, self.pipeline
        self.recorder = Recorder(reader, self.backlog, self.clock, stream, pipeline, fields, begin)
        threading.Thread(target=self._record, daemon=True).start()

    def _wait_in_simulated_time(self, reader: RingReader) -> None:
        taken = reader.take

        def take(timeout_s: float) -> Slot | None:
            deadline_ns = self.clock.ns + round(timeout_s * 1e9)
            while (slot := taken(0)) is None and self.clock.ns < deadline_ns and not reader.ended:
                self._turns.hand_over("camera", me="recorder")
            return slot

        reader.take = take  # type: ignore[method-assign]

    def _record(self) -> None:
        assert self.recorder is not None
        self._turns.wait("recorder")
        try:
            self.recorder.run()
        finally:
            self._recorded = True
            self._turns.leave("camera")
