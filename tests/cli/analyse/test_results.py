"""What `grabberd analyse` writes and says."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import Result

from archive.milkings import milking
from cli.analyse.analysing import (
    CSV,
    INPUTS,
    LOGGED,
    inputs_file,
    refusal,
    rows,
    run,
    said,
    written,
)
from core.chain.milking import PERIOD_S, field, log
from grabberd.errors import (
    ExtraMissing,
    GrabberdError,
    InputError,
    NotFound,
    StorageError,
)
from grabberd_liner.chain.analysis.columns import TABLES

pytestmark = pytest.mark.timeout(600)


@pytest.fixture(scope="module")
def analysed(pulsating: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    """With everything."""
    folder = tmp_path_factory.mktemp("analysed")
    vacuum_log = folder / "log.csv"
    vacuum_log.write_text("\ufeff" + log(1.6, start_s=-0.3))
    inputs = inputs_file(folder, {**INPUTS, "vacuum": LOGGED, "sought_kpa": 1.0})
    more = ("--vacuum-log", vacuum_log, "--formats", "csv, hdf5,parquet,ply,vtu,mat", "--json")
    return run(pulsating, "--inputs", inputs, *more, "--out", folder / "out"), folder / "out"


def test_all_formats_and_the_report_are_written(analysed: tuple[Result, Path]) -> None:
    result, out = analysed
    assert result.exit_code == 0, result.output
    others = {"analysis.h5", "analysis.mat", "ply", "vtu", "report.json", "report.html"}
    assert written(out) == CSV | {f"{name}.parquet" for name in TABLES} | others
    assert written(out / "ply") > {"field-00000000.ply", "phase-0.2500.ply"}
    assert (out / "report.html").read_text().startswith("<!DOCTYPE html>")


def test_scripts_are_told_what_was_found_what_lacks_and_where_it_is(analysed: tuple[Result, Path]) -> None:
    result, out = analysed
    found = json.loads(result.stdout)
    assert abs(found["summary"]["period_s"] - PERIOD_S) < 4 * found["summary"]["sigma_period_s"]
    assert (found["id"], found["run"], found["summary"]["missing"]) == ("milking", 1, 2)
    quantities = {one["name"]: one for one in found["quantities"]}
    assert quantities["liner_closing_s"]["value"] == found["summary"]["wall_c_s"]
    assert quantities["phase_b_share"]["verdict"] == "met"
    assert quantities["teat_load_n"]["value"] is None
    assert quantities["teat_load_n"]["reason"]
    assert found["lacks"] == [
        "material.first_end_mm, material.last_end_mm: without them no pressure",
        "flow_stop: without it no overpressure by the map",
    ]
    assert found["taken"] == {}
    assert "2 fields are missing and were not filled in: 2 after field 19" in found["problems"][0]
    assert {Path(path).name for path in found["files"]} == written(out)


def test_the_report_says_where_each_input_comes_from(analysed: tuple[Result, Path]) -> None:
    report = json.loads((analysed[1] / "report.json").read_text())
    sources = report["inputs"]["sources"]
    assert sources["material"].endswith("inputs.yaml")
    assert sources["vacuum.log"].endswith("log.csv")
    assert report["about"]["ledger"]["lacking"][0]["count"] == 2


def test_all_that_can_say_so_says_how_pressures_are_found(analysed: tuple[Result, Path]) -> None:
    h5py, pq = pytest.importorskip("h5py"), pytest.importorskip("pyarrow.parquet")
    result, out = analysed
    assert json.loads(result.stdout)["pressure_method"] == "equilibrium"
    assert json.loads((out / "report.json").read_text())["pressure_method"] == "equilibrium"
    assert b"pressure_method equilibrium" in (out / "ply" / "phase-0.2500.ply").read_bytes()
    told = pq.read_schema(out / "targets.parquet").metadata[b"grabberd"]
    assert json.loads(told)["pressure_method"] == "equilibrium"
    with h5py.File(out / "analysis.h5") as file:
        assert json.loads(file.attrs["grabberd"])["pressure_method"] == "equilibrium"


def test_missing_fields_have_no_rows(analysed: tuple[Result, Path]) -> None:
    numbers = [int(row["n"]) for row in rows(analysed[1] / "fields.csv")]
    assert numbers == [n for n in range(52) if n not in {20, 21}]


@pytest.mark.usefixtures("undrawn")
def test_without_inputs_there_is_the_shape_and_what_lacks_is_said(resting: Path, tmp_path: Path) -> None:
    words = said(run(resting, "--out", tmp_path / "out"))
    assert "3 of 3 fields analysed" in words
    assert re.search(r"area_mm2, range over the fields │ [\d.]+ … [\d.]+ │ 0\.\d\d ", words)
    for lacking in ("reference", "material", "vacuum.pulsation", "flow_stop"):
        assert f"missing: {lacking}: without it" in words
    assert words.count("only 3 fields: too few for a movement") == 1
    assert written(tmp_path / "out") == CSV | {"report.json"}


@pytest.mark.usefixtures("undrawn")
def test_bursts_are_put_together_by_phase(tmp_path: Path) -> None:
    first = milking(tmp_path, [field(n) for n in range(40)], "one")
    second = milking(tmp_path, [field(n + 500, time_s=(n + 13) * 0.02) for n in range(40)], "two")
    inputs = inputs_file(tmp_path, {"phases": 2})
    more = ("--inputs", inputs, "--formats", "", "--json")
    alone = run(first, *more, "--out", tmp_path / "alone")
    both = run(first, "--bursts", second, *more, "--out", tmp_path / "both")
    one, two = (json.loads(result.stdout) for result in (alone, both))
    assert (one["bursts"], two["bursts"]) == ([], ["two"])
    assert two["summary"]["cycles"] > 1.5 * one["summary"]["cycles"]
    assert two["summary"]["analysed"] == 40


@pytest.mark.usefixtures("undrawn")
def test_without_the_optional_part_the_report_is_numbers_alone_and_it_is_said(
    resting: Path, tmp_path: Path
) -> None:
    result = run(resting, "--formats", "", "--json", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "pip install 'grabberd[report]'" in result.stderr
    assert written(tmp_path / "out") == {"report.json"}
    assert json.loads(result.stdout)["files"] == [str(tmp_path / "out" / "report.json")]


def test_a_run_that_there_is_not_is_refused(resting: Path, tmp_path: Path) -> None:
    assert "its runs are: 1" in refusal(NotFound, resting, "--run", 2, "--out", tmp_path / "out").hint


def test_an_unknown_format_is_refused_before_any_work(resting: Path, tmp_path: Path) -> None:
    error = refusal(InputError, resting, "--formats", "csv,xlsx", "--out", tmp_path / "out")
    assert "xlsx" in error.message
    assert "hdf5" in error.hint
    assert not (tmp_path / "out").exists()


def test_a_format_that_is_not_installed_is_refused_before_any_work(
    resting: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    error = refusal(ExtraMissing, resting, "--formats", "hdf5", "--out", tmp_path / "out")
    assert error.hint == "install it: pip install 'grabberd[hdf5]'"
    assert not (tmp_path / "out").exists()


def test_a_table_that_a_format_has_no_room_for_costs_no_other_result(
    resting: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grabberd.archive.export.mat_file.MOST_BYTES", 1_000)
    error = refusal(InputError, resting, "--formats", "mat,csv", "--out", tmp_path / "out")
    assert "of a MAT-file" in error.message
    assert written(tmp_path / "out") >= CSV | {"report.json"}


def test_a_folder_with_something_in_it_is_left_as_it_is(resting: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert "not empty" in refusal(StorageError, resting, "--out", tmp_path).message
    assert written(tmp_path) == {"mine.txt"}


def test_an_analysis_that_fails_leaves_no_folder_and_takes_none_away(resting: Path, tmp_path: Path) -> None:
    inputs = inputs_file(tmp_path, {"reference": {"field": 999_999}})
    out, empty = tmp_path / "out", tmp_path / "empty"
    empty.mkdir()
    for folder in (out, empty):
        refusal(GrabberdError, resting, "--inputs", inputs, "--out", folder)
    assert not out.exists()
    assert empty.is_dir()
