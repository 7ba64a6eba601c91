"""Metrics of the data loggers and their channels."""

from collections.abc import Iterator

from prometheus_client.metrics_core import Metric

from grabberd.documents.states import DeviceState
from grabberd.instrument.channels.loggers import Loggers
from grabberd.server.api.routes.metric_families import counter, gauge

STATES = (
    *(DeviceState.OPENING, DeviceState.READY, DeviceState.ABSENT),
    *(DeviceState.FAILED, DeviceState.ENDED),
)
"""Those that a logger can have."""


def logger_metrics(loggers: Loggers) -> Iterator[Metric]:
    """Every metric of the loggers at this moment; families without samples where there is none."""
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
