"""Preview of the newest field: one binary message with its picture and what was found in it."""

import struct
import zlib
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.clock import UtcClock
from grabberd.core.chain.light import CLIPPED_LEVEL
from grabberd.core.field import Field, PackedField, quantise, unpack
from grabberd.core.ledger import Outcome, Slot
from grabberd.core.reconstruction import Points
from grabberd.instrument.device.threshold_keeper import Shown
from grabberd.instrument.device.worker import Live
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.grey_picture import (
    BLACK_LEVEL,
    LADDER,
    NO_PICTURE,
    Detail,
    Part,
    SentPicture,
    grey_picture,
)

HEADER = struct.Struct("<4sHHQqqHHHHHBBIIIHHHHBBHII")
"""Little endian; docs/reference/live.md has it byte for byte."""
MAGIC = b"GRBP"
VERSION = 1
OUTCOMES = (Outcome.RECEIVED, Outcome.DAMAGED, Outcome.NO_SIGNAL)
BITS, GREY = 0, 1
"""How the picture is encoded."""
FAST = 1
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
FIELD_WITHIN_S = 0.25
"""Longest wait for a field: one comes far sooner, unless there is none."""
MEASURED_WITHIN_S = 0.015
"""Longest wait until a field is measured, so that its picture is shown with its own targets."""
SAME = 0.5
"""Periods between two times of one field."""
OLD_NS = 250_000_000
"""Age from which what was found is no longer shown on a picture."""


POINT = np.dtype([("target", "<u4"), ("image_px", "<f4", (2, 2)), ("residual_px", "<f4")])
"""A point in the message: the target, its image in each view, and the residual between them."""


class Centroids(NamedTuple):
    """Measurements of one field.

    Attributes:
        time_us: Time of the field in µs since 1970; 0 without a field.
        xy_px: (N, 2) float32, centroids of the blobs that lie wholly in the picture, frame pixels.
        points: (P,) of `POINT`.
    """

    time_us: int
    xy_px: NDArray[np.float32]
    points: NDArray[np.void] = np.zeros(0, POINT)


NO_CENTROIDS = Centroids(0, np.zeros((0, 2), np.float32))


class View(NamedTuple):
    """Part and kind of the picture that is shown; for all clients with the same, a message is made once.

    Attributes:
        grey: True for the grey picture, False for the bits that are measured.
        part: Part of the grey picture; None for all of it.
        detail: Detail of the grey picture.
    """

    grey: bool = False
    part: Part | None = None
    detail: Detail = LADDER[0]


class PreviewField(NamedTuple):
    """One field to look at.

    Attributes:
        n: Number of the field.
        time_us: Middle of its exposure, µs since 1970.
        outcome: What became of it.
        packed: Its bits, or None if there are none.
        grey: Its grey values, or None without a picture.
        threshold: Threshold in force.
        found: What was found in it, or in the newest field that was measured.
    """

    n: int
    time_us: int
    outcome: Outcome
    packed: PackedField | None
    grey: Field | None
    threshold: int
    found: Centroids = NO_CENTROIDS

    def message(self, view: View) -> bytes:
        """Header, centroids, deflated picture and points; no picture without a signal."""
        found, picture = self.found, self._picture(view)
        header = HEADER.pack(
            MAGIC,
            VERSION,
            HEADER.size,
            self.n,
            self.time_us,
            found.time_us,
            picture.columns,
            picture.rows,
            picture.y0,
            picture.y_step,
            self.threshold,
            OUTCOMES.index(self.outcome),
            self.packed.bits if self.packed else 0,
            len(found.xy_px),
            len(picture.deflated),
            len(found.points),
            picture.x0,
            picture.x_step,
            *self._frame(),
            GREY if view.grey else BITS,
            view.detail.step if view.grey else 0,
            0,
            *(self._clipped() if view.grey else (0, 0)),
        )
        return header + found.xy_px.astype("<f4").tobytes() + picture.deflated + found.points.tobytes()

    def _picture(self, view: View) -> SentPicture:
        if view.grey:
            return NO_PICTURE if self.grey is None else grey_picture(self.grey, view.part, view.detail)
        packed = self.packed
        if packed is None:
            return NO_PICTURE
        deflated = zlib.compress(one_bit(packed).tobytes(), FAST)
        return SentPicture(packed.columns, packed.rows, 0, 1, packed.y0, packed.y_step, deflated)

    def _frame(self) -> tuple[int, int]:
        """Columns and lines of the frame."""
        whole = self.grey or self.packed
        return (whole.columns, 2 * -(-whole.rows * whole.y_step // 2)) if whole else (0, 0)

    def _clipped(self) -> tuple[int, int]:
        """Pixels of the field that are as bright as the camera gets, and as dark."""
        if self.grey is None:
            return 0, 0
        luma = self.grey.luma
        return int(np.count_nonzero(luma >= CLIPPED_LEVEL)), int(np.count_nonzero(luma <= BLACK_LEVEL))


class Preview:
    """Makes what the clients of one device are shown; used by one thread at a time."""

    def __init__(self, instrument: Instrument, clock: UtcClock) -> None:
        self._instrument = instrument
        self._clock = clock

    def make(self) -> PreviewField | None:
        """The next field, as soon as it comes; None if none comes soon."""
        shown = self._instrument.pipeline.newest.ask(FIELD_WITHIN_S)
        if shown is None:
            return None
        live = self._measured(shown.time_ns)
        pipeline = self._instrument.pipeline
        found, time_us = self._found(live), self._utc_us(shown.time_ns)
        return preview_field(shown, pipeline.ring.newest, found, time_us, pipeline.thresholds.in_force.level)

    def _measured(self, time_ns: int) -> Live | None:
        """The measured field that is nearest to a time; None if it is old."""
        worker = self._instrument.worker
        with worker.published:
            newest = worker.live
            if newest is None or time_ns - newest.measured.time_ns > OLD_NS:
                return None
            since_ns = time_ns - round(SAME * 1e9 / self._instrument.rate_hz)
            worker.published.wait_for(lambda: _is_measured(worker.live, since_ns), MEASURED_WITHIN_S)
            lives = worker.since(0)
        nearest = min(lives, key=lambda one: abs(one.measured.time_ns - time_ns))
        return nearest if abs(nearest.measured.time_ns - time_ns) <= OLD_NS else None

    def _found(self, live: Live | None) -> Centroids:
        if live is None:
            return NO_CENTROIDS
        # What the picture's border cuts is no target, and looks like one with a ring round it.
        blobs = live.measured.blobs
        xy_px = blobs.xy_px[~blobs.at_border].astype(np.float32)
        return Centroids(self._utc_us(live.measured.time_ns), xy_px, _points(live.measured.points))

    def _utc_us(self, time_ns: int) -> int:
        """Converts a time of CLOCK_MONOTONIC to µs since 1970."""
        now_us = (self._clock.utc_now() - EPOCH) // timedelta(microseconds=1)
        return now_us - (self._clock.now_ns() - time_ns) // 1000


def preview_field(
    shown: Shown, slot: Slot | None, found: Centroids, time_us: int, threshold: int
) -> PreviewField:
    """A field to look at, of its copy and the newest slot of the ring."""
    if slot is None:
        return PreviewField(0, time_us, Outcome.RECEIVED, None, shown.field, threshold, found)
    has_picture = slot.outcome is not Outcome.NO_SIGNAL
    packed = slot.numbered.packed if slot.numbered and has_picture else None
    grey = shown.field if has_picture else None
    return PreviewField(
        slot.n, time_us, slot.outcome, packed, grey, packed.threshold if packed else threshold, found
    )


def _is_measured(live: Live | None, since_ns: int) -> bool:
    return live is not None and live.measured.time_ns >= since_ns


def _points(points: Points) -> NDArray[np.void]:
    sent = np.zeros(len(points), POINT)
    sent["target"], sent["image_px"], sent["residual_px"] = points.target, points.image_px, points.residual_px
    return sent


def one_bit(packed: PackedField) -> NDArray[np.uint8]:
    """(rows, ceil(columns / 8)) uint8, 1 for target; the leftmost of eight pixels is the highest bit."""
    single = packed if packed.bits == 1 else quantise(unpack(packed), 1, packed.threshold)
    bits: NDArray[np.uint8] = single.data[0]
    return bits
