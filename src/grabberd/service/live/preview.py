"""Preview of the newest field: one binary message with its centroids and its bits."""

import struct
import zlib
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.acquisition import Outcome, Slot
from grabberd.acquisition.clock import UtcClock
from grabberd.field import PackedField, quantise, unpack
from grabberd.reconstruction import Points
from grabberd.service.device.worker import Live
from grabberd.service.instrument import Instrument

HEADER = struct.Struct("<4sHHQqqHHHHHBBIII")
"""Little endian; docs/reference/live.md has it byte for byte."""
MAGIC = b"GRBP"
VERSION = 1
OUTCOMES = (Outcome.RECEIVED, Outcome.DAMAGED, Outcome.NO_SIGNAL)
FAST = 1
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


POINT = np.dtype([("target", "<u4"), ("image_px", "<f4", (2, 2)), ("residual_px", "<f4")])
"""A point in the message: the target, its image in each view, and the residual between them."""


class Centroids(NamedTuple):
    """Measurements of one field.

    Attributes:
        time_us: Time of the field in µs since 1970; 0 without a field.
        xy_px: (N, 2) float32, centroids of the blobs, frame pixels.
        points: (P,) of `POINT`.
    """

    time_us: int
    xy_px: NDArray[np.float32]
    points: NDArray[np.void] = np.zeros(0, POINT)


NO_CENTROIDS = Centroids(0, np.zeros((0, 2), np.float32))


class Preview:
    """Makes the messages of one device, each once for all clients."""

    def __init__(self, instrument: Instrument, clock: UtcClock) -> None:
        self._instrument = instrument
        self._clock = clock
        self._shown: Slot | None = None

    def make(self) -> bytes | None:
        """The message of the newest field; None if there has been no new field since the last call."""
        slot = self._instrument.pipeline.ring.newest
        if slot is None or slot is self._shown:
            return None
        self._shown = slot
        time_ns = slot.numbered.time_ns if slot.numbered else self._clock.now_ns()
        return message(slot, self._utc_us(time_ns), self._centroids(self._instrument.worker.live))

    def _centroids(self, live: Live | None) -> Centroids:
        if live is None:
            return NO_CENTROIDS
        xy_px = live.measured.blobs.xy_px.astype(np.float32)
        return Centroids(self._utc_us(live.measured.time_ns), xy_px, _points(live.measured.points))

    def _utc_us(self, time_ns: int) -> int:
        """Converts a time of CLOCK_MONOTONIC to µs since 1970."""
        now_us = (self._clock.utc_now() - EPOCH) // timedelta(microseconds=1)
        return now_us - (self._clock.now_ns() - time_ns) // 1000


def message(slot: Slot, time_us: int, centroids: Centroids) -> bytes:
    """Header, centroids, deflated bits and points of a slot; no bits without a signal."""
    shown = slot.numbered if slot.outcome is not Outcome.NO_SIGNAL else None
    packed = shown.packed if shown else None
    deflated = b"" if packed is None else zlib.compress(one_bit(packed).tobytes(), FAST)
    shape = (0, 0, 0, 0, 0) if packed is None else _shape(packed)
    outcome, bits = OUTCOMES.index(slot.outcome), packed.bits if packed else 0
    header = HEADER.pack(
        MAGIC,
        VERSION,
        HEADER.size,
        slot.n,
        time_us,
        centroids.time_us,
        *shape,
        outcome,
        bits,
        len(centroids.xy_px),
        len(deflated),
        len(centroids.points),
    )
    return header + centroids.xy_px.astype("<f4").tobytes() + deflated + centroids.points.tobytes()


def _points(points: Points) -> NDArray[np.void]:
    sent = np.zeros(len(points), POINT)
    sent["target"], sent["image_px"], sent["residual_px"] = points.target, points.image_px, points.residual_px
    return sent


def one_bit(packed: PackedField) -> NDArray[np.uint8]:
    """(rows, ceil(columns / 8)) uint8, 1 for target; the leftmost of eight pixels is the highest bit."""
    single = packed if packed.bits == 1 else quantise(unpack(packed), 1, packed.threshold)
    bits: NDArray[np.uint8] = single.data[0]
    return bits


def _shape(packed: PackedField) -> tuple[int, int, int, int, int]:
    return packed.columns, packed.rows, packed.y0, packed.y_step, packed.threshold
