"""An analysis as files in a folder, in the formats that are asked for."""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from grabberd.analysis import Grid
from grabberd.errors import InputError
from grabberd.processes.analysis.tables import AnalysisTables
from grabberd.storage.capture.schema import storage_errors
from grabberd.storage.export.analysis_meshes import write_ply, write_vtu
from grabberd.storage.export.analysis_tables import (
    check_installed,
    write_csv,
    write_hdf5,
    write_parquet_tables,
)

ANALYSIS_FORMATS = ("csv", "parquet", "hdf5", "vtu", "ply")


def check_formats(formats: Collection[str]) -> None:
    """Whether all can be written, before any work is done for them.

    Raises:
        InputError: one is unknown.
        ExtraMissing: what writes one is not installed.
    """
    if unknown := sorted(set(formats) - set(ANALYSIS_FORMATS)):
        raise InputError(
            f"an analysis cannot be written as {', '.join(unknown)}",
            f"choose of {', '.join(ANALYSIS_FORMATS)}",
        )
    for one in formats:
        check_installed(one)


def write_analysis(
    folder: Path, tables: AnalysisTables, grid: Grid, about: Mapping[str, Any], formats: Collection[str]
) -> list[Path]:
    """Writes into a folder that is there; returns the files, those of meshes by their folders.

    Args:
        folder: CSV, Parquet and HDF5 stand in it, meshes in its folders `vtu` and `ply`.
        tables: of the analysis.
        grid: of its targets.
        about: what it was made from, for the formats that have room for it.
        formats: of `ANALYSIS_FORMATS`.

    Raises:
        InputError, ExtraMissing: see `check_formats`.
        StorageError: a file cannot be written, or is there already.
    """
    check_formats(formats)
    writers: dict[str, Callable[[], list[Path]]] = {
        "csv": lambda: write_csv(folder, tables),
        "parquet": lambda: write_parquet_tables(folder, tables, about),
        "hdf5": lambda: [write_hdf5(folder, tables, grid, about)],
        "vtu": lambda: _inside(folder / "vtu", lambda inner: write_vtu(inner, tables, grid)),
        "ply": lambda: _inside(folder / "ply", lambda inner: write_ply(inner, tables, grid)),
    }
    return [path for one in ANALYSIS_FORMATS if one in formats for path in writers[one]()]


def _inside(folder: Path, write: Callable[[Path], object]) -> list[Path]:
    with storage_errors(folder):
        folder.mkdir()
    write(folder)
    return [folder]
