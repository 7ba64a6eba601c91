"""The last minutes of a device's measured fields in a few numbers each, for who looks later."""

import math
import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.locating import whole
from grabberd.core.chain.measure import MeasuredField, MeasureSetup
from grabberd.core.field import PAL_HZ
from grabberd.core.reconstruction.section_width import facing_targets, section_widths

KEPT_S = 300.0
"""Five minutes: 1.5 MB for each device at 50 fields a second, 3.6 MB at 120."""
FIELDS = round(KEPT_S * PAL_HZ)
MOST_FIELDS = 75_000
"""Those of five minutes at 250 fields a second."""
MOST_PAIRS = 8
"""Pairs of facing targets whose widths are kept, the outermost first."""
ROW = np.dtype(
    [
        ("time_ns", "i8"),
        ("targets", "u2", 2),
        ("points", "u2"),
        ("residual_px", "f4"),
        ("latency_ms", "f4"),
        ("width_mm", "f4", MOST_PAIRS),
        ("sigma_mm", "f4", MOST_PAIRS),
    ]
)
"""A field: NaN for what is not known."""


class History(NamedTuple):
    """Fields in the sequence of time.

    Attributes:
        views: Names of the views that targets were counted in.
        pairs: Ids of the facing targets.
        rows: (K,) of `ROW`.
    """

    views: tuple[str, ...]
    pairs: list[tuple[int, int]]
    rows: NDArray[np.void]


class FieldHistory:
    """A ring of measured fields, written by the worker, read by anybody."""

    def __init__(self, fields: int = FIELDS) -> None:
        self._rows = np.zeros(fields, ROW)
        self._count = 0
        self._newest_ns = -math.inf
        self._views: tuple[str, ...] = ()
        self._pairs: list[tuple[int, int]] = []
        self._lock = threading.Lock()

    @property
    def nbytes(self) -> int:
        """Bytes of memory that it takes, however long it runs."""
        return self._rows.nbytes

    def keep(self, rate_hz: float) -> None:
        """Keeps five minutes at this rate from now on; what was kept at another one is forgotten."""
        fields = min(max(round(KEPT_S * rate_hz), 1), MOST_FIELDS)
        if fields != len(self._rows):
            with self._lock:
                self._rows, self._count = np.zeros(fields, ROW), 0

    def see(self, measured: MeasuredField, setup: MeasureSetup, latency_ns: int) -> None:
        """Enters a field, unless one as new is there: a capture is measured anew from its first field on."""
        if measured.time_ns <= self._newest_ns:
            return
        row = _row(measured, setup, latency_ns)
        pairs = facing_targets(setup.object_model)[:MOST_PAIRS]
        with self._lock:
            if pairs != self._pairs:
                # Widths of another object's targets would be taken for theirs.
                self._count, self._pairs = 0, pairs
            self._views = tuple(view.name for view in setup.calibration.views)
            self._rows[self._count % len(self._rows)] = row
            self._count += 1
            self._newest_ns = measured.time_ns

    def since(self, time_ns: int) -> History:
        """The fields since a time."""
        with self._lock:
            count = min(self._count, len(self._rows))
            first = (self._count - count) % len(self._rows)
            times = np.roll(self._rows["time_ns"], -first)[:count]
            begin = int(np.searchsorted(times, time_ns))
            places = (first + np.arange(begin, count)) % len(self._rows)
            return History(self._views, self._pairs, self._rows[places])


def _row(measured: MeasuredField, setup: MeasureSetup, latency_ns: int) -> tuple[object, ...]:
    views = setup.calibration.views
    counts = [int(whole(measured.blobs, one.first_column, one.end_column).sum()) for one in views]
    residual_px, points = measured.points.residual_px, len(measured.points)
    rms_px = math.sqrt(residual_px @ residual_px / points) if points else math.nan
    widths = section_widths(measured.points, setup.object_model)[:MOST_PAIRS]
    lacking = [math.nan] * (MOST_PAIRS - len(widths))
    width_mm = [math.nan if one.width_mm is None else one.width_mm for one in widths]
    sigma_mm = [math.nan if one.sigma_mm is None else one.sigma_mm for one in widths]
    return (
        measured.time_ns,
        counts,
        points,
        rms_px,
        latency_ns / 1e6,
        width_mm + lacking,
        sigma_mm + lacking,
    )
