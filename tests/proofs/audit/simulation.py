"""A capture in simulated time; capture thread, content checks, numbering, ring and recorder are real."""

from simulated_time import SMALL, NoCaptures, SimulatedClock, Until

from grabberd.config import RingConfig
from grabberd.core.ledger import Slot
from grabberd.instrument.acquisition import Backlog, RingReader, StreamInfo
from grabberd.instrument.capture.recorder import Begin, Recorder
from grabberd.instrument.device.capture_thread import CaptureThread
from grabberd.instrument.device.field_pipeline import ARRIVALS, FieldPipeline
from grabberd.instrument.device.status_board import StatusBoard

from .grabber import AuditedGrabber
from .weather import Case

_AFTER_S, _AFTER_TURNS = 1.5, 40
"""Time after the stop for fields on their way, and for explanations, and turns of the program in which none
waited any more: one that comes round seldom has not yet taken all that were exposed before the stop."""
_CONFIG = SMALL.model_copy(update={"ring": RingConfig(bits=8, lines="field", slots=4096)})
"""The recorder is never overrun: it has its own tests."""


class Simulation:
    """One run of a case, in one thread: each time that the capture thread comes round, the recorder does.

    Attributes:
        grabber: With what is true.
        slots: All fields of the stream, as they were entered, in the order in which they were handed over.
        arrived_ns: When each of them was.
        recorder: Of the capture; `recorded`: what it keeps.
        start_ns, stop_ns: When the capture was asked for, and stopped; 0 if it was not.
        begins_with_the_ring: True if the ring had a field when it was asked for.
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.clock = SimulatedClock()
        self.clock.ns += case.seed % 1000 * 123_457_000
        self.begin_ns = self.clock.ns
        self.grabber = AuditedGrabber(case.weather, self.clock, case.seed)
        self.slots: list[Slot] = []
        self.arrived_ns: list[int] = []
        self.recorder: Recorder | None = None
        self.start_ns = self.stop_ns = 0
        self.begins_with_the_ring = False
        self._backlog: Backlog[Slot] = Backlog(10**7)
        self._pipeline = FieldPipeline(_CONFIG)
        self._board = StatusBoard("cup", self.clock)
        self._stopping = Until(self.clock, self.clock.passed_s + case.stop_s + 60.0)
        self._reader: RingReader | None = None
        self._turns_after = 0

    def run(self) -> None:
        """Runs until the capture is over."""
        self._board.beat = self._go_on  # type: ignore[method-assign]
        self._board.count = self._count  # type: ignore[method-assign]
        captures = NoCaptures(lambda _: None, lambda _: None)
        grabber = self.grabber
        CaptureThread(
            "cup", grabber, self._pipeline, self._board, self.clock, captures, self._stopping, grabber
        ).run()
        if self.recorder is not None:
            self.recorder.stop("stopped by the operator")
            self.recorder.run()

    @property
    def recorded(self) -> list[Slot]:
        """The fields of the capture."""
        return self._backlog.from_index(0, 0)

    @property
    def period_ns(self) -> int:
        """As the recorder has it."""
        return round(self.case.weather.period_ns)

    def _go_on(self) -> None:
        passed_s = (self.clock.ns - self.begin_ns) / 1e9
        stream, recorder = self._board.now.stream, self.recorder
        if recorder is None and passed_s >= self.case.start_s and stream:
            self._start(stream)
        elif recorder is not None and recorder.recording:
            if passed_s >= self.case.stop_s:
                self.stop_ns = self.clock.ns
                recorder.stop("stopped by the operator")
            else:
                self._take(recorder)
        elif recorder is not None:
            self._turns_after += not self.grabber.driver.filled
            after_s = passed_s - self.case.stop_s if self.stop_ns else _AFTER_S
            if after_s >= _AFTER_S and self._turns_after >= _AFTER_TURNS:
                self._stopping.set()

    def _count(self, slot: Slot) -> None:
        self.slots.append(slot)
        self.arrived_ns.append(int(self._pipeline.arrived_ns[slot.n % ARRIVALS]))

    def _take(self, recorder: Recorder) -> None:
        assert self._reader is not None
        while recorder.recording and (slot := self._reader.take(0)) is not None:
            recorder.take(slot)

    def _start(self, stream: StreamInfo) -> None:
        self.start_ns = self.clock.ns
        self._reader = reader = self._pipeline.ring.reader(back=self.case.pre_fields)
        self.begins_with_the_ring = reader.oldest is not None
        begin = Begin.of(reader, self.start_ns, self.case.pre_fields, self.period_ns)
        self.recorder = Recorder(
            reader, self._backlog, self.clock, stream, self._pipeline, self.case.fields, begin
        )
        taken = reader.take
        reader.take = lambda timeout_s: taken(0)  # type: ignore[method-assign]
