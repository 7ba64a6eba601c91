"""Channels at a steady rate: so many samples to each field, each the mean of the readings in its step.

Nothing is filled in: a step without a reading is NaN.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.channels.reading_groups import RecordedChannel
from grabberd.archive.capture.reader import CaptureReader

Array = NDArray[np.float64]

MOST_PER_FIELD = 40
"""Samples to each field: 2000 a second."""


class ChannelSamples(NamedTuple):
    """C channels over F fields.

    Attributes:
        channels: The channels.
        per_field: Samples S to each field.
        values: (F · S, C) kPa below atmosphere, or the level of a light; NaN where there is no reading.
    """

    channels: Sequence[RecordedChannel]
    per_field: int
    values: NDArray[np.float32]


def channel_samples(reader: CaptureReader, first_n: int, fields: int) -> ChannelSamples | None:
    """The channels of a capture; None if it has none.

    Args:
        reader: The capture.
        first_n: Number of the first field.
        fields: Number of fields, lost ones included.

    Raises:
        CaptureFileError: A channel is damaged.
    """
    channels = reader.channels.all
    if not channels or not fields:
        return None
    curves = [_curve(reader, channel) for channel in channels]
    per_field = _per_field([time_ns for time_ns, _ in curves], reader.meta.rate_hz)
    edges_ns = _edges_ns(reader, first_n, fields, per_field)
    values = [_means(time_ns, value, edges_ns) for time_ns, value in curves]
    return ChannelSamples(channels, per_field, np.column_stack(values).astype(np.float32))


def _curve(reader: CaptureReader, channel: RecordedChannel) -> tuple[NDArray[np.int64], Array]:
    groups = list(reader.channels.groups(channel))
    time_ns = np.concatenate([np.empty(0, np.int64), *(one.time_ns for one in groups)])
    value = np.concatenate([np.empty(0), *(one.value for one in groups)])
    return time_ns, channel.calibration.kpa(value)


def _per_field(times_ns: Sequence[NDArray[np.int64]], rate_hz: float) -> int:
    """The whole number of samples that is nearest to what the fastest channel has."""
    steps_ns = [float(np.median(np.diff(time_ns))) for time_ns in times_ns if len(time_ns) > 1]
    fastest_hz = max((1e9 / step_ns for step_ns in steps_ns if step_ns > 0), default=rate_hz)
    return int(np.clip(round(fastest_hz / rate_hz), 1, MOST_PER_FIELD))


def _edges_ns(reader: CaptureReader, first_n: int, fields: int, per_field: int) -> Array:
    """(F · S + 1,) times between the samples, the first of which in each field is at the field's own time.

    Those of a lost field lie evenly between its neighbours'.
    """
    n, time_ns = reader.field_times()
    period_ns = 1e9 / reader.meta.rate_hz
    place = np.append(n - first_n, fields).astype(np.float64)
    last_ns = time_ns[-1] + (place[-1] - place[-2]) * period_ns
    between = (np.arange(fields * per_field + 1) - 0.5) / per_field
    edges = np.interp(between, place, np.append(time_ns, last_ns).astype(np.float64))
    edges[0] = time_ns[0] - period_ns / per_field / 2
    return edges


def _means(time_ns: NDArray[np.int64], value: Array, edges_ns: Array) -> Array:
    samples = len(edges_ns) - 1
    place = np.searchsorted(edges_ns, time_ns, side="right") - 1
    within = (place >= 0) & (place < samples) & np.isfinite(value)
    count = np.bincount(place[within], minlength=samples)
    total = np.bincount(place[within], value[within], minlength=samples)
    means: Array = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return means
