"""Streams of measured fields: the points of each, and curves of the last seconds.

Curves have a few numbers of each field, and the vacuum, on a common clock.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from grabberd.clock import UtcClock, utc_us
from grabberd.documents.points import LiveChannel, LiveCurves, LiveWidths, PointsDescription
from grabberd.documents.points_frame import PointsFrame, upper
from grabberd.instrument.channels.loggers import ChannelMeans, Loggers
from grabberd.instrument.device.field_watch import History
from grabberd.instrument.device.worker import Live
from grabberd.instrument.instrument import Instrument


class PointsEncoder:
    """Makes the frames and descriptions of one device; used by one thread at a time."""

    def __init__(self, instrument: Instrument, clock: UtcClock) -> None:
        self._instrument = instrument
        self._clock = clock
        self._described: tuple[str | None, str | None, float] | None = None
        self._number = 0
        self._description = ""

    def description(self) -> str:
        """Description of the frames from now on, as JSON; its number changes with its content."""
        documents, rate_hz = self._instrument.setup.documents, self._instrument.pipeline.rate_hz
        calibration, model = documents.get("calibration"), documents.get("object")
        calibration_id = None if calibration is None else calibration["id"]
        object_name = None if model is None else model.get("name")
        # A stream that is opened again may have another rate, and a new threshold makes a new setup.
        if (said := (calibration_id, object_name, rate_hz)) != self._described:
            self._described = said
            self._number += 1
            self._description = PointsDescription(
                number=self._number,
                device=self._instrument.name,
                rate_hz=rate_hz,
                calibration_id=calibration_id,
                object_name=object_name,
            ).model_dump_json()
        return self._description

    def frame(self, live: Live) -> PointsFrame:
        """The frame of a measured field, with the newest description."""
        measured = live.measured
        points = measured.points
        return PointsFrame(
            measured.n,
            measured.time_ns,
            utc_us(self._clock, measured.time_ns),
            live.published_ns,
            live.number,
            self._number,
            points.target.astype(np.uint32),
            points.xyz_mm,
            upper(points.covariance_mm2),
            upper(points.calibration_covariance_mm2),
            points.residual_px.astype(np.float32),
        )


SPAN_NS = 1_000_000_000
"""Time span of a message: a client that misses four of five messages still gets everything."""


def curves_message(instrument: Instrument, loggers: Loggers, clock: UtcClock) -> str | None:
    """The curves of the last second as JSON; None if there are none."""
    curves = curves_document(instrument, loggers, clock, SPAN_NS)
    has_any = curves.time_s or any(one.time_s for one in curves.channels)
    return curves.model_dump_json() if has_any else None


def curves_document(instrument: Instrument, loggers: Loggers, clock: UtcClock, span_ns: int) -> LiveCurves:
    """The curves of the last seconds, as far as kept."""
    now_ns = clock.now_ns()
    history = instrument.worker.history.since(now_ns - span_ns)
    rows = history.rows
    means = loggers.means(instrument.name, now_ns - span_ns)
    # Not validated: the columns come straight from arrays of known types, of up to 15 000 fields.
    return LiveCurves.model_construct(
        device=instrument.name,
        now_s=now_ns / 1e9,
        now_utc_s=clock.utc_now().timestamp(),
        time_s=(rows["time_ns"] / 1e9).round(4).tolist(),
        targets={name: rows["targets"][:, i].tolist() for i, name in enumerate(history.views)},
        points=rows["points"].tolist(),
        residual_px=_rounded(rows["residual_px"], 4),
        latency_ms=_rounded(rows["latency_ms"], 2),
        widths=list(_widths(history)),
        channels=[_channel(one) for one in means if one.channel.quantity.is_vacuum],
    )


def _widths(history: History) -> Iterator[LiveWidths]:
    for place, pair in enumerate(history.pairs):
        width_mm, sigma_mm = history.rows["width_mm"][:, place], history.rows["sigma_mm"][:, place]
        yield LiveWidths.model_construct(
            targets=pair, width_mm=_rounded(width_mm, 3), sigma_mm=_rounded(sigma_mm, 4)
        )


def _channel(means: ChannelMeans) -> LiveChannel:
    return LiveChannel.model_construct(
        name=means.channel.name,
        quantity=means.channel.quantity,
        logger=means.logger,
        time_s=(means.time_ns / 1e9).round(3).tolist(),
        kpa=means.kpa.round(2).tolist(),
    )


def _rounded(values: NDArray[np.floating], digits: int) -> list[float | None]:
    """Values rounded to so many digits; None where unknown."""
    rounded: list[float] = values.astype(np.float64).round(digits).tolist()
    return [None if math.isnan(value) else value for value in rounded]
