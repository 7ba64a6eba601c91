"""From a grabbed field to a slot of the ring: number, lines, threshold, bits."""

import threading
from dataclasses import dataclass

import cv2
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
from grabberd.errors import MeasurementError
from grabberd.field import Field, NumberedField, double_lines, quantise
from grabberd.measurement import ThresholdRule, choose_threshold

THRESHOLD_EVERY_NS = 1_000_000_000
UNDECIDED_THRESHOLD = 128
"""In force while the picture has no contrast to choose by."""
ARRIVALS = 4096


@dataclass(frozen=True, slots=True)
class Armed:
    """The ring in use and how fields are put into it."""

    ring: Ring
    bits: int
    lines: str


def default_lines(bits: int) -> str:
    """Doubled at 1 bit, intact for grey (paper 3.3)."""
    return "doubled" if bits == 1 else "field"


class Intake:
    """Used by the capture thread alone, but for `arm`, `hold_threshold` and what it publishes."""

    def __init__(self, config: DeviceConfig) -> None:
        bits = config.ring.bits
        self._slots = config.ring.slots
        self._rule = _rule(config)
        self._arming = threading.Lock()
        self.armed = self._configured = Armed(
            Ring(self._slots), bits, config.ring.lines or default_lines(bits)
        )
        self.threshold = UNDECIDED_THRESHOLD if self._rule.value is None else self._rule.value
        self.hold_threshold = False
        self.arrived_ns: NDArray[np.int64] = np.zeros(ARRIVALS, np.int64)
        self._threshold_due_ns = 0
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

    def interrupted(self, reason: str) -> None:
        """Fields that do not come from now on are lost for this reason."""
        if self._numbering is not None:
            self._numbering.interrupt(reason)

    def take(self, grabbed: GrabbedField, signal: Signal, now_ns: int) -> Slot:
        """Numbers, quantises and packs a field and puts it into the ring."""
        assert self._numbering is not None, "opened() comes first"
        self._choose_threshold(grabbed.field, now_ns)
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
        field = double_lines(grabbed.field) if armed.lines == "doubled" else grabbed.field
        packed = quantise(field, armed.bits, self.threshold)
        return NumberedField(number.n, number.time_ns, grabbed.sequence, packed)

    def _choose_threshold(self, field: Field, now_ns: int) -> None:
        if self._rule.kind == "fixed" or self.hold_threshold or now_ns < self._threshold_due_ns:
            return
        self._threshold_due_ns = now_ns + THRESHOLD_EVERY_NS
        try:
            self.threshold = choose_threshold(histogram(field), self._rule, self.armed.bits)
        except MeasurementError:
            return  # nothing to choose by, e.g. a dark picture: the one in force stays


def histogram(field: Field) -> NDArray[np.int64]:
    """(256,) int64, how often each grey value occurs."""
    counts = cv2.calcHist([field.luma], [0], None, [256], [0, 256])
    return counts.ravel().astype(np.int64)


def _rule(config: DeviceConfig) -> ThresholdRule:
    return ThresholdRule(config.threshold.kind, config.threshold.value, spread_px=config.spread_px)
