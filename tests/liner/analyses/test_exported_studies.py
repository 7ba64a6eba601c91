"""A study as files, opened by foreign readers."""

import csv
import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from grabberd.errors import InputError, StorageError
from grabberd_liner.analyses.export import TABLE_FORMATS, check_formats, write_tables
from grabberd_liner.chain.study.study import StudyQuestion, make_study
from grabberd_liner.chain.study.study_document import tables
from liner.chain.study.captured import COMPRESSION, herd

TABLES = tables(make_study(StudyQuestion(by="liner", within="cow"), herd()))
ABOUT = {"version": "1"}


def test_csv_has_a_row_a_capture_and_names_with_units(tmp_path: Path) -> None:
    files = write_tables(tmp_path, TABLES, ABOUT, ["csv"])
    assert [path.name for path in files] == [f"{name}.csv" for name in TABLES]
    with (tmp_path / "captures.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12
    assert float(rows[0][f"sigma_common_{COMPRESSION}"]) == 0.1
    assert rows[0]["label_cow"] == "100"


def test_parquet_has_the_same_values_with_units(tmp_path: Path) -> None:
    write_tables(tmp_path, TABLES, ABOUT, ["parquet"])
    table = pq.read_table(tmp_path / "captures.parquet")
    assert table.column(COMPRESSION).to_pylist() == TABLES["captures"].column(COMPRESSION).tolist()
    assert table.schema.field(COMPRESSION).metadata[b"unit"] == b"kPa"
    assert json.loads(table.schema.metadata[b"grabberd"]) == ABOUT
    comparison = pq.read_table(tmp_path / "comparison.parquet")
    assert comparison.column("verdict").to_pylist() == TABLES["comparison"].column("verdict").tolist()


def test_unknown_formats_and_files_that_exist_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a study cannot be written as xlsx"):
        check_formats(["csv", "xlsx"], TABLE_FORMATS, "a study")
    write_tables(tmp_path, TABLES, ABOUT, ["csv"])
    with pytest.raises(StorageError, match="exists"):
        write_tables(tmp_path, TABLES, ABOUT, ["csv"])
