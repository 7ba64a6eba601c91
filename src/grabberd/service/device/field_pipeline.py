"""From a grabbed field to a slot of the ring: number, lines, threshold, bits."""

import threading
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from grabberd.acquisition import (
    Content,
    ContentCheck,
    FieldNumbering,
    GrabbedField,
    Numbered,
    Outcome,
    Ring,
    Signal,
    Slot,
    StreamInfo,
)
from grabberd.config import DeviceConfig
from grabberd.field import NumberedField, double_lines, quantise
from grabberd.service.device.configured_ring import ConfiguredRing, default_lines
from grabberd.service.device.newest_field import NewestField
from grabberd.service.device.threshold_keeper import ThresholdKeeper

ARRIVALS = 4096


class FieldPipeline:
    """Used by the capture thread alone, but for `arm` and what it publishes.

    Attributes:
        armed: the ring in use.
        thresholds: the keeper of the threshold in force.
        newest: leaves a copy of the newest field for who asks.
        arrived_ns: when the latest fields arrived, by their number modulo `ARRIVALS`.
        interruption: why no fields come, or None while they do.
    """

    def __init__(self, config: DeviceConfig) -> None:
        bits = config.ring.bits
        self._slots = config.ring.slots
        self._interpolation = config.ring.interpolation
        self._arming = threading.Lock()
        self.armed = self._configured = ConfiguredRing(
            Ring(self._slots), bits, config.ring.lines or default_lines(bits)
        )
        self.thresholds = ThresholdKeeper(config)
        self.newest = NewestField()
        self.arrived_ns: NDArray[np.int64] = np.zeros(ARRIVALS, np.int64)
        self.interruption: str | None = None
        self._granted: StreamInfo | None = None
        self._numbering: FieldNumbering | None = None
        self._content: ContentCheck | None = None

    def arm(self, bits: int | None, lines: str | None) -> ConfiguredRing:
        """The ring for these bits and lines, the configured ones where none are given."""
        with self._arming:
            bits = bits or self._configured.bits
            lines = lines or (
                self._configured.lines if bits == self._configured.bits else default_lines(bits)
            )
            if (bits, lines) != (self.armed.bits, self.armed.lines):
                old, self.armed = self.armed, ConfiguredRing(Ring(self._slots), bits, lines)
                old.ring.close()
            return self.armed

    def opened(self, info: StreamInfo) -> str | None:
        """The device streams (again). Numbering goes on through the gap, unless other pictures come than
        before: then it begins anew in a new ring, and what has changed is returned.
        """
        change = _change(self._granted, info)
        if self._numbering is None or change:
            self._numbering = FieldNumbering(info)
        if change:
            self._renew_ring()
        self._granted = info
        self._content = ContentCheck() if info.live else None
        self.thresholds.opened(live=info.live)
        return change

    @property
    def no_picture(self) -> str | None:
        """What the grabber makes up in place of a camera's picture, if it has for a while."""
        return self._content.no_picture if self._content else None

    def interrupted(self, reason: str) -> None:
        """Fields that do not come from now on are lost for this reason."""
        self.interruption = reason
        if self._numbering is not None:
            self._numbering.interrupt(reason)

    def take(self, grabbed: GrabbedField, signal: Signal, now_ns: int) -> Slot:
        """Numbers, quantises and packs a field and puts it into the ring."""
        assert self._numbering is not None, "opened() comes first"
        self.interruption = None
        content = self._content.look(grabbed) if self._content else Content()
        number = self._numbering.number(grabbed, signal, content.damage, now_ns, content.no_picture)
        self.arrived_ns[number.n % ARRIVALS] = now_ns
        armed = self.armed
        self.newest.offer(grabbed.field, armed)
        packed = self._packed(grabbed, number, armed)
        slot = Slot(packed, number.n, number.outcome, number.reason, number.lost_before)
        armed.ring.put(slot)
        return slot

    def _renew_ring(self) -> None:
        with self._arming:
            old, self.armed = self.armed, replace(self.armed, ring=Ring(self._slots))
            old.ring.close()

    def _packed(self, grabbed: GrabbedField, number: Numbered, armed: ConfiguredRing) -> NumberedField | None:
        if number.outcome is Outcome.NO_SIGNAL:
            return None
        self.thresholds.show(grabbed.field, armed)
        field = grabbed.field
        if armed.lines == "doubled":
            field = double_lines(field, self._interpolation)
        packed = quantise(field, armed.bits, self.thresholds.in_force.of(field, armed.bits))
        return NumberedField(number.n, number.time_ns, grabbed.sequence, packed)


def _change(was: StreamInfo | None, now: StreamInfo) -> str | None:
    """What makes the pictures others than before, in a sentence; None where they are the same."""
    if was is None or _pictures(was) == _pictures(now):
        return None
    return f"the grabber grants {_words(now)} now, not {_words(was)} as before"


def _pictures(info: StreamInfo) -> tuple[object, ...]:
    return (info.driver, info.standard, info.columns, info.field_rows, info.rate_hz, info.field_order)


def _words(info: StreamInfo) -> str:
    size = f"{info.columns} × {info.field_rows} at {info.rate_hz:g} Hz"
    return f"{info.driver} {info.standard} {size}, {info.field_order}"
