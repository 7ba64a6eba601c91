"""Metrics of the devices' health: the verdict that everybody goes by, part by part."""

from collections.abc import Iterator

from prometheus_client.metrics_core import Metric

from grabberd.fault_board import OWN_CAUSES
from grabberd.instrument.live.health import LEVELS, device_health, lacks_of
from grabberd.server.api.routes.metric_families import counter, gauge
from grabberd.server.daemon.descriptors import exhaustion
from grabberd.server.daemon.service import Service

_DAY_S = 86_400


def health_metrics(service: Service) -> Iterator[Metric]:
    """Health, readiness, calibration and disk of every device at this moment."""
    around = service.surroundings()
    instruments = service.instruments.values()
    found = {one.name: device_health(one, around) for one in instruments}
    levels = (((name, s), float(one.level == s)) for name, one in found.items() for s in LEVELS)
    yield gauge("grabberd_health", "1 for the current level of the health.", ("device", "level"), levels)
    parts = (
        ((name, part, s), float(told.level == s))
        for name, one in found.items()
        for part, told in one.parts.items()
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
    yield gauge("grabberd_disk_left_seconds", words, (), [] if left is None else [((), left * 60)])


def fault_metrics(service: Service) -> Iterator[Metric]:
    """Faults of the daemon itself, and what it has done about them."""
    board, unsealed = service.faults, service.unsealed
    now = (((cause,), float(board.has(cause))) for cause in OWN_CAUSES)
    counts = (((cause,), board.counts[cause]) for cause in OWN_CAUSES)
    yield gauge("grabberd_fault", "1 while the daemon has this fault.", ("cause",), now)
    yield counter("grabberd_faults", "Times the fault has occurred.", ("cause",), counts)
    yield counter(
        "grabberd_index_rebuilds", "Rebuilds of a damaged index.", (), [((), service.archive.keeper.rebuilt)]
    )
    yield gauge(
        "grabberd_unsealed_captures", "Captures still to be sealed.", (), [((), len(unsealed.captures))]
    )
    yield counter(
        "grabberd_failed_seals", "Failed attempts to seal a capture.", (), [((), unsealed.attempts)]
    )
    yield counter(
        "grabberd_state_backups", "Backups of state.sqlite.", (), [((), service.state_keeper.backed_up)]
    )
    yield counter(
        "grabberd_descriptors_exhausted", "Refused for lack of descriptors.", (), [((), exhaustion.count)]
    )
