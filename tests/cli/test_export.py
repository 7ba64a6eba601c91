"""`grabberd export`: into a new folder, in the format that was asked for."""

import csv
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from archive.captures import slots, write
from grabberd.cli.app import app
from grabberd.errors import CaptureFileError, NotFound


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return write(tmp_path, slots(4), measured=range(4), fields_a_commit=1)


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["export", *map(str, words)])


@pytest.mark.parametrize(
    ("format", "file"),
    [
        ("csv", "points.csv"),
        ("csv-semicolon", "points.csv"),
        ("ply", "points.ply"),
        ("parquet", "points.parquet"),
        ("mat", "points.mat"),
        ("c3d", "points.c3d"),
    ],
)
def test_points_are_written_and_counted(capture: Path, tmp_path: Path, format: str, file: str) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow")
    result = run(capture, "--format", format, "--out", tmp_path / "out")
    assert result.output.strip().endswith(f"{file}: 20 points")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {file, "ledger.csv"}


def test_a_link_that_was_named_by_hand_is_followed(capture: Path, tmp_path: Path) -> None:
    link = tmp_path / "newest.grab"
    link.symlink_to(capture)
    assert run(link, "--out", tmp_path / "out").exit_code == 0


@pytest.mark.parametrize("format", ["csv", "ply", "parquet", "mat", "c3d", "png"])
def test_what_the_disk_has_changed_is_left_out_and_listed(capture: Path, tmp_path: Path, format: str) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow")
    with closing(sqlite3.connect(capture)) as connection, connection:
        connection.execute("UPDATE points SET target = zeroblob(9) WHERE first_n = 2")
        connection.execute("UPDATE fields SET threshold = threshold + 1 WHERE n = 3")
        connection.execute("UPDATE meta SET value = '\"second\"' WHERE key = 'note'")
    result = run(capture, "--format", format, "--out", tmp_path / "out")
    assert result.exit_code == 0
    assert ("15 points" in result.stdout) or ("3 pictures" in result.stdout)
    assert "its metadata: it is not what was written" in result.stderr
    n = 3 if format == "png" else 2
    assert f"field {n}: it is not what was written" in result.stderr
    with (tmp_path / "out" / "left_out.csv").open() as file:
        assert [row["n"] for row in csv.DictReader(file)] == [str(n)]


@pytest.mark.parametrize("format", ["csv", "ply", "parquet", "mat", "c3d"])
def test_points_that_are_gone_are_listed_too(capture: Path, tmp_path: Path, format: str) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow")
    with closing(sqlite3.connect(capture)) as connection, connection:
        connection.execute("DELETE FROM points WHERE first_n = 2")
    result = run(capture, "--format", format, "--out", tmp_path / "out")
    assert "15 points" in result.stdout
    with (tmp_path / "out" / "left_out.csv").open() as file:
        assert [(row["n"], row["reason"]) for row in csv.DictReader(file)] == [("2", "it is missing")]


def test_a_damaged_field_that_was_asked_for_is_an_error(capture: Path, tmp_path: Path) -> None:
    with closing(sqlite3.connect(capture)) as connection, connection:
        connection.execute("UPDATE points SET target = zeroblob(9) WHERE first_n = 2")
    words = ("--format", "ply", "--field")
    assert run(capture, *words, 1, "--out", tmp_path / "one").exit_code == 0
    assert isinstance(run(capture, *words, 2, "--out", tmp_path / "two").exception, CaptureFileError)


def test_one_field_can_be_chosen_for_a_cloud(capture: Path, tmp_path: Path) -> None:
    result = run(capture, "--format", "ply", "--field", 2, "--out", tmp_path / "out")
    assert result.output.strip().endswith("points.ply: 5 points")
    assert run(capture, "--format", "csv", "--field", 2, "--out", tmp_path / "other").exit_code == 2


def test_a_run_that_there_is_not_makes_no_folder(capture: Path, tmp_path: Path) -> None:
    for format in ("csv", "ply", "mat", "c3d"):
        result = run(capture, "--format", format, "--run", 7, "--out", tmp_path / "out")
        assert isinstance(result.exception, NotFound)
    assert not (tmp_path / "out").exists()
