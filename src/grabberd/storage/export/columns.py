"""The columns of exported points: what each is, in which unit, and how it is read off a field's points."""

from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.reconstruction.points import Points
from grabberd.storage.capture.metadata import CaptureMeta

TIME = "time_utc"


class Column(NamedTuple):
    """One column; `kind` is numpy's name of its type, `unit` is empty where it has none."""

    name: str
    kind: str
    unit: str
    meaning: str


COLUMNS = (
    Column("n", "i4", "", "number of the field: n nominal 20 ms steps after the first, lost ones included"),
    Column(TIME, "M8[ms]", "", "middle of the field's exposure; empty for a recording played again"),
    Column("time_s", "f8", "s", "the same, from the first field of the capture on"),
    Column("target", "i4", "", "id of the target, the same through the capture"),
    *(Column(f"{axis}_mm", "f8", "mm", f"{axis.upper()} in the object's frame") for axis in "xyz"),
    *(
        Column(f"sigma_{axis}_mm", "f4", "mm", f"σ of {axis}_mm from pointing and line jitter")
        for axis in "xyz"
    ),
    *(
        Column(
            f"calibration_sigma_{axis}_mm",
            "f4",
            "mm",
            f"σ of {axis}_mm from the calibration: common to all fields, reduced by no averaging",
        )
        for axis in "xyz"
    ),
    Column("residual_px", "f4", "px", "root mean square of what the intersection leaves in the images"),
    *(
        Column(f"{view}_{axis}_px", "f4", "px", f"{axis} of its image in the {view} view, in frame pixels")
        for view in ("left", "right")
        for axis in "xy"
    ),
)
POINT_COLUMNS = tuple(column.name for column in COLUMNS)
Rows = dict[str, NDArray[np.generic]]
"""Values by the name of their column, one for each point."""


def rows_of(n: int, time_s: float, moment: datetime | None, points: Points) -> Rows:
    """One field's points, column by column."""
    sigma = np.sqrt(np.diagonal(points.covariance_mm2, axis1=1, axis2=2))
    calibration = np.sqrt(np.diagonal(points.calibration_covariance_mm2, axis1=1, axis2=2))
    utc = np.datetime64("NaT", "ms") if moment is None else np.datetime64(moment.replace(tzinfo=None), "ms")
    images = points.image_px.reshape(len(points), 4)
    values = (n, utc, time_s, points.target, *points.xyz_mm.T, *sigma.T, *calibration.T)
    values = (*values, points.residual_px, *images.T)
    return {
        column.name: np.broadcast_to(np.asarray(value, column.kind), len(points))
        for column, value in zip(COLUMNS, values, strict=True)
    }


def moment_of(time_ns: int, meta: CaptureMeta) -> datetime | None:
    """The time of day in UTC; None for a recording played again, whose clock has passed."""
    if not meta.device.get("stream", {}).get("live", True):
        return None
    since = timedelta(microseconds=(time_ns - meta.start_ns) / 1000)
    return (datetime.fromisoformat(meta.created_utc) + since).astimezone(UTC)
