"""Gauges and counters of samples, as Prometheus has them."""

from collections.abc import Iterable

from prometheus_client.metrics_core import CounterMetricFamily, GaugeMetricFamily, Metric

Samples = Iterable[tuple[tuple[str, ...], float]]
"""Label values and the number they belong to."""


def gauge(name: str, words: str, labels: tuple[str, ...], samples: Samples) -> Metric:
    """A number that goes up and down."""
    return _filled(GaugeMetricFamily(name, words, labels=labels), samples)


def counter(name: str, words: str, labels: tuple[str, ...], samples: Samples) -> Metric:
    """A number that only grows."""
    return _filled(CounterMetricFamily(name, words, labels=labels), samples)


def _filled(
    family: GaugeMetricFamily | CounterMetricFamily, samples: Samples
) -> GaugeMetricFamily | CounterMetricFamily:
    for labels, value in samples:
        family.add_metric(labels, value)
    return family
