"""Preview of the newest field: one binary message with its picture and the targets found in it.

A grey picture shows a part of the field, with as much detail as the link allows.
"""

import struct
import zlib
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.light import CLIPPED_LEVEL
from grabberd.core.field import Field, PackedField, quantise, unpack
from grabberd.core.ledger import Outcome, Slot
from grabberd.core.reconstruction import Points
from grabberd.instrument.device.threshold_keeper import Shown
from grabberd.instrument.device.worker import Live
from grabberd.instrument.instrument import Instrument
from grabberd.runtime import UtcClock, utc_us

BLACK_LEVEL = 1
"""Grey value up to which a pixel is clipped at black."""
WHITE, BLACK = 255, 0
"""Grey values reserved for clipped pixels, by which a client marks over- and under-exposure."""


class Detail(NamedTuple):
    """Detail of a picture.

    Attributes:
        step: Number of grey values combined into one.
        reduce: Number of columns, and of frame lines, combined into one.
    """

    step: int
    reduce: int

    def rows(self, y_step: int) -> int:
        """Number of rows combined into one, for a field whose rows are so many frame lines apart."""
        return max(self.reduce // y_step, 1)


LADDER = (Detail(4, 1), Detail(8, 1), Detail(16, 1), Detail(8, 2), Detail(16, 2), Detail(16, 4))
"""For good to bad links: 73, 54, 34, 21, 14 and 3 kB for a picture of the simulated liner."""


class Part(NamedTuple):
    """Part of a frame, in frame pixels.

    Attributes:
        x: First column.
        y: First frame line.
        columns: Number of columns.
        lines: Number of frame lines.
    """

    x: int
    y: int
    columns: int
    lines: int


class SentPicture(NamedTuple):
    """A picture as sent.

    Attributes:
        columns: Number of its columns.
        rows: Number of its rows.
        x0: First frame column of its first column.
        x_step: Frame columns of each of its columns.
        y0: Frame line of the middle of its first row.
        y_step: Frame lines from row to row.
        deflated: Its compressed rows.
    """

    columns: int
    rows: int
    x0: int
    x_step: int
    y0: int
    y_step: int
    deflated: bytes


NO_PICTURE = SentPicture(0, 0, 0, 0, 0, 0, b"")


def grey_picture(field: Field, part: Part | None, detail: Detail) -> SentPicture:
    """A part of a field, or all of it, with this detail; empty if the part is outside the field."""
    cut, x0, y0 = _cut(field, part, detail)
    if not cut.size:
        return NO_PICTURE
    columns, rows = detail.reduce, detail.rows(field.y_step)
    luma = _levels(detail.step)[cut if columns == 1 else _reduced(cut, rows, columns)]
    y_step = rows * field.y_step
    middle = y0 + (rows - 1) * field.y_step // 2
    return SentPicture(luma.shape[1], luma.shape[0], x0, columns, middle, y_step, _deflated(luma))


def _deflated(luma: NDArray[np.uint8]) -> bytes:
    """The rows, compressed by zlib, each pixel as the difference from its left neighbour."""
    differences = luma.copy()
    differences[:, 1:] -= luma[:, :-1]
    # Only run lengths and Huffman coding: searching for repetitions takes four times as long for a tenth.
    deflate = zlib.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS, 9, zlib.Z_RLE)
    return deflate.compress(differences.tobytes()) + deflate.flush()


def _cut(field: Field, part: Part | None, detail: Detail) -> tuple[NDArray[np.uint8], int, int]:
    """The part's pixels, in whole blocks, with its first column and the frame line of its first row."""
    columns, rows = detail.reduce, detail.rows(field.y_step)
    first, end, top, bottom = 0, field.columns, 0, field.rows
    if part is not None:
        first, end = max(part.x, 0), min(part.x + part.columns, field.columns)
        top = max((part.y - field.y0) // field.y_step, 0)
        bottom = min(-((field.y0 - part.y - part.lines) // field.y_step), field.rows)
    first, top = first - first % columns, top - top % rows
    wide, high = max(end - first, 0) // columns * columns, max(bottom - top, 0) // rows * rows
    return field.luma[top : top + high, first : first + wide], first, field.y0 + top * field.y_step


def _reduced(luma: NDArray[np.uint8], rows: int, columns: int) -> NDArray[np.uint8]:
    """The mean of each block of pixels; a clipped pixel must not vanish among its neighbours."""
    pixels = [luma[row::rows, column::columns] for row in range(rows) for column in range(columns)]
    total = pixels[0].astype(np.uint16)
    brightest = pixels[0]
    for one in pixels[1:]:
        total += one
        brightest = np.maximum(brightest, one)
    mean = total // len(pixels)
    return np.where(brightest >= CLIPPED_LEVEL, WHITE, mean).astype(np.uint8)


@lru_cache(len(LADDER))
def _levels(step: int) -> NDArray[np.uint8]:
    """(256,) the grey value sent for each: the middle of its step."""
    grey = np.arange(256)
    middle = np.minimum(grey // step * step + step // 2, CLIPPED_LEVEL - 1)
    middle = np.maximum(middle, BLACK_LEVEL + 1)
    return np.where(grey >= CLIPPED_LEVEL, WHITE, np.where(grey <= BLACK_LEVEL, BLACK, middle)).astype(
        np.uint8
    )


HEADER = struct.Struct("<4sHHQqqHHHHHBBIIIHHHHBBHII")
"""Little endian; docs/reference/live.md lists every byte."""
MAGIC = b"GRBP"
VERSION = 1
OUTCOMES = (Outcome.RECEIVED, Outcome.DAMAGED, Outcome.NO_SIGNAL)
BITS, GREY = 0, 1
"""How the picture is encoded."""
FAST = 1
FIELD_WITHIN_S = 0.25
"""Longest wait for a field: it comes far sooner, unless there is none."""
MEASURED_WITHIN_S = 0.015
"""Longest wait for a field's measurement, so that its picture is shown with its own targets."""
SAME = 0.5
"""Periods between two times of one field."""
OLD_NS = 250_000_000
"""Age from which targets are no longer shown on a picture."""


POINT = np.dtype([("target", "<u4"), ("image_px", "<f4", (2, 2)), ("residual_px", "<f4")])
"""A point in the message: the target, its image in each view, and the residual between them."""


class Centroids(NamedTuple):
    """Measurements of one field.

    Attributes:
        time_us: Time of the field in µs since 1970; 0 without a field.
        xy_px: (N, 2) float32, centroids of the blobs that are completely in the picture, frame pixels.
        points: (P,) of `POINT`.
    """

    time_us: int
    xy_px: NDArray[np.float32]
    points: NDArray[np.void] = np.zeros(0, POINT)


NO_CENTROIDS = Centroids(0, np.zeros((0, 2), np.float32))


class View(NamedTuple):
    """Part and kind of the picture; a message is made once for all clients with the same view.

    Attributes:
        grey: True for the grey picture, False for the bits that are measured.
        part: Part of the grey picture; None for all of it.
        detail: Detail of the grey picture.
    """

    grey: bool = False
    part: Part | None = None
    detail: Detail = LADDER[0]


class PreviewField(NamedTuple):
    """One field to be shown.

    Attributes:
        n: Number of the field.
        time_us: Middle of its exposure, µs since 1970.
        outcome: Its outcome.
        packed: Its bits, or None if there are none.
        grey: Its grey values, or None without a picture.
        threshold: Threshold in force.
        found: Measurements of it, or of the newest measured field.
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
        """Number of the field's pixels that are clipped at white and at black."""
        if self.grey is None:
            return 0, 0
        luma = self.grey.luma
        return int(np.count_nonzero(luma >= CLIPPED_LEVEL)), int(np.count_nonzero(luma <= BLACK_LEVEL))


class Preview:
    """Makes the messages for the clients of one device; used by one thread at a time."""

    def __init__(self, instrument: Instrument, clock: UtcClock) -> None:
        self._instrument = instrument
        self._clock = clock

    def make(self) -> PreviewField | None:
        """The next field when it comes; None if none comes soon."""
        shown = self._instrument.pipeline.newest.ask(FIELD_WITHIN_S)
        if shown is None:
            return None
        live = self._measured(shown.time_ns)
        pipeline = self._instrument.pipeline
        found, time_us = self._found(live), utc_us(self._clock, shown.time_ns)
        return preview_field(shown, pipeline.ring.newest, found, time_us, pipeline.thresholds.in_force.level)

    def _measured(self, time_ns: int) -> Live | None:
        """The measured field that is nearest to a time; None if it is old."""
        worker = self._instrument.worker
        with worker.published:
            newest = worker.live
            if newest is None or time_ns - newest.measured.time_ns > OLD_NS:
                return None
            since_ns = time_ns - round(SAME * 1e9 / self._instrument.pipeline.rate_hz)
            worker.published.wait_for(lambda: _is_measured(worker.live, since_ns), MEASURED_WITHIN_S)
            lives = worker.since(0)
        nearest = min(lives, key=lambda one: abs(one.measured.time_ns - time_ns))
        return nearest if abs(nearest.measured.time_ns - time_ns) <= OLD_NS else None

    def _found(self, live: Live | None) -> Centroids:
        if live is None:
            return NO_CENTROIDS
        # A blob cut by the border is not a target, although it looks like one with a ring round it.
        blobs = live.measured.blobs
        xy_px = blobs.xy_px[~blobs.at_border].astype(np.float32)
        return Centroids(utc_us(self._clock, live.measured.time_ns), xy_px, _points(live.measured.points))


def preview_field(
    shown: Shown, slot: Slot | None, found: Centroids, time_us: int, threshold: int
) -> PreviewField:
    """A field to be shown, from its copy and the newest slot of the ring."""
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
    return single.data[0]
