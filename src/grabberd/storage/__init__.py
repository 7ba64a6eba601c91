"""Captures on disk: one SQLite database a capture, an index over many, and what is exported from them.

A capture file is crash-safe and readable from anything that reads SQLite; `docs/reference/capture-file.md`
describes it. It is `NAME.grab.part` while it is written and `NAME.grab` once it is sealed.
"""

from grabberd.storage.codec import decode_points, encode_points
from grabberd.storage.export import (
    export_csv,
    export_parquet,
    export_ply,
    export_png,
    field_png,
    points_csv,
    points_ply,
)
from grabberd.storage.index import CaptureIndex
from grabberd.storage.meta import CaptureMeta
from grabberd.storage.reader import CaptureReader
from grabberd.storage.recover import recover
from grabberd.storage.rows import RecordedField, RunInfo
from grabberd.storage.runs import append_run
from grabberd.storage.writer import CaptureWriter

__all__ = [
    "CaptureIndex",
    "CaptureMeta",
    "CaptureReader",
    "CaptureWriter",
    "RecordedField",
    "RunInfo",
    "append_run",
    "decode_points",
    "encode_points",
    "export_csv",
    "export_parquet",
    "export_ply",
    "export_png",
    "field_png",
    "points_csv",
    "points_ply",
    "recover",
]
