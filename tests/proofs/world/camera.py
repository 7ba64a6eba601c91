"""A camera and its grabber on the driver contract: pictures are numbers, and the truth about each is known.

Field k is exposed at `begin + k * period` of the world's time. Its picture is 8 × 64 pixels of faint noise,
with the number k in its first row, as black and white pixels, which survives every number of bits. A grabber
holds what arrives in its buffers until it is taken; what finds them full, or no stream, is lost, and why is
kept.

Only what the contract lets a program know leaves this file otherwise than as `Truth`.
"""

from collections import deque
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.proofs.world.scheduler import Scheduler

from grabberd.core.field import BOTTOM, TOP, Field, FieldOrder, PackedField, unpack
from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd.instrument.acquisition.device import GrabbedField, Signal, StreamInfo

ROWS, COLUMNS, BITS, PICTURES = 8, 64, 32, 257
NOMINAL_NS = 20_000_000
_WEIGHTS = (1 << np.arange(BITS - 1, -1, -1)).astype(np.int64)


class Kind:
    """What happens to fields, or to their grabber, from one time to another."""

    LOST = "lost"
    """On the bus; a share of them, drawn for each."""
    STALL = "stall"
    """No fields, no error."""
    FAIL = "fail"
    """The stream fails; so does each attempt to start it until the end."""
    UNPLUGGED = "unplugged"
    NO_SIGNAL = "no signal"
    LATE = "late"
    """They arrive later."""


class Trouble(NamedTuple):
    """One of them: its share of fields, or by how much they are late."""

    kind: str
    begin_ns: int
    end_ns: int
    amount: float = 1.0


class Fate(NamedTuple):
    """Consecutive fields that did not come, and why."""

    first_k: int
    end_k: int
    why: str


@dataclass
class Truth:
    """What became of each field of a camera.

    Attributes:
        begin_ns: Exposure of field 0.
        period_ns: From field to field.
        missing: The fields that never reached the program, in order.
        taken: Number of fields that did.
    """

    begin_ns: int
    period_ns: int
    missing: list[Fate] = field(default_factory=list)
    taken: int = 0

    def exposed_ns(self, k: int) -> int:
        """Middle of a field's exposure."""
        return self.begin_ns + k * self.period_ns

    def miss(self, k: int, why: str) -> None:
        """Field k will not come."""
        if self.missing and self.missing[-1].end_k == k and self.missing[-1].why == why:
            self.missing[-1] = self.missing[-1]._replace(end_k=k + 1)
        else:
            self.missing.append(Fate(k, k + 1, why))

    def missing_between(self, first_k: int, end_k: int) -> set[int]:
        """Numbers of the fields that never came."""
        runs = (one for one in self.missing if one.first_k < end_k and one.end_k > first_k)
        return {k for one in runs for k in range(max(one.first_k, first_k), min(one.end_k, end_k))}


class Driver(NamedTuple):
    """How the driver works.

    Attributes:
        buffers: Fields that it holds.
        counts: True if its count tells of losses.
        stamps_arrival: True if times are those of arrival.
        jitter_ns: Standard deviation of its times.
        latency_ns: From exposure to arrival.
    """

    buffers: int = 16
    counts: bool = True
    stamps_arrival: bool = False
    jitter_ns: int = 200_000
    latency_ns: int = 22_000_000


class _Waiting(NamedTuple):
    k: int
    time_ns: int
    sequence: int | None


class _Block(AbstractContextManager[Sequence[GrabbedField]]):
    """The fields of a dequeue."""

    def __init__(self, fields: Sequence[GrabbedField]) -> None:
        self._fields = fields

    def __enter__(self) -> Sequence[GrabbedField]:
        return self._fields

    def __exit__(self, *_: object) -> None:
        pass


class Camera:
    """A grabber with its camera.

    Args:
        scheduler: Time, and chance.
        driver: How it works.
        ppm: By how much its pace is off.

    Attributes:
        truth: What became of its fields.
        troubles: What goes wrong, in any order.
        driver: How it works.
    """

    called_ns = 0

    def __init__(self, scheduler: Scheduler, driver: Driver, ppm: float = 0.0) -> None:
        self.driver, self._scheduler, self._random = driver, scheduler, scheduler.random
        period_ns = round(NOMINAL_NS * (1 - ppm * 1e-6))
        self.truth = Truth(scheduler.now_ns + int(self._random.random() * period_ns), period_ns)
        self.troubles: list[Trouble] = []
        noise = np.random.default_rng(self._random.getrandbits(32))
        self._pictures = noise.integers(80, 110, (PICTURES, ROWS, COLUMNS), np.uint8)
        self._waiting: deque[_Waiting] = deque()
        self._next_k = 0
        self._sequence = 0
        self._is_open = False
        self._failed = False
        self._since_ns = 0
        self.found_empty = True

    # What happens

    def _trouble(self, now_ns: int, kind: str) -> Trouble | None:
        for one in self.troubles:
            if one.kind == kind and one.begin_ns <= now_ns < one.end_ns:
                return one
        return None

    @property
    def late(self) -> list[Trouble]:
        """Times in which its fields came later."""
        return [one for one in self.troubles if one.kind == Kind.LATE]

    def _arrival_ns(self, k: int) -> int:
        exposed_ns = self.truth.exposed_ns(k)
        late = self._trouble(exposed_ns, Kind.LATE) if self.troubles else None
        return exposed_ns + self.driver.latency_ns + (round(late.amount * 1e9) if late else 0)

    def _come(self, now_ns: int) -> None:
        """All that has arrived by now."""
        while (arrival_ns := self._arrival_ns(self._next_k)) <= now_ns:
            self._arrive(self._next_k, arrival_ns)
            self._next_k += 1

    def _arrive(self, k: int, arrival_ns: int) -> None:
        if (why := self._why_not(k)) is not None:
            self.truth.miss(k, why)
            if self._is_open and why == Kind.LOST and self.driver.counts:
                self._sequence += 1
            return
        driver = self.driver
        time_ns = arrival_ns if driver.stamps_arrival else self.truth.exposed_ns(k)
        time_ns += round(self._random.gauss(0.0, driver.jitter_ns))
        sequence = self._sequence if driver.counts else None
        self._sequence += 1
        if len(self._waiting) >= driver.buffers:
            self.truth.miss(k, "buffers full")
        else:
            self._waiting.append(_Waiting(k, min(time_ns, arrival_ns), sequence))

    def _why_not(self, k: int) -> str | None:
        exposed_ns = self.truth.exposed_ns(k)
        if not self._is_open or self._failed or exposed_ns < self._since_ns:
            return "no stream"
        if not self.troubles:
            return None
        for kind in (Kind.UNPLUGGED, Kind.FAIL, Kind.STALL, Kind.NO_SIGNAL):
            if self._trouble(exposed_ns, kind):
                return kind
        lost = self._trouble(exposed_ns, Kind.LOST)
        return Kind.LOST if lost is not None and self._random.random() < lost.amount else None

    # The contract

    def open(self) -> StreamInfo:
        self._check_there()
        self._come(self._scheduler.now_ns)
        self._scheduler.sleep(0.05)
        self._come(self._scheduler.now_ns)
        self._is_open, self._failed, self._sequence = True, False, 0
        self._since_ns = self._scheduler.now_ns
        return self._info()

    def restart(self) -> StreamInfo:
        if not self._is_open:
            raise DeviceLost("the camera is closed", "open it")
        self._check_there()
        self._stop()
        return self.open()

    def reset(self) -> None:
        self._check_there(failing=False)
        self._scheduler.sleep(1.0)

    def close(self) -> None:
        self._stop()

    def signal(self) -> Signal:
        return Signal.ABSENT if self._trouble(self._scheduler.now_ns, Kind.NO_SIGNAL) else Signal.PRESENT

    def dequeue(self, timeout_s: float) -> AbstractContextManager[Sequence[GrabbedField]]:
        scheduler = self._scheduler
        self._come(scheduler.now_ns)
        self.found_empty = not self._waiting
        end_ns = scheduler.now_ns + round(timeout_s * 1e9)
        while not self._waiting:
            self._check_streaming()
            if scheduler.now_ns >= end_ns:
                return _Block(())
            scheduler.sleep_until_ns(min(self._arrival_ns(self._next_k), end_ns))
            self._come(scheduler.now_ns)
        self._check_streaming()
        self.truth.taken += 1
        return _Block((self._grabbed(self._waiting.popleft()),))

    def _grabbed(self, one: _Waiting) -> GrabbedField:
        luma = self._pictures[one.k % PICTURES].copy()
        luma[0, :BITS] = np.unpackbits(np.frombuffer(one.k.to_bytes(4, "big"), np.uint8)) * 255
        return GrabbedField(Field.intact(luma, BOTTOM if one.k % 2 else TOP), one.time_ns, one.sequence, None)

    def _stop(self) -> None:
        self._come(self._scheduler.now_ns)
        for one in self._waiting:
            self.truth.miss(one.k, "stream stopped")
        self._waiting.clear()
        self._is_open = False

    def _check_there(self, *, failing: bool = True) -> None:
        now_ns = self._scheduler.now_ns
        if self._trouble(now_ns, Kind.UNPLUGGED):
            self._stop()
            raise DeviceAbsent("the camera is unplugged", "plug it in")
        if failing and self._trouble(now_ns, Kind.FAIL):
            self._stop()
            raise StreamFailed("the stream does not start", "reset it")

    def _check_streaming(self) -> None:
        now_ns = self._scheduler.now_ns
        if self._trouble(now_ns, Kind.UNPLUGGED):
            self._stop()
            raise DeviceLost("the camera was unplugged", "plug it in")
        if self._failed or self._trouble(now_ns, Kind.FAIL):
            self._failed = True
            raise StreamFailed("the stream has failed", "restart it")
        if not self._is_open:
            raise DeviceRefused("the camera is closed", "open it")

    def _info(self) -> StreamInfo:
        driver = self.driver
        return StreamInfo(
            driver="world",
            card="camera of the world",
            standard="PAL",
            columns=COLUMNS,
            field_rows=ROWS,
            rate_hz=50.0,
            field_order=FieldOrder.ALTERNATE,
            pixel_format="GREY",
            buffers=driver.buffers,
            live=True,
            counts_losses=driver.counts,
            tells_signal=True,
            time_sigma_ns=max(driver.jitter_ns, 100_000),
        )


def number_in(packed: PackedField) -> int:
    """The number in a picture."""
    row: NDArray[np.uint8] = unpack(packed).luma[0, :BITS]
    return int((row > np.uint8(127)) @ _WEIGHTS)
