"""Measured fields for live pages and clients: the newest one, and every one as a stream.

Curves have a few numbers of each field, and the vacuum, on a common clock.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from grabberd import runtime
from grabberd.archive.export.field_pictures import grey_png
from grabberd.archive.export.page_documents import point_columns
from grabberd.archive.measure_setups import location_settings, nominal_rig, settings_of
from grabberd.core.chain.light import light_of
from grabberd.core.chain.locating import px_per_mm, sized, whole
from grabberd.core.chain.measure import MeasureSetup
from grabberd.core.geometry.document_reader import is_number
from grabberd.core.measurement import LocationSettings
from grabberd.core.reconstruction import ObjectModel
from grabberd.core.reconstruction.section_width import section_widths
from grabberd.documents.devices import (
    LightDocument,
    LiveDocument,
    ObjectDocument,
    ViewLightDocument,
    WidthDocument,
)
from grabberd.documents.points_frame import (
    LiveChannel,
    LiveCurves,
    LiveWidths,
    NewestPoints,
    PointsDescription,
    PointsFrame,
    upper,
)
from grabberd.errors import NotFound, NotReady
from grabberd.instrument.channels.loggers import ChannelMeans, Loggers
from grabberd.instrument.device.field_watch import History
from grabberd.instrument.device.status_board import STREAMING
from grabberd.instrument.device.threshold_keeper import Shown
from grabberd.instrument.device.worker import Live
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.setup import DeviceSetup
from grabberd.runtime import UtcClock, iso_utc, utc_of, utc_us


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


FIELD_WITHIN_S = 0.5
USUAL_MM = 1.5
"""Diameter of the paper's targets, assumed while no object is configured."""


def light_document(instrument: Instrument, threshold: int | None) -> LightDocument:
    """Illumination of the newest field, with targets at the given threshold or at the one in force.

    Raises:
        NotReady: The device delivers no field.
    """
    shown = _newest(instrument)
    level = instrument.pipeline.thresholds.in_force.level if threshold is None else threshold
    views = instrument.setup.config.rig.views
    columns = {name: (one.first_column, one.end_column) for name, one in views}
    lights = light_of(shown.field, level, columns, _location(instrument.setup))
    described = {
        name: ViewLightDocument.model_validate(one, from_attributes=True) for name, one in lights.items()
    }
    return LightDocument(threshold=level, views=described)


def _location(setup: DeviceSetup) -> LocationSettings:
    """Settings of target location, for targets of the configured object as seen by the nominal rig."""
    scale = px_per_mm(nominal_rig(setup.config.rig))
    stated = (setup.documents.get("object") or {}).get("target_diameter_mm")
    # Light is adjusted before there is a calibration or an object, whose document may also be invalid.
    diameter_mm = float(stated) if is_number(stated) and stated > 0 else USUAL_MM
    return sized(location_settings(settings_of(setup.config), scale), scale, diameter_mm)


class PreviewPicture:
    """The newest field of one device as a PNG, encoded once for all clients; any thread may call."""

    def __init__(self, instrument: Instrument) -> None:
        self._instrument = instrument
        self._encoding = runtime.lock()
        self._of: Shown | None = None
        self._png = b""

    def png(self) -> bytes:
        """The newest field in 8 bits, with its lines as recorded.

        Raises:
            NotReady: The device delivers no field.
        """
        shown = _newest(self._instrument)
        with self._encoding:
            if self._of is not shown:
                self._of, self._png = shown, grey_png(shown.field.luma)
            return self._png


def _newest(instrument: Instrument) -> Shown:
    shown = instrument.pipeline.newest.recent(FIELD_WITHIN_S)
    if shown is None:
        status = instrument.board.now
        raise NotReady(
            f"device {instrument.name} is {status.state} and has delivered no field for {FIELD_WITHIN_S:g} s",
            status.hint or "wait until its state is ready: GET /api/v1/state",
        )
    return shown


CURRENT_NS = 2_000_000_000
"""Age from which the newest measured field no longer shows the present scene."""
LATENCY_OF_S = 10.0
"""Time over which latencies are summarised."""


def live_document(instrument: Instrument, clock: UtcClock) -> LiveDocument | None:
    """Summary of the newest measured field; None if it no longer shows the present scene."""
    live = instrument.worker.live
    if live is None or instrument.board.state not in STREAMING:
        return None
    if clock.now_ns() - live.measured.time_ns > CURRENT_NS:
        return None
    residual = live.measured.points.residual_px
    lately = round(LATENCY_OF_S * instrument.pipeline.rate_hz)
    return LiveDocument(
        n=live.measured.n,
        blobs=len(live.measured.blobs),
        views=_views(live, instrument.setup.measuring),
        points=len(live.measured.points),
        residual_px=float((residual**2).mean() ** 0.5) if len(residual) else None,
        widths=_field_widths(live, instrument.setup.measuring),
        latency_ms=instrument.worker.latency.percentiles_ms(lately),
    )


def newest_points(instrument: Instrument, clock: UtcClock) -> NewestPoints:
    """The newest measured field, point by point.

    Raises:
        NotReady: the device has not measured a field yet.
    """
    live = instrument.worker.live
    if live is None:
        raise NotReady(
            f"device {instrument.name} has measured no field yet",
            "it measures once it has a signal, a calibration and an object model: GET /readyz",
        )
    # Not validated: the columns come straight from arrays of known types, and there are hundreds of numbers.
    return NewestPoints.model_construct(
        device=instrument.name,
        n=live.measured.n,
        utc=iso_utc(utc_of(clock, live.measured.time_ns)),
        **point_columns(live.measured.points),
    )


def object_document(instrument: Instrument) -> ObjectDocument:
    """The object model that a device measures with.

    Raises:
        NotFound: the device has none.
        InputError: the configured document is no object model.
    """
    document = instrument.setup.documents.get("object")
    if document is None:
        raise NotFound(
            f"device {instrument.name} has no object model", "name one in the configuration: object"
        )
    model = ObjectModel.from_document(document)
    return ObjectDocument(
        name=model.name,
        target_diameter_mm=model.target_diameter_mm,
        sigma_mm=model.sigma_mm,
        target=model.target.tolist(),
        x_mm=model.xyz_mm[:, 0].tolist(),
        y_mm=model.xyz_mm[:, 1].tolist(),
        z_mm=model.xyz_mm[:, 2].tolist(),
        row=model.row.tolist(),
        column=model.column.tolist(),
    )


def _views(live: Live, setup: MeasureSetup | None) -> dict[str, int] | None:
    if setup is None:
        return None
    views = setup.calibration.views
    return {
        view.name: int(whole(live.measured.blobs, view.first_column, view.end_column).sum()) for view in views
    }


def _field_widths(live: Live, setup: MeasureSetup | None) -> list[WidthDocument]:
    widths = section_widths(live.measured.points, setup.object_model) if setup else []
    return [WidthDocument.model_validate(width._asdict()) for width in widths]
