"""The newest measured field: in short, and point by point."""

from datetime import timedelta

from grabberd.archive.export.points_document import point_columns
from grabberd.clock import UtcClock, iso_utc
from grabberd.core.chain.locating import whole
from grabberd.core.chain.measure import MeasureSetup
from grabberd.core.reconstruction import ObjectModel
from grabberd.core.reconstruction.section_width import section_widths
from grabberd.documents.devices import LiveDocument, ObjectDocument, WidthDocument
from grabberd.documents.points import NewestPoints
from grabberd.errors import NotFound, NotReady
from grabberd.instrument.device.status_board import STREAMING
from grabberd.instrument.device.worker import Live
from grabberd.instrument.instrument import Instrument

CURRENT_NS = 2_000_000_000
"""Age from which the newest measured field is no longer what is before the camera."""
LATENCY_OF_S = 10.0
"""Time whose fields' latencies are summarised."""


def live_document(instrument: Instrument, clock: UtcClock) -> LiveDocument | None:
    """The newest measured field in short; None if it is no longer what is before the camera."""
    live = instrument.worker.live
    if live is None or instrument.board.state not in STREAMING:
        return None
    if clock.now_ns() - live.measured.time_ns > CURRENT_NS:
        return None
    residual = live.measured.points.residual_px
    return LiveDocument(
        n=live.measured.n,
        blobs=len(live.measured.blobs),
        views=_views(live, instrument.setup.measuring),
        points=len(live.measured.points),
        residual_px=float((residual**2).mean() ** 0.5) if len(residual) else None,
        widths=_widths(live, instrument.setup.measuring),
        latency_ms=instrument.worker.latency.percentiles_ms(round(LATENCY_OF_S * instrument.rate_hz)),
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
    age = timedelta(microseconds=(clock.now_ns() - live.measured.time_ns) // 1000)
    # Not validated: the columns come straight from arrays of known types, and there are hundreds of numbers.
    return NewestPoints.model_construct(
        device=instrument.name,
        n=live.measured.n,
        utc=iso_utc(clock.utc_now() - age),
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
    return _object(ObjectModel.from_document(document))


def _object(model: ObjectModel) -> ObjectDocument:
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


def _widths(live: Live, setup: MeasureSetup | None) -> list[WidthDocument]:
    widths = section_widths(live.measured.points, setup.object_model) if setup else []
    return [WidthDocument.model_validate(width._asdict()) for width in widths]
