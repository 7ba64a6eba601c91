"""From a grabbed field to a slot of the ring: number, lines, threshold, bits."""

import threading

import numpy as np
from numpy.typing import NDArray

from grabberd.acquisition import (
    FieldNumbering,
    GrabbedField,
    Numbered,
    Outcome,
    RepeatCheck,
    Ring,
    Signal,
    Slot,
    StreamInfo,
)
from grabberd.config import DeviceConfig
from grabberd.field import NumberedField, double_lines, quantise
from grabberd.service.armed import Armed, default_lines
from grabberd.service.thresholds import ThresholdKeeper

ARRIVALS = 4096


class Intake:
    """Used by the capture thread alone, but for `arm` and what it publishes.

    Attributes:
        armed: the ring in use.
        thresholds: the keeper of the threshold in force.
        arrived_ns: when the latest fields arrived, by their number modulo `ARRIVALS`.
    """

    def __init__(self, config: DeviceConfig) -> None:
        bits = config.ring.bits
        self._slots = config.ring.slots
        self._interpolation = config.ring.interpolation
        self._arming = threading.Lock()
        self.armed = self._configured = Armed(
            Ring(self._slots), bits, config.ring.lines or default_lines(bits)
        )
        self.thresholds = ThresholdKeeper(config)
        self.arrived_ns: NDArray[np.int64] = np.zeros(ARRIVALS, np.int64)
        self._numbering: FieldNumbering | None = None
        self._repeats: RepeatCheck | None = None

    def arm(self, bits: int | None, lines: str | None) -> Armed:
        """The ring for these bits and lines, the configured ones where none are given."""
        with self._arming:
            bits = bits or self._configured.bits
            lines = lines or (
                self._configured.lines if bits == self._configured.bits else default_lines(bits)
            )
            if (bits, lines) != (self.armed.bits, self.armed.lines):
                old, self.armed = self.armed, Armed(Ring(self._slots), bits, lines)
                old.ring.close()
            return self.armed

    def opened(self, info: StreamInfo) -> None:
        """The device streams (again); numbering goes on through the gap."""
        if self._numbering is None:
            self._numbering = FieldNumbering(info)
        self._repeats = RepeatCheck() if info.live else None
        self.thresholds.opened(live=info.live)

    def interrupted(self, reason: str) -> None:
        """Fields that do not come from now on are lost for this reason."""
        if self._numbering is not None:
            self._numbering.interrupt(reason)

    def take(self, grabbed: GrabbedField, signal: Signal, now_ns: int) -> Slot:
        """Numbers, quantises and packs a field and puts it into the ring."""
        assert self._numbering is not None, "opened() comes first"
        damage = self._repeats.damage(grabbed.field) if self._repeats else None
        number = self._numbering.number(grabbed, signal, damage, now_ns)
        self.arrived_ns[number.n % ARRIVALS] = now_ns
        armed = self.armed
        packed = self._packed(grabbed, number, armed)
        slot = Slot(packed, number.n, number.outcome, number.reason, number.lost_before)
        armed.ring.put(slot)
        return slot

    def _packed(self, grabbed: GrabbedField, number: Numbered, armed: Armed) -> NumberedField | None:
        if number.outcome is Outcome.NO_SIGNAL:
            return None
        self.thresholds.show(grabbed.field, armed)
        field = grabbed.field
        if armed.lines == "doubled":
            field = double_lines(field, self._interpolation)
        packed = quantise(field, armed.bits, self.thresholds.in_force.of(field, armed.bits))
        return NumberedField(number.n, number.time_ns, grabbed.sequence, packed)
