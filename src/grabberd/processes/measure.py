"""Fields in, points out: location, correspondence and intersection (paper figures 4 and 10)."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from grabberd.field import NumberedField
from grabberd.geometry.calibration import Calibration
from grabberd.measurement.blobs import Blobs
from grabberd.reconstruction.object_model import ObjectModel
from grabberd.reconstruction.points import Points


@dataclass(frozen=True, slots=True)
class MeasureSetup:
    """What a measurement is made with; the same setup and fields give the same points, bit for bit."""

    calibration: Calibration
    object_model: ObjectModel
    # location: LocationSettings; tracking: TrackingSettings


class MeasuredField(NamedTuple):
    """One field's blobs and points."""

    n: int
    time_ns: int
    blobs: Blobs
    points: Points


def measure_fields(fields: Iterable[NumberedField], setup: MeasureSetup) -> Iterator[MeasuredField]:
    """Points of every field, in order; state (identities, velocities) is carried from field to field.

    Yields one result for each field as soon as it has taken it, so the fields may be endless.
    """
    raise NotImplementedError
