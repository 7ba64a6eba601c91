"""The columns of exported points and of data sets, and how a field's points fill them."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import END
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.core.chain.columns import LABELS, WORD, Column, Rows
from grabberd.core.reconstruction.points import Points
from grabberd.core.reconstruction.smoothing import locked_share

_NUMBER = Column("n", "", "i4", "number of the field: n nominal steps since the first, including lost ones")
_UTC = Column("time_utc", "", "M8[ms]", "middle of the field's exposure; empty for a replayed recording")
_POSITION = (
    Column("time_s", "s", "f8", "the same, in seconds since the capture's first field", csv_format=".6f"),
    Column("target", "", "i4", "id of the target, the same through the capture"),
    # All digits, so that CSV reads back bit for bit.
    *(Column(f"{a}_mm", "mm", "f8", f"{a.upper()} in the object's frame", csv_format="") for a in "xyz"),
)
_FROM_CALIBRATION = "from the calibration: common to all fields, not reduced by averaging"


def _measure(name: str, unit: str, meaning: str) -> Column:
    """Single precision and six digits: a capture file holds no more of it."""
    return Column(name, unit, "f4", meaning, csv_format=".6g")


_QUALITY = (
    *(_measure(f"sigma_{axis}_mm", "mm", f"σ of {axis}_mm from pointing and line jitter") for axis in "xyz"),
    *(
        _measure(f"calibration_sigma_{axis}_mm", "mm", f"σ of {axis}_mm {_FROM_CALIBRATION}")
        for axis in "xyz"
    ),
    _measure("residual_px", "px", "root mean square of the image residuals of the intersection"),
)
_LOCKED = "that stays in a mean while its image rests: locked to its place between the pixels"
_LOCKED_SIGMA = tuple(
    _measure(f"locked_sigma_{axis}_mm", "mm", f"part of sigma_{axis}_mm {_LOCKED}") for axis in "xyz"
)
_IMAGES = tuple(
    _measure(f"{view}_{axis}_px", "px", f"{axis} of its image in the {view} view, in frame pixels")
    for view in ("left", "right")
    for axis in "xy"
)

# What came later stands at the end: programs count columns.
POINT_COLUMNS = (_NUMBER, _UTC, *_POSITION, *_QUALITY, *_IMAGES, *_LOCKED_SIGMA)
GRID_ARRAYS: Mapping[str, tuple[str, ...]] = {
    "xyz_mm": ("x_mm", "y_mm", "z_mm"),
    "sigma_mm": ("sigma_x_mm", "sigma_y_mm", "sigma_z_mm"),
    "calibration_sigma_mm": ("calibration_sigma_x_mm", "calibration_sigma_y_mm", "calibration_sigma_z_mm"),
    "residual_px": ("residual_px",),
    "left_px": ("left_x_px", "left_y_px"),
    "right_px": ("right_x_px", "right_y_px"),
    "locked_sigma_mm": ("locked_sigma_x_mm", "locked_sigma_y_mm", "locked_sigma_z_mm"),
}
"""Arrays over fields and targets, for formats that have such, and the columns side by side in each."""


def _array(name: str, meaning: str) -> Column:
    """An array with the unit and type of its columns."""
    first = next(one for one in POINT_COLUMNS if one.name == GRID_ARRAYS[name][0])
    return first._replace(name=name, meaning=meaning)


GRID_COLUMNS = (
    _NUMBER,
    Column("time_s", "s", "f8", "middle of its exposure, since the first field; unknown for lost fields"),
    Column("target", "", "i4", "ids of all targets of the object model, found or not"),
    Column("row", "", "i4", "its row on the target grid"),
    Column("column", "", "i4", "its column on the target grid"),
    Column("nominal_mm", "mm", "f8", "its nominal X, Y and Z in the object model"),
    _array("xyz_mm", "X, Y and Z in the object's frame"),
    _array("sigma_mm", "σ of X, Y and Z from pointing and line jitter"),
    _array("calibration_sigma_mm", f"σ of X, Y and Z {_FROM_CALIBRATION}"),
    _array("residual_px", "root mean square of the image residuals of the intersection"),
    _array("left_px", "x and y of its image in the left view, in frame pixels"),
    _array("right_px", "x and y of its image in the right view, in frame pixels"),
    _array("locked_sigma_mm", f"part of sigma_mm {_LOCKED}"),
)
CLOUD_COLUMNS = (_NUMBER, *_POSITION, *_QUALITY, *_LOCKED_SIGMA)
"""Columns of a point cloud, for programs that know neither the time of day nor pictures."""
DATASET_COLUMNS = (
    *POINT_COLUMNS,
    Column("capture", "", WORD, "id of the capture"),
    Column("device", "", WORD, "name of the grabber"),
    Column("calibration", "", WORD, "id of the calibration the points were measured with"),
    Column("labels", "", LABELS, "the capture's labels as recorded"),
)


def rows_of(
    n: NDArray[np.int64],
    times_ns: NDArray[np.int64],
    points: Sequence[Points],
    meta: CaptureMeta,
    first_ns: int,
) -> Rows:
    """The points of some fields by the names of `POINT_COLUMNS`.

    Args:
        n: (F,) the fields' numbers.
        times_ns: (F,) their times.
        points: Points of each.
        meta: Metadata of their capture.
        first_ns: Time of its first field.
    """
    return _timed_rows(n, times_ns, [len(one) for one in points], Points.joined(points), meta, first_ns)


def _timed_rows(
    n: NDArray[np.int64],
    times_ns: NDArray[np.int64],
    counts: Sequence[int] | NDArray[np.int64],
    points: Points,
    meta: CaptureMeta,
    first_ns: int,
) -> Rows:
    """Points by the names of `POINT_COLUMNS`, with what each has of its field."""
    of_fields: tuple[NDArray[Any], ...] = (n, moments(times_ns, meta), (times_ns - first_ns) / 1e9)
    sigma, calibration = sigma_mm(points.covariance_mm2), sigma_mm(points.calibration_covariance_mm2)
    of_points = (points.target, *points.xyz_mm.T, *sigma.T, *calibration.T, points.residual_px)
    images = points.image_px.reshape(len(points), 4)
    locked = sigma * np.sqrt(locked_share(meta.bits, interlaced=meta.is_interlaced))
    values = (*(np.repeat(one, counts) for one in of_fields), *of_points, *images.T, *locked.T)
    return {
        column.name: value.astype(column.dtype) for column, value in zip(POINT_COLUMNS, values, strict=True)
    }


def moments(times_ns: NDArray[np.int64], meta: CaptureMeta) -> NDArray[np.datetime64]:
    """Times of day in UTC; not known for a recording played again, whose clock has passed."""
    if not meta.device.get("stream", {}).get("live", True):
        return np.full(len(times_ns), np.datetime64("NaT", "ms"))
    start = datetime.fromisoformat(meta.created_utc).astimezone(UTC).replace(tzinfo=None)
    since_us = np.rint((times_ns - meta.start_ns) / 1000).astype("m8[us]")
    return (np.datetime64(start, "us") + since_us).astype("M8[ms]")


def sigma_mm(covariance_mm2: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) standard deviations from (N, 3, 3) covariances."""
    return np.sqrt(np.diagonal(covariance_mm2, axis1=1, axis2=2))


def rows_by_group(
    reader: CaptureReader, run: int, first_n: int = 0, end_n: int = END, every: int = 1
) -> Iterator[Rows]:
    """The points of a run, as many fields together as the file has together."""
    first_ns = reader.first_time_ns or 0
    for n, times_ns, counts, points in reader.point_arrays(run, first_n, end_n, every):
        yield _timed_rows(n, times_ns, counts, points, reader.meta, first_ns)
