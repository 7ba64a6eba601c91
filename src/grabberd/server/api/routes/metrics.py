"""Metrics for Prometheus, read on request from the daemon's own counters."""

from collections.abc import Callable, Iterable, Iterator
from math import isfinite

from fastapi import APIRouter, Request, Response
from prometheus_client import CollectorRegistry, ProcessCollector, generate_latest
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4
from prometheus_client.metrics_core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    InfoMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector

from grabberd import __version__
from grabberd.core.ledger import LossCause, Outcome, Rebase
from grabberd.core.reconstruction.coverage import CoverageVerdict
from grabberd.core.reconstruction.drift_check import MarkState, RigVerdict
from grabberd.core.reconstruction.field_order import Order
from grabberd.documents.enums import DeviceState, Rung
from grabberd.documents.state import MqttDocument
from grabberd.fault_board import OWN_CAUSES
from grabberd.instrument.acquisition import Signal
from grabberd.instrument.channels.loggers import Loggers
from grabberd.instrument.device.field_watch import VIEWS
from grabberd.instrument.device.worker import BOUNDS_S
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.health import LEVELS, device_health, lacks_of
from grabberd.server.api.responses import RenderedRoute
from grabberd.server.daemon.descriptors import exhaustion
from grabberd.server.daemon.service import Service

Samples = Iterable[tuple[tuple[str, ...], float]]
"""Label values and the number they belong to."""
Kind = Callable[[str, str, tuple[str, ...], Samples], Metric]
"""`gauge` or `counter`."""


def gauge(name: str, words: str, labels: tuple[str, ...], samples: Samples) -> Metric:
    """A number that goes up and down."""
    return _filled(GaugeMetricFamily(name, words, labels=labels), samples)


def counter(name: str, words: str, labels: tuple[str, ...], samples: Samples) -> Metric:
    """A number that only grows."""
    return _filled(CounterMetricFamily(name, words, labels=labels), samples)


def single(kind: Kind, name: str, words: str, value: float | None) -> Metric:
    """A number of the daemon; None while it is unknown."""
    return kind(name, words, (), [] if value is None else [((), value)])


def _filled(
    family: GaugeMetricFamily | CounterMetricFamily, samples: Samples
) -> GaugeMetricFamily | CounterMetricFamily:
    for labels, value in samples:
        family.add_metric(labels, value)
    return family


STATES = (
    *(DeviceState.OPENING, DeviceState.READY, DeviceState.ABSENT),
    *(DeviceState.FAILED, DeviceState.ENDED),
)
"""States of a logger."""


def logger_metrics(loggers: Loggers) -> Iterator[Metric]:
    """Present metrics of the loggers; families without samples if there are no loggers."""
    known, ages_s = loggers.document(), loggers.ages_s()
    states = (((name, s), float(one.state is s)) for name, one in known.items() for s in STATES)
    yield gauge("grabberd_logger_state", "1 for the current state.", ("logger", "state"), states)
    openings = (((name,), one.openings) for name, one in known.items())
    yield counter("grabberd_logger_openings", "Times it was opened.", ("logger",), openings)
    readings = (((name,), one.readings) for name, one in known.items())
    yield counter("grabberd_logger_readings", "Readings since the start.", ("logger",), readings)
    lost = (((name,), one.lost) for name, one in known.items())
    yield counter("grabberd_logger_lost_readings", "Readings known to be missing.", ("logger",), lost)
    said = (((name, reason), n) for name, one in known.items() for reason, n in one.anomalies.items())
    words = "Output that is not a reading, and missing readings."
    yield counter("grabberd_logger_anomalies", words, ("logger", "reason"), said)
    ages = (((name,), age_s) for name, age_s in ages_s.items())
    yield gauge("grabberd_logger_reading_age_seconds", "Age of the newest reading.", ("logger",), ages)
    labels = ("logger", "channel", "quantity")
    channels = [
        ((name, channel, str(one.quantity)), one)
        for name, logger in known.items()
        for channel, one in logger.channels.items()
    ]
    kpa = ((values, one.kpa) for values, one in channels if one.kpa is not None)
    yield gauge("grabberd_channel_kpa", "Vacuum below atmosphere, mean over .5 s.", labels, kpa)
    level = ((values, one.level) for values, one in channels if one.level is not None)
    yield gauge("grabberd_channel_level", "Newest reading of a light.", labels, level)


_DAY_S = 86_400


def health_metrics(service: Service) -> Iterator[Metric]:
    """Present health, readiness, calibration and disk of every device."""
    around = service.surroundings()
    instruments = service.instruments.values()
    found = {one.name: device_health(one, around) for one in instruments}
    levels = (((name, s), float(one.level == s)) for name, one in found.items() for s in LEVELS)
    yield gauge("grabberd_health", "1 for the current level of the health.", ("device", "level"), levels)
    parts = (
        ((name, part, s), float(health.level == s))
        for name, one in found.items()
        for part, health in one.parts.items()
        for s in LEVELS
    )
    yield gauge("grabberd_health_part", "1 for the part's current level.", ("device", "part", "level"), parts)
    ready = (((name,), float(not lacks_of(one.parts))) for name, one in found.items())
    yield gauge("grabberd_ready", "1 while the device measures as it should.", ("device",), ready)
    active = [(one.name, known) for one in instruments if (known := service.active.document(one))]
    ages = (((name,), known.age_days * _DAY_S) for name, known in active)
    yield gauge("grabberd_calibration_age_seconds", "Age of the active calibration.", ("device",), ages)
    left = around.storage.minutes_left
    words = "Recording time left on the disk, for all devices together."
    yield single(gauge, "grabberd_disk_left_seconds", words, None if left is None else left * 60)


def fault_metrics(service: Service) -> Iterator[Metric]:
    """Faults of the daemon itself, and its countermeasures."""
    board, unsealed = service.faults, service.unsealed
    now = (((cause,), float(board.has(cause))) for cause in OWN_CAUSES)
    counts = (((cause,), board.counts[cause]) for cause in OWN_CAUSES)
    yield gauge("grabberd_fault", "1 while the daemon has this fault.", ("cause",), now)
    yield counter("grabberd_faults", "Times the fault has occurred.", ("cause",), counts)
    rebuilt, backed_up = service.archive.keeper.rebuilt, service.state_keeper.backed_up
    yield single(counter, "grabberd_index_rebuilds", "Rebuilds of a damaged index.", rebuilt)
    yield single(gauge, "grabberd_unsealed_captures", "Captures still to be sealed.", len(unsealed.captures))
    yield single(counter, "grabberd_failed_seals", "Failed attempts to seal a capture.", unsealed.attempts)
    yield single(counter, "grabberd_state_backups", "Backups of state.sqlite.", backed_up)
    words = "Refused for lack of descriptors."
    yield single(counter, "grabberd_descriptors_exhausted", words, exhaustion.count)


router = APIRouter(tags=["system"], route_class=RenderedRoute)


@router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {}}}},
    summary="Get metrics for Prometheus",
)
def get_metrics(request: Request) -> Response:
    """Counters and gauges in Prometheus' text format."""
    registry: CollectorRegistry = request.app.state.metrics
    return Response(generate_latest(registry), media_type=CONTENT_TYPE_PLAIN_0_0_4)


def registry_of(service: Service, streams: Callable[[], int]) -> CollectorRegistry:
    """The metrics of a service and of this process.

    Args:
        service: The service to read.
        streams: Returns the number of live streams to clients.
    """
    registry = CollectorRegistry()
    registry.register(ServiceMetrics(service, streams))
    ProcessCollector(registry=registry)
    return registry


class ServiceMetrics(Collector):
    """Reads the service's counters."""

    def __init__(self, service: Service, streams: Callable[[], int]) -> None:
        self._service = service
        self._streams = streams

    def describe(self) -> Iterable[Metric]:
        """Returns nothing, because the service may not have been started at registration."""
        return []

    def collect(self) -> Iterator[Metric]:
        """Yields all metrics."""
        instruments = list(self._service.instruments.values())
        yield InfoMetricFamily("grabberd", "The program.", {"version": __version__})
        yield from _fields(instruments)
        yield from _ring(instruments)
        yield from _device(instruments)
        yield from _points(instruments)
        yield from _rig(instruments)
        yield from _captures(instruments, self._service)
        yield from logger_metrics(self._service.loggers)
        yield from health_metrics(self._service)
        yield from fault_metrics(self._service)
        yield from _mqtt(self._service)
        yield single(gauge, "grabberd_streams", "Live streams to clients.", self._streams())


def _fields(instruments: list[Instrument]) -> Iterator[Metric]:
    counts = [(one.name, one.board.now.outcomes) for one in instruments]
    samples = (((name, outcome), count[outcome]) for name, count in counts for outcome in Outcome)
    yield counter("grabberd_fields", "Expected fields by outcome.", ("device", "outcome"), samples)
    boards = [(one.name, one.board.now) for one in instruments]
    losses = (((name, cause), board.losses[cause]) for name, board in boards for cause in LossCause)
    rebases = (((name, kind), board.rebases[kind]) for name, board in boards for kind in Rebase)
    yield counter("grabberd_fields_missing", "Fields not received, by cause.", ("device", "cause"), losses)
    yield counter(
        "grabberd_rebases", "Changes of the reference of numbers and times.", ("device", "kind"), rebases
    )
    yield from _standstills(instruments)


def _standstills(instruments: list[Instrument]) -> Iterator[Metric]:
    known = [(one.name, one.board.standstills) for one in instruments]
    counts = (((name, code), one.counts[code]) for name, one in known for code in one.seconds)
    seconds = (((name, code), one.seconds[code]) for name, one in known for code in one.seconds)
    yield counter(
        "grabberd_standstills", "Times the program stopped taking fields.", ("device", "cause"), counts
    )
    yield counter(
        "grabberd_standstill_seconds", "Total duration of standstills.", ("device", "cause"), seconds
    )


def _ring(instruments: list[Instrument]) -> Iterator[Metric]:
    rings = [(one.name, one.pipeline.ring) for one in instruments]
    slots = (((name,), ring.slots) for name, ring in rings)
    waiting = (((name,), ring.waiting) for name, ring in rings)
    deepest = (((name,), ring.deepest) for name, ring in rings)
    yield gauge("grabberd_ring_slots", "Slots of the ring in use.", ("device",), slots)
    yield gauge("grabberd_ring_waiting_slots", "Not yet read by the slowest reader.", ("device",), waiting)
    yield gauge("grabberd_ring_deepest_slots", "Maximum of waiting slots.", ("device",), deepest)


def _device(instruments: list[Instrument]) -> Iterator[Metric]:
    boards = [(one.name, one.board.now) for one in instruments]
    states = (((name, s), float(board.state is s)) for name, board in boards for s in DeviceState)
    signals = (((name, s), float(board.signal is s)) for name, board in boards for s in Signal)
    openings = (((name,), board.openings) for name, board in boards)
    steps = (((name, rung), board.recoveries[rung]) for name, board in boards for rung in Rung)
    yield gauge("grabberd_device_state", "1 for the current state.", ("device", "state"), states)
    yield gauge("grabberd_device_signal", "1 for the signal's current state.", ("device", "signal"), signals)
    yield counter("grabberd_device_openings", "Times it was opened.", ("device",), openings)
    yield counter("grabberd_device_recoveries", "Recovery steps taken.", ("device", "step"), steps)


def _points(instruments: list[Instrument]) -> Iterator[Metric]:
    lives = [(one.name, live) for one in instruments if (live := one.worker.live) is not None]
    points = (((name,), len(live.measured.points)) for name, live in lives)
    yield gauge("grabberd_live_points", "Points of the newest measured field.", ("device",), points)
    fits = [(one.name, fit) for one in instruments if (fit := one.worker.field_order.fit) is not None]
    verdicts = (((name, order), float(fit.order is order)) for name, fit in fits for order in Order)
    yield gauge("grabberd_field_order", "1 for the current verdict.", ("device", "order"), verdicts)
    yield _latency(instruments)


def _rig(instruments: list[Instrument]) -> Iterator[Metric]:
    fits = [(one.name, fit) for one in instruments if (fit := one.worker.rig.fit) is not None]
    verdicts = (((name, v), float(fit.verdict is v)) for name, fit in fits for v in RigVerdict)
    yield gauge("grabberd_rig", "1 for the current verdict.", ("device", "verdict"), verdicts)
    shifts = (((name,), fit.shift_px) for name, fit in fits if isfinite(fit.shift_px))
    words = "Displacement of the views across the epipolar lines."
    yield gauge("grabberd_rig_shift_pixels", words, ("device",), shifts)
    marks = [
        ((name, view), own) for name, fit in fits for view, own in zip(VIEWS, fit.marks or (), strict=False)
    ]
    sizes = ((labels, own.size_px) for labels, own in marks)
    words = "Movement that the marks show, taken off the images."
    yield gauge("grabberd_rig_corrected_pixels", words, ("device", "view"), sizes)
    states = (((*labels, s), float(own.state is s)) for labels, own in marks for s in MarkState)
    yield gauge("grabberd_marks", "1 for the current state.", ("device", "view", "state"), states)


def _latency(instruments: list[Instrument]) -> Metric:
    family = HistogramMetricFamily(
        "grabberd_latency_seconds", "From a field's arrival to its points.", labels=("device",)
    )
    for one in instruments:
        histogram = one.worker.latency.histogram
        family.add_metric((one.name,), list(_cumulative(histogram.counts)), histogram.sum_s)
    return family


def _cumulative(counts: tuple[int, ...]) -> Iterator[tuple[str, float]]:
    total = 0
    for bound, count in zip((*map(str, BOUNDS_S), "+Inf"), counts, strict=True):
        total += count
        yield bound, total


def _captures(instruments: list[Instrument], service: Service) -> Iterator[Metric]:
    running = (((one.name,), float(one.captures.running is not None)) for one in instruments)
    ended = (
        ((one.name, v), one.captures.ended[v]) for one in instruments for v in ("complete", "incomplete")
    )
    measured = (((one.name, v), one.captures.measured[v]) for one in instruments for v in CoverageVerdict)
    free = service.storage_document().free_bytes
    yield gauge("grabberd_capture_running", "1 while a capture is recorded.", ("device",), running)
    yield counter("grabberd_captures", "Captures sealed or given up.", ("device", "verdict"), ended)
    yield counter(
        "grabberd_captures_measured", "Measured captures, by coverage.", ("device", "verdict"), measured
    )
    yield single(gauge, "grabberd_disk_free_bytes", "Free space for captures.", free)


def _mqtt(service: Service) -> Iterator[Metric]:
    now = service.parts.state_fields().get("mqtt")
    if not isinstance(now, MqttDocument):
        return
    yield single(gauge, "grabberd_mqtt_connected", "1 while connected to the broker.", now.connected)
    waiting, acknowledged = now.waiting_captures, now.acknowledged_captures
    yield single(gauge, "grabberd_mqtt_waiting_captures", "Summaries not yet acknowledged.", waiting)
    yield single(counter, "grabberd_mqtt_acknowledged_captures", "Summaries acknowledged.", acknowledged)
    words = "Captures deleted before their summary could be published."
    yield single(counter, "grabberd_mqtt_missed_captures", words, now.missed_captures)
