"""The formats that the points of a capture are exported in."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from grabberd.archive.capture.digests import Damage
from grabberd.archive.export.c3d_file import export_c3d
from grabberd.archive.export.hdf5_file import export_hdf5
from grabberd.archive.export.mat_file import export_mat
from grabberd.archive.export.points_export import export_csv, export_parquet, export_ply
from grabberd.archive.export.table_files import SEMICOLONS

POINT_EXPORTS: Mapping[str, Callable[[Path, Path, int | None, list[Damage] | None], int]] = {
    "csv": export_csv,
    "csv-semicolon": partial(export_csv, dialect=SEMICOLONS),
    "parquet": export_parquet,
    "hdf5": export_hdf5,
    "mat": export_mat,
    "c3d": export_c3d,
    "ply": export_ply,
}
"""By the name of a format; for the arguments see `export_csv`."""
