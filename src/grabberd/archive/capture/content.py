"""Fields and points of a capture as they are read, whatever the format of the file."""

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.rows import RecordedField
from grabberd.core.reconstruction.points import Points


class PointArrays(NamedTuple):
    """Points of some fields.

    Attributes:
        n: (K,) int64, numbers of the fields, in order.
        time_ns: (K,) int64, their times.
        counts: (K,) int64, number of points of each.
        points: Those of all of them, one field after the other.
    """

    n: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    counts: NDArray[np.int64]
    points: Points

    def by_field(self) -> Iterator[tuple[int, int, Points]]:
        """(n, time_ns, points) of each field."""
        ends = np.cumsum(self.counts).tolist()
        begins = [0, *ends[:-1]]
        for n, time_ns, *ends_of in zip(self.n.tolist(), self.time_ns.tolist(), begins, ends, strict=True):
            yield n, time_ns, _part(self.points, slice(*ends_of))

    def select(self, chosen: NDArray[np.bool_]) -> "PointArrays":
        """Those of some of the fields, by a mask."""
        if chosen.all():
            return self
        points = self.points.select(np.repeat(chosen, self.counts))
        return PointArrays(self.n[chosen], self.time_ns[chosen], self.counts[chosen], points)


def _part(points: Points, part: slice) -> Points:
    """Some points beside each other, as views."""
    return Points(
        points.target[part],
        points.xyz_mm[part],
        points.covariance_mm2[part],
        points.calibration_covariance_mm2[part],
        points.image_px[part],
        points.residual_px[part],
    )


class Content(Protocol):
    """Fields and points of one file.

    Damaged ones are errors, or are left out and noted, as the reader was told.
    """

    @property
    def has_digests(self) -> bool:
        """False for files of earlier versions, in which a changed bit may go unnoticed."""

    def keep_groups(self) -> None:
        """Keeps what is decoded last from now on: nobody changes the file as long as it is read."""

    def fields(self, first_n: int, end_n: int) -> Iterator[RecordedField]:
        """The fields with first_n ≤ n < end_n, in order."""

    def points(self, run: int, first_n: int, end_n: int, every: int) -> Iterator[PointArrays]:
        """Points of fields that are in the file, with first_n ≤ n < end_n and n a multiple of `every`."""

    def check_points(self, run: int, first_n: int, end_n: int) -> None:
        """Holds points against their digests, without decoding them."""

    def point_count(self, run: int, first_n: int, end_n: int, every: int) -> int:
        """Number of points, without reading them."""

    def point_span(self, run: int, first_n: int, end_n: int) -> tuple[int, int]:
        """Number of points of fields that are in the file, and the number after the last field with some."""

    def measured(self, run: int) -> int:
        """Reads and decodes all points of a run; returns the number of fields that have some."""

    def unaccounted(self) -> list[str]:
        """Lists in words what belongs to nothing else in the file."""
