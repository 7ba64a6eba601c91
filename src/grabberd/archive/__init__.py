"""Captures on disk: one SQLite database each, what is exported from them, and the state that outlives them.

A capture file is crash-safe and readable from anything that reads SQLite; `docs/reference/capture-file.md`
describes it. It is called `NAME.grab.part` while it is written and `NAME.grab` once it is sealed.
"""

from grabberd.archive.capture.crash_recovery import recover
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.rows import RecordedField, RunInfo
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.export.c3d_file import export_c3d, points_c3d
from grabberd.archive.export.field_pictures import export_png, field_png
from grabberd.archive.export.hdf5_file import export_hdf5
from grabberd.archive.export.mat_file import export_mat
from grabberd.archive.export.points_export import (
    export_csv,
    export_parquet,
    export_ply,
    points_csv,
    points_ply,
)
from grabberd.archive.state.capture_index import CaptureIndex

__all__ = [
    "CaptureIndex",
    "CaptureMeta",
    "CaptureReader",
    "CaptureWriter",
    "RecordedField",
    "RunInfo",
    "append_run",
    "export_c3d",
    "export_csv",
    "export_hdf5",
    "export_mat",
    "export_parquet",
    "export_ply",
    "export_png",
    "field_png",
    "points_c3d",
    "points_csv",
    "points_ply",
    "recover",
]
