"""`grabberd export`: into a new folder, in the format that was asked for."""

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.errors import NotFound
from storage.captures import slots, write


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return write(tmp_path, slots(4), measured=range(4))


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["export", *map(str, words)])


@pytest.mark.parametrize(
    ("format", "file"), [("csv", "points.csv"), ("ply", "points.ply"), ("parquet", "points.parquet")]
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


def test_one_field_can_be_chosen_for_a_cloud(capture: Path, tmp_path: Path) -> None:
    result = run(capture, "--format", "ply", "--field", 2, "--out", tmp_path / "out")
    assert result.output.strip().endswith("points.ply: 5 points")
    assert run(capture, "--format", "csv", "--field", 2, "--out", tmp_path / "other").exit_code == 2


def test_a_run_that_there_is_not_makes_no_folder(capture: Path, tmp_path: Path) -> None:
    for format in ("csv", "ply"):
        result = run(capture, "--format", format, "--run", 7, "--out", tmp_path / "out")
        assert isinstance(result.exception, NotFound)
    assert not (tmp_path / "out").exists()
