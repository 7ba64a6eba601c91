"""A study as files in a folder, in the formats that are asked for."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from grabberd.archive.export.table_files import check_parquet
from grabberd.errors import InputError
from grabberd_liner.analyses.export import write_csv, write_parquet_files
from grabberd_liner.chain.study.tables import StudyTables

STUDY_FORMATS = ("csv", "parquet")


def check_study_formats(formats: Collection[str]) -> None:
    """Checks that all formats can be written, before any work is done for them.

    Raises:
        InputError: One is unknown.
        ExtraMissing: The library for one is not installed.
    """
    if unknown := sorted(set(formats) - set(STUDY_FORMATS)):
        raise InputError(
            f"a study cannot be written as {', '.join(unknown)}", f"choose from {', '.join(STUDY_FORMATS)}"
        )
    if "parquet" in formats:
        check_parquet()


def write_study(
    folder: Path, tables: StudyTables, about: Mapping[str, Any], formats: Collection[str]
) -> list[Path]:
    """Writes the tables of a study into an existing folder; returns the files.

    Args:
        folder: Gets a file for each table and format.
        tables: Tables of the study.
        about: Its origin, for the formats that have room for it.
        formats: Any of `STUDY_FORMATS`.

    Raises:
        InputError, ExtraMissing: See `check_study_formats`.
        StorageError: A file cannot be written, or exists already.
    """
    check_study_formats(formats)
    written = write_csv(folder, tables) if "csv" in formats else []
    return written + (write_parquet_files(folder, tables, about) if "parquet" in formats else [])
