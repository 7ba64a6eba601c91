"""The columns of exported points and of data sets, and how a field's points fill them."""

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.processes.columns import LABELS, WORD, Column, Rows
from grabberd.reconstruction.points import Points
from grabberd.storage.capture.checked_rows import END
from grabberd.storage.capture.meta import CaptureMeta
from grabberd.storage.capture.reader import CaptureReader

_NUMBER = Column(
    "n", "", "i4", "number of the field: n nominal 20 ms steps after the first, lost ones included"
)
_UTC = Column("time_utc", "", "M8[ms]", "middle of the field's exposure; empty for a recording played again")
_POSITION = (
    Column("time_s", "s", "f8", "the same, from the first field of the capture on", csv_format=".6f"),
    Column("target", "", "i4", "id of the target, the same through the capture"),
    # All digits, so that CSV reads back bit for bit.
    *(Column(f"{a}_mm", "mm", "f8", f"{a.upper()} in the object's frame", csv_format="") for a in "xyz"),
)
_FROM_CALIBRATION = "from the calibration: common to all fields, reduced by no averaging"


def _measure(name: str, unit: str, meaning: str) -> Column:
    """Single precision and six digits: a capture file holds no more of it."""
    return Column(name, unit, "f4", meaning, csv_format=".6g")


_QUALITY = (
    *(_measure(f"sigma_{axis}_mm", "mm", f"σ of {axis}_mm from pointing and line jitter") for axis in "xyz"),
    *(
        _measure(f"calibration_sigma_{axis}_mm", "mm", f"σ of {axis}_mm {_FROM_CALIBRATION}")
        for axis in "xyz"
    ),
    _measure("residual_px", "px", "root mean square of what the intersection leaves in the images"),
)
_IMAGES = tuple(
    _measure(f"{view}_{axis}_px", "px", f"{axis} of its image in the {view} view, in frame pixels")
    for view in ("left", "right")
    for axis in "xy"
)

POINT_COLUMNS = (_NUMBER, _UTC, *_POSITION, *_QUALITY, *_IMAGES)
CLOUD_COLUMNS = (_NUMBER, *_POSITION, *_QUALITY)
"""Columns of a point cloud, for programs that know neither the time of day nor pictures."""
DATASET_COLUMNS = (
    *POINT_COLUMNS,
    Column("capture", "", WORD, "id of the capture"),
    Column("device", "", WORD, "name of the grabber"),
    Column("calibration", "", WORD, "id of the calibration the points were measured with"),
    Column("labels", "", LABELS, "the capture's labels as they were recorded"),
)


class FieldPoints(NamedTuple):
    """One field's points: its number, the time since the first field, the time of day if it is known."""

    n: int
    time_s: float
    moment: datetime | None
    points: Points


def rows_of(fields: Sequence[FieldPoints]) -> Rows:
    """The points of some fields by the names of `POINT_COLUMNS`."""
    counts = [len(one.points) for one in fields]
    n, time_s = (
        np.repeat([one.n for one in fields], counts),
        np.repeat([one.time_s for one in fields], counts),
    )
    utc = np.repeat([_utc(one.moment) for one in fields], counts)
    return _rows(n, utc, time_s, Points.joined([one.points for one in fields]))


def _rows(n: NDArray[Any], utc: NDArray[np.datetime64], time_s: NDArray[np.float64], points: Points) -> Rows:
    """Points by the names of `POINT_COLUMNS`, with what each has of its field."""
    sigma, calibration = sigma_mm(points.covariance_mm2), sigma_mm(points.calibration_covariance_mm2)
    images = points.image_px.reshape(len(points), 4)
    values = (n, utc, time_s, points.target, *points.xyz_mm.T, *sigma.T, *calibration.T)
    values = (*values, points.residual_px, *images.T)
    return {
        column.name: value.astype(column.dtype) for column, value in zip(POINT_COLUMNS, values, strict=True)
    }


def _utc(moment: datetime | None) -> np.datetime64:
    return np.datetime64("NaT", "ms") if moment is None else np.datetime64(moment.replace(tzinfo=None), "ms")


def sigma_mm(covariance_mm2: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) standard deviations from (N, 3, 3) covariances."""
    sigma: NDArray[np.float64] = np.sqrt(np.diagonal(covariance_mm2, axis1=1, axis2=2))
    return sigma


def rows_by_group(reader: CaptureReader, run: int, first_n: int = 0, end_n: int = END) -> Iterator[Rows]:
    """The points of a run, as many fields together as the file has together."""
    first_ns = reader.first_time_ns or 0
    for n, times_ns, counts, points in reader.point_arrays(run, first_n, end_n):
        moments = [_utc(moment_of(time_ns, reader.meta)) for time_ns in times_ns.tolist()]
        times_s = (times_ns - first_ns) / 1e9
        utc = np.repeat(np.array(moments, "M8[ms]"), counts)
        yield _rows(np.repeat(n, counts), utc, np.repeat(times_s, counts), points)


def moment_of(time_ns: int, meta: CaptureMeta) -> datetime | None:
    """The time of day in UTC; None for a recording played again, whose clock has passed."""
    if not meta.device.get("stream", {}).get("live", True):
        return None
    since = timedelta(microseconds=(time_ns - meta.start_ns) / 1000)
    return (datetime.fromisoformat(meta.created_utc) + since).astimezone(UTC)
