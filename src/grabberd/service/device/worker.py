"""The worker: points of the newest fields for whoever watches, and of every field of a capture."""

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import NamedTuple

from grabberd.acquisition import Outcome, Policy
from grabberd.field import NumberedField
from grabberd.processes.measure import MeasuredField, MeasureSetup, measure_fields
from grabberd.service.capture.recording import Recording
from grabberd.service.clock import Clock
from grabberd.service.device.fair_lock import FairLock
from grabberd.service.device.field_pipeline import ARRIVALS, FieldPipeline
from grabberd.service.device.latency import Latency
from grabberd.service.device.rig_health import RigHealth

log = logging.getLogger(__name__)


IDLE_S = 0.1


class Live(NamedTuple):
    """The newest field that has been measured; `published_ns` by CLOCK_MONOTONIC."""

    measured: MeasuredField
    published_ns: int


class Worker(threading.Thread):
    """Measures the ring's fields, missing some when it is late; during a capture the recorded ones, missing
    none.

    A capture's points begin afresh with its first field, so that measuring its file again gives the same
    points.

    Without a setup it waits for one.

    Attributes:
        live: the newest measured field; `published` is notified with each.
        latency: from a field's arrival until its points were published.
        rig: whether camera and mirrors still are as they were calibrated.
    """

    def __init__(
        self,
        name: str,
        setup: MeasureSetup | None,
        intake: FieldPipeline,
        session: Callable[[], Recording | None],
        clock: Clock,
        turns: FairLock | None = None,
    ) -> None:
        super().__init__(name=f"worker-{name}", daemon=True)
        self.live: Live | None = None
        self.published = threading.Condition()
        self.latency = Latency()
        self.rig = RigHealth(name)
        self._setup = setup
        self._intake = intake
        self._session = session
        self._clock = clock
        self._turns = turns or FairLock()
        self._stopping = threading.Event()
        self._done: Recording | None = None

    def stop(self) -> None:
        """Ends the thread; a capture that is being measured is finished first."""
        self._stopping.set()

    def use(self, setup: MeasureSetup | None) -> None:
        """Measures with this from the next field on; not while a capture is being measured."""
        self._setup = setup

    def run(self) -> None:
        """Until stopped."""
        while not self._stopping.is_set() or self._waiting_session():
            session = self._waiting_session()
            try:
                self._measure_capture(session) if session else self._measure_ring()
            except Exception:
                log.exception("%s: measuring failed; it begins again", self.name)
                self._stopping.wait(1.0)

    def _waiting_session(self) -> Recording | None:
        """The running capture, unless it has been measured already or is not to be."""
        session = self._session()
        waits = session is not None and session.measured and session is not self._done
        return session if waits else None

    def _measure_capture(self, session: Recording) -> None:
        failure: str | None = "the program failed; the journal says how"
        first_n = self._first_n_of(session)
        try:
            assert self._setup is not None, "a capture is measured only where there is a setup"
            self.rig.begin(self._setup, capture=True)
            with closing(self._turns.of(session.recorded())) as fields:
                for measured in measure_fields(fields, self._setup):
                    session.add(measured)
                    self._publish(measured, first_n())
            failure = None
        finally:
            self._done = session
            session.measuring_ended(failure, self.rig.findings())

    def _first_n_of(self, session: Recording) -> Callable[[], int]:
        return lambda: session.recorder.first_n or 0

    def _measure_ring(self) -> None:
        setup = self._setup
        if setup is None:
            self._stopping.wait(IDLE_S)
            return
        self.rig.begin(setup)
        with closing(self._turns.of(self._ring_fields(setup))) as fields:
            for measured in measure_fields(fields, setup):
                self._publish(measured, 0)

    def _ring_fields(self, setup: MeasureSetup) -> Iterator[NumberedField]:
        """The ring's good fields until a capture begins, ring or setup are exchanged, or the worker is
        stopped.
        """
        with self._intake.armed.ring.reader(Policy.COUNT) as reader:
            while not (self._stopping.is_set() or self._waiting_session() or reader.ended):
                if self._setup is not setup:
                    return
                slot = reader.take(0.1)
                if slot is None or slot.numbered is None or slot.outcome is not Outcome.RECEIVED:
                    continue
                if _fits(setup, slot.numbered):
                    yield slot.numbered
                else:
                    self.live = None

    def _publish(self, measured: MeasuredField, first_n: int) -> None:
        now_ns = self._clock.now_ns()
        with self.published:
            self.live = Live(measured, now_ns)
            self.published.notify_all()
        arrived_ns = int(self._intake.arrived_ns[(measured.n + first_n) % ARRIVALS])
        self.latency.add(now_ns - arrived_ns)
        self.rig.see(measured)


def _fits(setup: MeasureSetup, numbered: NumberedField) -> bool:
    """Whether a field is of the size that the calibration is of; a device may grant another one meanwhile."""
    packed, calibration = numbered.packed, setup.calibration
    return (packed.columns, packed.rows * packed.y_step) == (calibration.columns, calibration.lines)
