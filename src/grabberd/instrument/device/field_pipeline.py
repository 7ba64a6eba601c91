"""Field pipeline: from a grabbed field to a slot of the ring, by number, lines, threshold and bits.

While the capture thread is behind the camera, fields are measured less often.
"""

import logging
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd import runtime
from grabberd.config import DeviceConfig
from grabberd.core.chain.mark_watch import REMEMBERED
from grabberd.core.field import PAL_HZ, FieldOrder, NumberedField, PackedField, Packing, pack
from grabberd.core.ledger import Outcome, Slot
from grabberd.core.measurement.marks import MarkLocator
from grabberd.errors import InputError
from grabberd.instrument.acquisition import (
    REPEATED,
    Content,
    ContentCheck,
    FieldNumbering,
    GrabbedField,
    Numbered,
    Ring,
    Signal,
    Standstill,
    StreamInfo,
)
from grabberd.instrument.device.threshold_keeper import NewestField, ThresholdKeeper

BEHIND_NS = 40_000_000
"""Smaller delays do not show a busy computer: its scheduler alone may cause them, at any rate."""
CALM_NS = 1_000_000_000
"""Time after the capture thread was last behind until every field is measured again."""
SPARE_S = 0.2
"""Pause after each field meanwhile: five fields per second are still shown."""


class Shedding:
    """Decides when the worker must leave the processor to the capture thread.

    A field that is not taken is lost, but a field that is not measured can be measured later from the file.
    Written by the capture thread, read by the worker.
    """

    def __init__(self) -> None:
        self._until_ns = 0

    def saw(self, behind_ns: int, now_ns: int) -> None:
        """Notes by how much the capture thread is behind the camera."""
        if behind_ns >= BEHIND_NS:
            self._until_ns = now_ns + CALM_NS

    def pause_s(self, now_ns: int) -> float:
        """Seconds that the worker has to wait before it measures another field."""
        return SPARE_S if now_ns < self._until_ns else 0.0


MARKS_KEPT = 1024
"""Fields whose marks are remembered for a capture that begins with one of them or later."""
ARRIVALS = 16384
"""Number of fields whose arrival is stored: those of a minute at 250 fields per second."""


log = logging.getLogger(__name__)

NOT_DOUBLED = "a progressive picture lacks no lines that could be doubled"
LEAST_SLOTS = 32
"""Slots of a ring (paper 3.4)."""


_AT_ONCE = 0.5
"""Periods after a field that has not waited within which no other of its parity can have come."""


class _Taken(NamedTuple):
    """Last field of a parity."""

    time_ns: int
    sequence: int | None
    arrived_ns: int
    in_time: bool


class _Unnumbered(NamedTuple):
    """A field that is packed for a ring, and waits for its number."""

    packed: PackedField
    sequence: int | None
    arrived_ns: int
    ring: Ring


class FieldPipeline:
    """Takes grabbed fields into the ring.

    A field whose number is in doubt is held until later ones have settled it; its slot then comes with
    theirs.

    Used by the capture thread alone, except for `configure_ring` and the attributes.

    Attributes:
        ring: The ring in use.
        thresholds: Keeper of the threshold in force.
        newest: Provides a copy of the newest field on request.
        arrived_ns: Times at which the latest fields arrived, by their number modulo `ARRIVALS`.
        interruption: Reason why no fields come, or None while they do.
        shedding: Whether fields should be measured less often for a while.
    """

    def __init__(self, config: DeviceConfig) -> None:
        bits, lines = config.ring.bits, config.ring.lines
        self._slots_asked, self._asks_for_doubled = config.ring.slots, lines == "doubled"
        self._slots = self._slots_at(PAL_HZ)
        self._interpolation = config.ring.interpolation
        self._configuring = runtime.lock()
        self._default = bits, lines or _default_lines(bits)
        self.ring = Ring(self._slots, *self._default)
        self.thresholds = ThresholdKeeper(config)
        self.newest = NewestField()
        places_px = [(mark.x_px, mark.y_px) for mark in config.marks]
        self._marks = MarkLocator(places_px) if places_px else None
        self._marks_seen: deque[tuple[int, int, NDArray[np.float32]]] = deque(maxlen=MARKS_KEPT)
        self.arrived_ns: NDArray[np.int64] = np.zeros(ARRIVALS, np.int64)
        self.interruption: str | None = None
        self.shedding = Shedding()
        self._granted: StreamInfo | None = None
        self._numbering: FieldNumbering | None = None
        self._unnumbered: deque[_Unnumbered] = deque()
        self._content: ContentCheck | None = None
        self._taken: dict[int, _Taken] = {}

    def configure_ring(self, bits: int | None, lines: str | None) -> Ring:
        """Provides the ring for these bits and lines; None: as configured.

        It is a new one if they differ from those in use; readers of the old one get its remaining slots.

        Raises:
            InputError: Lines are to be doubled, and the camera is progressive.
        """
        with self._configuring:
            progressive = self.is_progressive
            if lines == "doubled" and progressive:
                raise InputError(NOT_DOUBLED, "leave out 'lines'")
            default_bits, default_lines = self._default
            bits = bits or default_bits
            lines = lines or (default_lines if bits == default_bits else _default_lines(bits))
            lines = "field" if progressive else lines
            if (bits, lines) != (self.ring.bits, self.ring.lines):
                self._exchange(bits, lines)
            return self.ring

    def opened(self, info: StreamInfo, since_ns: int | None = None) -> str | None:
        """Notes that the device streams (again), and returns how its pictures differ from before, or None.

        No field was exposed before `since_ns`, when the stream was requested.

        Numbering continues across the gap. If the pictures differ, it starts again in a new ring.
        """
        change = _change(self._granted, info)
        self._taken.clear()
        if self._numbering is None or change:
            self._numbering = FieldNumbering(info, since_ns)
        else:
            self._numbering.resume(since_ns)
        lines = "field" if info.field_order is FieldOrder.PROGRESSIVE else self.ring.lines
        if lines != self.ring.lines and self._asks_for_doubled:
            log.warning("%s; 'ring.lines' of the configuration has no effect", NOT_DOUBLED)
        self._slots = self._slots_at(info.rate_hz)
        if change or (lines, self._slots) != (self.ring.lines, self.ring.slots):
            with self._configuring:
                self._exchange(self.ring.bits, lines)
        self._granted = info
        self._content = ContentCheck(rate_hz=info.rate_hz) if info.live else None
        self.thresholds.opened(live=info.live)
        return change

    @property
    def rate_hz(self) -> float:
        """Fields per second: as granted, or the camera's actual pace; nominal until the device has been
        opened.
        """
        return PAL_HZ if self._numbering is None else self._numbering.rate_hz

    @property
    def steady_hz(self) -> float | None:
        """Latest steady rate of a progressive camera; None if there was none."""
        return None if self._numbering is None else self._numbering.steady_hz

    @property
    def is_progressive(self) -> bool:
        """True if the device has granted pictures with all lines, which have no parity."""
        return self._granted is not None and self._granted.field_order is FieldOrder.PROGRESSIVE

    @property
    def no_picture(self) -> str | None:
        """The picture generated by the grabber in place of the camera's, or None."""
        return self._content.no_picture if self._content else None

    def settle(self) -> list[Slot]:
        """Numbers the fields in doubt by the present evidence, since no more will come."""
        return [] if self._numbering is None else self._release(self._numbering.settle())

    def interrupted(self, reason: str) -> list[Slot]:
        """Notes the reason for the fields that are lost from now on.

        Returns:
            The slots of the fields that were still in doubt, which are now in the ring.
        """
        released = [] if self._numbering is None else self._release(self._numbering.interrupt(reason))
        # Last: a capture that ends now takes the slots in the ring and then expects no more.
        self.interruption = reason
        return released

    def take(
        self,
        grabbed: GrabbedField,
        signal: Signal,
        now_ns: int,
        standstill: Standstill | None = None,
        *,
        in_time: bool = True,
        returned_ns: int | None = None,
    ) -> list[Slot]:
        """Numbers, quantises and packs a field and puts it into the ring as soon as its number is certain.

        Args:
            grabbed: The field.
            signal: The driver's last report.
            now_ns: Arrival.
            standstill: Time before it in which the program took no fields, or None.
            in_time: False if it may have waited in the driver's buffers.
            returned_ns: When the buffer before it was returned; None: just before it came.

        Returns:
            The slots that are in the ring now: none while the field is in doubt, several after that. There is
            none of a buffer that the driver hands over twice, since the camera has exposed nothing for it.
        """
        assert self._numbering is not None, "opened() comes first"
        self.interruption = None
        # Read once: a capture's start may replace the ring while this field is packed for the old one.
        ring = self.ring
        self.newest.offer(grabbed.field, ring, grabbed.time_ns)
        content, packed = self._packed(grabbed, signal, ring)
        if self._marks is not None:
            # On the grey field, before it is quantised: afterwards a mark at rest no longer averages.
            packed = packed.with_marks(self._marks.locate(grabbed.field))
        self._numbering.returned_ns = returned_ns
        if standstill is not None:
            self._numbering.stood_still(standstill.time_ns, standstill.reason)
            self._numbering.of_driver = standstill
        taken = _Taken(grabbed.time_ns, grabbed.sequence, now_ns, in_time)
        if self._is_handed_over_again(taken, grabbed.field.parity) and content.damage == REPEATED:
            self._numbering.skip(grabbed.field.parity, now_ns)
            return []
        self._unnumbered.append(_Unnumbered(packed, grabbed.sequence, now_ns, ring))
        return self._release(
            self._numbering.number(
                grabbed, signal, content.damage, now_ns, content.no_picture, in_time=in_time
            )
        )

    def _is_handed_over_again(self, taken: _Taken, parity: int) -> bool:
        """True if a field has the count of the last one of its parity; or, from a driver that does not count,
        its time, or comes at once after it although that one had not waited.
        """
        before, self._taken[parity] = self._taken.get(parity), taken
        if before is None or self._granted is None or before.sequence != taken.sequence:
            return False
        if 0 < taken.time_ns == before.time_ns or (
            self._granted.counts_losses and taken.sequence is not None
        ):
            return True
        apart_ns = taken.arrived_ns - before.arrived_ns
        return before.in_time and apart_ns < _AT_ONCE * 1e9 / self._granted.rate_hz

    def _release(self, numbered: Iterable[Numbered]) -> list[Slot]:
        return [self._put(self._unnumbered.popleft(), number) for number in numbered]

    def _put(self, waited: _Unnumbered, number: Numbered) -> Slot:
        # Before the slot is in the ring: a worker may have published its points by the time `put` returns.
        self.arrived_ns[number.n % ARRIVALS] = waited.arrived_ns
        slot = Slot(
            NumberedField(number.n, number.time_ns, waited.sequence, waited.packed),
            number.n,
            number.outcome,
            number.reason,
            number.lost_before,
            number.time_ns,
            number.rebases,
        )
        waited.ring.put(slot)
        packed = waited.packed
        if packed.marks is not None and number.outcome is Outcome.RECEIVED:
            self._marks_seen.append((number.n, packed.parity, packed.marks))
        return slot

    def marks_before(self, n: int) -> list[tuple[int, NDArray[np.float32]]]:
        """Parity and marks of the newest good fields before field `n`, as many as a watch remembers."""
        seen = [(parity, marks) for number, parity, marks in self._marks_seen.copy() if number < n]
        return seen[-REMEMBERED:]

    def _slots_at(self, rate_hz: float) -> int:
        """Slots of a ring at this rate: unless configured, they last as long as those of PAL."""
        return self._slots_asked or max(LEAST_SLOTS, round(LEAST_SLOTS / PAL_HZ * rate_hz))

    def _exchange(self, bits: int, lines: str) -> None:
        # Replaced before the old one is closed: the worker immediately asks for the ring in use.
        old, self.ring = self.ring, Ring(self._slots, bits, lines)
        old.close()

    def _packed(self, grabbed: GrabbedField, signal: Signal, ring: Ring) -> tuple[Content, PackedField]:
        """Packs a field; checks a live one, and first shows a recording's to the threshold keeper."""
        if self._content is not None:
            content, packed = self._content.take(grabbed, self._packing(ring))
            if signal is not Signal.ABSENT and content.no_picture is None:
                self.thresholds.show(grabbed.field, ring)
            return content, packed
        if signal is not Signal.ABSENT:
            self.thresholds.show(grabbed.field, ring)
        return Content(), pack(grabbed.field, self._packing(ring))

    def _packing(self, ring: Ring) -> Packing:
        # Missing lines are interpolated on the grey field, before the threshold (paper 3.3).
        level, by_pixel = self.thresholds.for_next_field()
        return Packing(ring.bits, ring.lines == "doubled", level, by_pixel, self._interpolation)


def _default_lines(bits: int) -> str:
    """Lines of a ring unless configured: doubled at 1 bit, intact for grey (paper 3.3)."""
    return "doubled" if bits == 1 else "field"


def _change(before: StreamInfo | None, now: StreamInfo) -> str | None:
    """Difference between the pictures of a stream and the previous one, in a sentence, or None."""
    if before is None or _pictures(before) == _pictures(now):
        return None
    return f"the grabber grants {_described(now)} now, not {_described(before)} as before"


def _pictures(info: StreamInfo) -> tuple[object, ...]:
    return (info.driver, info.standard, info.columns, info.field_rows, info.rate_hz, info.field_order)


def _described(info: StreamInfo) -> str:
    size = f"{info.columns} × {info.field_rows} at {info.rate_hz:g} Hz"
    return f"{info.driver} {info.standard} {size}, {info.field_order}"
