"""The worker: measures the newest fields for live display, and every field of a capture."""

import logging
from bisect import bisect_left
from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from grabberd import runtime
from grabberd.core.chain.measure import MeasuredField, MeasureSetup, Trackers, measure_fields
from grabberd.core.field import NumberedField
from grabberd.core.ledger import Outcome
from grabberd.core.measurement.marks import Located
from grabberd.core.reconstruction import Coverage, CoverageTally
from grabberd.instrument.acquisition import Policy
from grabberd.instrument.device.field_pipeline import ARRIVALS, FieldPipeline
from grabberd.instrument.device.field_watch import FieldHistory, FieldOrderHealth, RigHealth
from grabberd.runtime import UtcClock

PATIENCE_S = 0.05
"""Longest wait for the lock: a slow field of another worker delays this one by no more."""
T = TypeVar("T")
KEPT = 131_072
"""Ten minutes at 200 fields a second, rounded up to a power of two."""
BOUNDS_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.28)
"""Upper bounds of the histogram's bins; 32 slots of the ring last 0.64 s."""
log = logging.getLogger(__name__)
IDLE_S = 0.1
"""Longest wait for a field or a calibration before it checks for a capture, a new setup or a stop."""
NEWEST = 32
"""Fields by which a follower may be late: catching up a capture publishes a thousand per second."""
AFTER_FAULT_S = 1.0
"""Pause after a fault of the program, so that an immediate fault does not occupy the processor."""


class FairLock:
    """Lets one worker at a time measure a field.

    In one process only one thread runs Python at a time, and a thread that has waited for a device, a lock or
    the disk must acquire the interpreter again. Four workers catching up at once would leave a capture thread
    too little of it.
    """

    def __init__(self) -> None:
        self._lock = runtime.lock()

    def one_by_one(self, fields: Iterator[T]) -> Generator[T]:
        """The same fields; the lock is held while each is processed, but not while the next is awaited."""
        for field in fields:
            acquired = self._lock.acquire(timeout=PATIENCE_S)
            try:
                yield field
            finally:
                if acquired:
                    self._lock.release()


class Histogram(NamedTuple):
    """All latencies since the start.

    Attributes:
        counts: Number of latencies in each bin of `BOUNDS_S`, and beyond the last.
        sum_s: Their sum.
    """

    counts: tuple[int, ...]
    sum_s: float


class Latency:
    """The latest `KEPT` latencies, and a histogram of all."""

    def __init__(self) -> None:
        self._kept: NDArray[np.int64] = np.zeros(KEPT, np.int64)
        self._count = 0
        self._classes = [0] * (len(BOUNDS_S) + 1)
        self._sum_ns = 0
        self._lock = runtime.lock()

    def add(self, latency_ns: int) -> None:
        """Adds one field's latency."""
        with self._lock:
            self._kept[self._count % KEPT] = latency_ns
            self._count += 1
            self._classes[bisect_left(BOUNDS_S, latency_ns / 1e9)] += 1
            self._sum_ns += latency_ns

    @property
    def histogram(self) -> Histogram:
        """Histogram of all latencies since the start."""
        with self._lock:
            return Histogram(tuple(self._classes), self._sum_ns / 1e9)

    def milliseconds(self, latest: int = KEPT) -> NDArray[np.float64]:
        """(N,) float64, the newest latencies, at most `latest`, in no particular order."""
        with self._lock:
            count = min(self._count, latest, KEPT)
            index = (self._count - 1 - np.arange(count)) % KEPT
            return self._kept[index] / 1e6

    def percentiles_ms(self, latest: int = KEPT) -> dict[str, float] | None:
        """p50, p99 and max of the newest; None if there are none."""
        values = self.milliseconds(latest)
        if not len(values):
            return None
        ordered = np.sort(values)
        return {"p50": _quantile(ordered, 0.5), "p99": _quantile(ordered, 0.99), "max": float(ordered[-1])}


def _quantile(ordered: NDArray[np.float64], share: float) -> float:
    """Quantile of sorted values with linear interpolation; np.quantile would take four times as long."""
    place = share * (len(ordered) - 1)
    low = int(place)
    below, above = ordered[low], ordered[min(low + 1, len(ordered) - 1)]
    return float(below + (above - below) * (place - low))


class MeasurableRecording(Protocol):
    """A recording, as seen by the worker."""

    @property
    def awaits_measuring(self) -> bool:
        """True if its fields are to be measured, and have not been."""
        ...

    @property
    def first_n(self) -> int:
        """The stream's number of its first field."""
        ...

    def marks_before(self) -> Sequence[tuple[int, Located]]:
        """Parity and located marks of the fields before its first, once that has come."""
        ...

    def recorded(self) -> Iterator[NumberedField]:
        """Every good field in order, as they come, until the end."""
        ...

    def add(self, measured: MeasuredField) -> None:
        """Adds one field's points."""
        ...

    def measuring_ended(
        self, failure: str | None, findings: Mapping[str, Any] | None, coverage: Coverage | None
    ) -> None:
        """Ends its points, with the reason if they are incomplete, metadata, and the coverage."""
        ...


class WorkerCaptures(Protocol):
    """The captures of a device, as seen by its worker."""

    @property
    def recording(self) -> MeasurableRecording | None:
        """The running or the last capture."""
        ...

    @property
    def starting(self) -> MeasurableRecording | None:
        """The capture whose fields are taken already, while its file is made."""
        ...

    @property
    def is_recording(self) -> bool:
        """True if a capture is recording."""
        ...


class Live(NamedTuple):
    """The newest measured field.

    Attributes:
        measured: The field's points.
        published_ns: Time of publication, CLOCK_MONOTONIC.
        number: Number of fields published since the start, including this one.
    """

    measured: MeasuredField
    published_ns: int
    number: int


class Worker(runtime.Thread):
    """Measures the ring's fields, skipping some when it is late; during a capture all recorded ones.

    Measuring starts again with a capture's first field, so that measuring its file later gives the same
    points (docs/decisions/reconstruction.md). Without a setup it waits for one.

    Attributes:
        live: The newest measured field.
        published: Notified with each of them.
        latency: Latency from a field's arrival until its points were published.
        rig: Health of the rig: camera and mirrors compared with their calibration.
        field_order: Whether fields come in the order of their times.
        history: A few numbers of each measured field of the last minutes.
    """

    def __init__(
        self,
        name: str,
        setup: MeasureSetup | None,
        pipeline: FieldPipeline,
        captures: WorkerCaptures,
        clock: UtcClock,
        fair_lock: FairLock | None = None,
    ) -> None:
        super().__init__(name=f"worker-{name}", daemon=True)
        self.live: Live | None = None
        self.published = runtime.condition()
        self._newest: deque[Live] = deque(maxlen=NEWEST)
        self._number = 0
        self.latency = Latency()
        self.rig = RigHealth(name)
        self.field_order = FieldOrderHealth(name)
        self.history = FieldHistory()
        self._setup = setup
        self._trackers: Trackers | None = None
        self._pipeline = pipeline
        self._captures = captures
        self._clock = clock
        self._fair_lock = fair_lock or FairLock()
        self._stopping = runtime.event()

    def stop(self) -> None:
        """Ends the thread, after finishing a capture that is being measured."""
        self._stopping.set()

    def use(self, setup: MeasureSetup | None) -> None:
        """Measures with this setup from the next field on; not while a capture is being measured."""
        self._setup = setup

    def since(self, number: int) -> list[Live]:
        """Fields published after that number, the oldest first; call it with `published` held."""
        return [one for one in self._newest if one.number > number]

    def run(self) -> None:
        """Measures until stopped."""
        while not self._stopping.is_set() or self._unmeasured():
            recording = self._unmeasured()
            try:
                self._measure_capture(recording) if recording else self._measure_ring()
            except Exception:
                log.exception("%s: measuring failed; it begins again", self.name)
                self._stopping.wait(AFTER_FAULT_S)

    def _unmeasured(self) -> MeasurableRecording | None:
        """The running capture, unless it has been measured already or is not measured."""
        recording = self._captures.starting or self._captures.recording
        return recording if recording is not None and recording.awaits_measuring else None

    def _measure_capture(self, recording: MeasurableRecording) -> None:
        failure: str | None = "the program failed; the journal says how"
        coverage: Coverage | None = None
        try:
            assert self._setup is not None, "a capture is measured only where there is a setup"
            tally = CoverageTally(self._setup.calibration, self._setup.object_model)
            self.rig.begin(self._setup, capture=True)
            interlaced = not self._pipeline.is_progressive
            self.field_order.begin(self._setup, capture=True, interlaced=interlaced)
            with closing(self._paced(recording.recorded())) as fields:
                for measured in measure_fields(
                    fields,
                    self._setup,
                    tally,
                    before=lambda _: recording.marks_before(),
                    trackers=self._trackers_of(self._setup),
                ):
                    recording.add(measured)
                    self._publish(measured, self._setup, recording.first_n)
            coverage = tally.result()
            failure = None
        finally:
            # Also after a fault: the writer seals the capture only once its points have ended.
            findings = {**self.rig.findings(), **self.field_order.findings()}
            recording.measuring_ended(failure, findings, coverage)

    def _measure_ring(self) -> None:
        setup = self._setup
        if setup is None:
            self._stopping.wait(IDLE_S)
            return
        self.rig.begin(setup)
        self.field_order.begin(setup, interlaced=not self._pipeline.is_progressive)
        with closing(self._paced(self._ring_fields(setup))) as fields:
            trackers = self._trackers_of(setup)
            for measured in measure_fields(
                fields, setup, before=self._pipeline.marks_before, trackers=trackers
            ):
                self._publish(measured, setup, 0)

    def _trackers_of(self, setup: MeasureSetup) -> Trackers:
        """Trackers of a setup: those of the stream serve the next capture, whose first field is not late."""
        if self._trackers is None or self._trackers.setup is not setup:
            self._trackers = Trackers(setup)
        return self._trackers

    def _paced(self, fields: Iterator[NumberedField]) -> Generator[NumberedField]:
        """The same fields, taking turns with other devices' workers, and slower while capturing is behind."""
        return self._fair_lock.one_by_one(self._sparing(fields))

    def _sparing(self, fields: Iterator[NumberedField]) -> Iterator[NumberedField]:
        """The same fields, with a pause after each while the capture thread is behind."""
        for numbered in fields:
            yield numbered
            if (pause_s := self._pause_s()) > 0:
                self._stopping.wait(pause_s)

    def _pause_s(self) -> float:
        # After the recording, measuring cannot cost fields.
        takes_fields = self._captures.is_recording or self._captures.starting
        catches_up = self._unmeasured() is not None and not takes_fields
        return 0.0 if catches_up else self._pipeline.shedding.pause_s(self._clock.now_ns())

    def _ring_fields(self, setup: MeasureSetup) -> Iterator[NumberedField]:
        """The ring's good fields until a capture begins, ring or setup are replaced, or the worker is
        stopped.
        """
        with self._pipeline.ring.reader(Policy.COUNT) as reader:
            while not (self._stopping.is_set() or self._unmeasured() or reader.ended):
                if self._setup is not setup:
                    return
                slot = reader.take(IDLE_S)
                if slot is None or slot.numbered is None or slot.outcome is not Outcome.RECEIVED:
                    continue
                if _fits(setup, slot.numbered):
                    yield slot.numbered
                else:
                    self.live = None

    def _publish(self, measured: MeasuredField, setup: MeasureSetup, first_n: int) -> None:
        now_ns = self._clock.now_ns()
        with self.published:
            self._number += 1
            self.live = Live(measured, now_ns, self._number)
            self._newest.append(self.live)
            self.published.notify_all()
        # A capture counts fields from its own first one, the pipeline from that of the stream.
        arrived_ns = int(self._pipeline.arrived_ns[(measured.n + first_n) % ARRIVALS])
        self.latency.add(now_ns - arrived_ns)
        self.history.keep(self._pipeline.rate_hz)
        self.history.see(measured, setup, now_ns - arrived_ns)
        self.rig.see(measured)
        self.field_order.see(measured)


def _fits(setup: MeasureSetup, numbered: NumberedField) -> bool:
    """True if a field has the calibration's size, which the device may have changed meanwhile."""
    packed, calibration = numbered.packed, setup.calibration
    return (packed.columns, packed.rows * packed.y_step) == (calibration.columns, calibration.lines)
