"""Points of a capture as a document, thinned out to what a page can draw."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.checked_rows import END
from grabberd.archive.capture.reader import CaptureReader, Opened
from grabberd.archive.export.points_columns import sigma_mm
from grabberd.core.reconstruction.points import Points
from grabberd.documents.points import FieldPoints, PointsDocument

AXES = "xyz"
_END = b"]}"
"""End of the JSON of a document that ends with its list of fields."""


@dataclass(frozen=True, slots=True)
class PointsQuery:
    """Selection of points.

    Attributes:
        run: number of the run; None: the newest.
        first_n: number of the first field; `end_n`: number after the last one.
        every: only fields whose number is a multiple of it; an odd one keeps both parities.
        most: `every` is raised until no more points than this are left.
        targets: ids of the targets; empty: all.
    """

    run: int | None = None
    first_n: int = 0
    end_n: int = END
    every: int = 1
    most: int = 20_000
    targets: Collection[int] = ()


def points_json(path: Path, query: PointsQuery, opened: Opened = CaptureReader) -> bytearray:
    """The points of a run as the JSON of a `PointsDocument`, written field by field.

    Written at once, two million numbers would keep the interpreter from every other thread for as long, and
    joined from parts they would take three times their 50 MB of memory.

    Args:
        path: The capture.
        query: What is asked for.
        opened: Opens the capture.

    Raises:
        CaptureFileError, NotFound: no such file or run.
    """
    with opened(path) as reader:
        run = reader.run_number(query.run)
        every = _every(reader, run, query)
        head = PointsDocument(capture=reader.meta.id, run=run, every=every, fields=[])
        document = bytearray(head.model_dump_json().encode().removesuffix(_END))
        for number, one in enumerate(_fields(reader, run, every, query)):
            document += b"," if number else b""
            document += one.model_dump_json().encode()
        document += _END
        return document


def _fields(reader: CaptureReader, run: int, every: int, query: PointsQuery) -> Iterator[FieldPoints]:
    first_ns = reader.first_time_ns or 0
    for n, time_ns, points in reader.timed_points(run, query.first_n, query.end_n, every):
        # Not validated: the columns come straight from arrays of known types, and pydantic would look at each
        # of up to two million numbers.
        yield FieldPoints.model_construct(
            n=n, time_s=(time_ns - first_ns) / 1e9, **point_columns(_of_targets(points, query.targets))
        )


def _every(reader: CaptureReader, run: int, query: PointsQuery) -> int:
    """Raised by what is too much until it fits, or one field is left; targets that are not wanted count."""
    every = query.every
    while (count := reader.point_count(run, query.first_n, query.end_n, every)) > query.most:
        if every > max(query.first_n, _last_n(reader, query)):
            break
        every *= -(-count // query.most)
    return every


def _last_n(reader: CaptureReader, query: PointsQuery) -> int:
    return min(query.end_n, reader.ledger.end_n or 0)


def _of_targets(points: Points, targets: Collection[int]) -> Points:
    return points.select(np.isin(points.target, list(targets))) if targets else points


def point_columns(points: Points) -> dict[str, Any]:
    """The points of one field, by the columns' names in `PointColumns`."""
    return {
        "target": points.target.tolist(),
        **_axes("{}_mm", points.xyz_mm),
        **_axes("sigma_{}_mm", sigma_mm(points.covariance_mm2)),
        **_axes("calibration_sigma_{}_mm", sigma_mm(points.calibration_covariance_mm2)),
        "residual_px": points.residual_px.tolist(),
    }


def _axes(name: str, values: NDArray[np.float64]) -> dict[str, list[float]]:
    return {name.format(axis): values[:, i].tolist() for i, axis in enumerate(AXES)}
