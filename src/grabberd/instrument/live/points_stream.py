"""Points of every field, with what they were measured with, for whoever follows them."""

from datetime import UTC, datetime, timedelta

import numpy as np

from grabberd.clock import UtcClock
from grabberd.documents.points import PointsDescription
from grabberd.documents.points_frame import PointsFrame, upper
from grabberd.instrument.device.worker import Live
from grabberd.instrument.instrument import Instrument

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class PointsEncoder:
    """Makes the frames and descriptions of one device; used by one thread at a time."""

    def __init__(self, instrument: Instrument, clock: UtcClock) -> None:
        self._instrument = instrument
        self._clock = clock
        self._described: tuple[str | None, str | None, float] | None = None
        self._number = 0
        self._description = ""

    def description(self) -> str:
        """Description of the frames from now on, as JSON; its number changes with what it says."""
        documents, rate_hz = self._instrument.setup.documents, self._instrument.rate_hz
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
        now_us = (self._clock.utc_now() - _EPOCH) // timedelta(microseconds=1)
        return PointsFrame(
            measured.n,
            measured.time_ns,
            now_us - (self._clock.now_ns() - measured.time_ns) // 1000,
            live.published_ns,
            live.number,
            self._number,
            points.target.astype(np.uint32),
            points.xyz_mm,
            upper(points.covariance_mm2),
            upper(points.calibration_covariance_mm2),
            points.residual_px.astype(np.float32),
        )
