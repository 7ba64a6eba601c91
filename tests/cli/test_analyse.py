"""`grabberd analyse` as a person types it: what it writes, says and refuses."""

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.config import shipped_configs
from grabberd.errors import (
    AnalysisError,
    CaptureFileError,
    ExtraMissing,
    GrabberdError,
    InputError,
    NotFound,
    NotReady,
    StorageError,
)
from grabberd.processes.analysis.columns import TABLES
from processes.milking import CONSTANT, MATERIAL, PERIOD_S, changed, field, grid, log, still
from storage.milkings import milking, object_document

pytestmark = pytest.mark.timeout(600)
LOGGED = {"pulsation": "log", "liner": "log", "offset": {"s": -0.3, "sigma_s": 0.001}}
INPUTS: dict[str, Any] = {
    "reference": "nominal",
    "material": MATERIAL,
    "vacuum": CONSTANT,
    "plane": "symmetry",
    "heights_mm": [-10, 0, 10],
    "phases": 4,
    "sought_kpa": 20.0,
}
CSV = {f"{name}.csv" for name in TABLES}


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["analyse", *(str(word) for word in words)])


def refusal(kind: type[GrabberdError], *words: object) -> GrabberdError:
    error = run(*words).exception
    assert isinstance(error, kind), error
    assert error.hint
    return error


def said(result: Result) -> str:
    """All of it, without the line ends that the width of the terminal makes."""
    assert result.exit_code == 0, (result.output, result.exception)
    return " ".join(result.output.split())


def written(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def inputs_file(folder: Path, document: object) -> Path:
    path = folder / "inputs.yaml"
    path.write_text(yaml.safe_dump(document))
    return path


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if matplotlib were not installed."""
    monkeypatch.setattr("grabberd.reports.figures.drawing.find_spec", lambda name: None)


@pytest.fixture(scope="module")
def resting(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of three fields of the open liner."""
    return milking(tmp_path_factory.mktemp("resting"), still(3), note="first milking")


@pytest.fixture(scope="module")
def pulsating(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of more than a cycle, with two fields missing."""
    fields = [field(n) for n in range(52) if n not in {20, 21}]
    return milking(tmp_path_factory.mktemp("pulsating"), fields)


@pytest.fixture(scope="module")
def analysed(pulsating: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    """With everything."""
    folder = tmp_path_factory.mktemp("analysed")
    vacuum_log = folder / "log.csv"
    vacuum_log.write_text("\ufeff" + log(1.6, start_s=-0.3))
    inputs = inputs_file(folder, {**INPUTS, "vacuum": LOGGED, "free_rows": [0, 6], "sought_kpa": 1.0})
    more = ("--vacuum-log", vacuum_log, "--formats", "csv, hdf5,parquet,ply,vtu", "--json")
    return run(pulsating, "--inputs", inputs, *more, "--out", folder / "out"), folder / "out"


def test_all_formats_and_the_report_are_written(analysed: tuple[Result, Path]) -> None:
    result, out = analysed
    assert result.exit_code == 0, result.output
    others = {"analysis.h5", "ply", "vtu", "report.json", "report.html"}
    assert written(out) == CSV | {f"{name}.parquet" for name in TABLES} | others
    assert written(out / "ply") > {"field-00000000.ply", "phase-0.2500.ply"}
    assert (out / "report.html").read_text().startswith("<!DOCTYPE html>")


def test_scripts_are_told_what_was_found_what_lacks_and_where_it_is(analysed: tuple[Result, Path]) -> None:
    result, out = analysed
    found = json.loads(result.stdout)
    assert abs(found["summary"]["period_s"] - PERIOD_S) < 4 * found["summary"]["sigma_period_s"]
    assert (found["id"], found["run"], found["summary"]["missing"]) == ("milking", 1, 2)
    assert found["lacks"] == []
    assert "2 fields are missing and were not filled in: 2 after field 19" in found["problems"][0]
    assert {Path(path).name for path in found["files"]} == written(out)


def test_the_report_says_where_each_input_comes_from(analysed: tuple[Result, Path]) -> None:
    report = json.loads((analysed[1] / "report.json").read_text())
    sources = report["inputs"]["sources"]
    assert sources["material"].endswith("inputs.yaml")
    assert sources["vacuum.log"].endswith("log.csv")
    assert report["about"]["ledger"]["lacking"][0]["count"] == 2


def test_missing_fields_have_no_rows(analysed: tuple[Result, Path]) -> None:
    numbers = [int(row["n"]) for row in rows(analysed[1] / "fields.csv")]
    assert numbers == [n for n in range(52) if n not in {20, 21}]


@pytest.mark.usefixtures("undrawn")
def test_without_inputs_there_is_the_shape_and_what_lacks_is_said(resting: Path, tmp_path: Path) -> None:
    words = said(run(resting, "--out", tmp_path / "out"))
    assert "3 of 3 fields analysed" in words
    assert re.search(r"area_mm2, range over the fields │ [\d.]+ … [\d.]+ │ 0\.\d\d ", words)
    for lacking in ("reference", "material", "vacuum.pulsation", "sought_kpa"):
        assert f"not given: {lacking}: without it" in words
    assert words.count("only 3 fields: too few for a movement") == 1
    assert written(tmp_path / "out") == CSV | {"report.json"}


def test_inputs_that_are_shipped_are_read(resting: Path, tmp_path: Path) -> None:
    """Of another liner, so that their heights alone do not suit it; and of a wall that rests."""
    error = refusal(
        InputError,
        resting,
        "--inputs",
        shipped_configs() / "analysis" / "liner.yaml",
        "--out",
        tmp_path / "out",
    )
    assert "a pulsation in the capture" in error.message


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


# --- what is survived and named ---


HOLE = (grid().row >= 2) & (grid().row <= 4) & (grid().column >= 1)
CROSSED, FOLDED, JUMPED, HOLED = 2, 4, 6, 12


def spoiled() -> list[Any]:
    """Fields of the open liner, each bad one bad in its own way; 8 to 10 are missing."""
    fields = {one.n: one for one in still(14)}
    target, places = (getattr(fields[0].timed.points, name) for name in ("target", "xyz_mm"))
    crossed, folded, turned = target.copy(), fields[FOLDED].timed.points.xyz_mm.copy(), grid().row >= 3
    crossed[[11, 22]] = target[[22, 11]]
    folded[turned, 0] = 2 * places[grid().row == 3, 0].mean() - folded[turned, 0]
    fields[CROSSED] = changed(fields[CROSSED], target=crossed)
    fields[FOLDED] = changed(fields[FOLDED], places=folded)
    fields[JUMPED] = changed(fields[JUMPED], target=np.roll(target, 5))
    fields[HOLED] = changed(fields[HOLED], keep=~HOLE)
    return [one for n, one in fields.items() if n not in {8, 9, 10}]


@pytest.fixture(scope="module")
def survived(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], Path]:
    """The problems, and the folder."""
    folder = tmp_path_factory.mktemp("survived")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("grabberd.reports.figures.drawing.find_spec", lambda name: None)
        result = run(milking(folder, spoiled()), "--json", "--out", folder / "out")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)["problems"], folder / "out"


def of_field(problems: list[str], n: int) -> str:
    return " ".join(words for words in problems if f"field {n}" in words.partition(":")[0].split(", "))


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_crossing_targets_are_named(survived: tuple[list[str], Path]) -> None:
    assert "targets 12, 23" in of_field(survived[0], CROSSED)


def test_a_folded_wall_is_named(survived: tuple[list[str], Path]) -> None:
    assert of_field(survived[0], FOLDED)


def test_ids_that_jump_by_a_row_are_named(survived: tuple[list[str], Path]) -> None:
    assert of_field(survived[0], JUMPED)


def test_good_fields_have_no_problem(survived: tuple[list[str], Path]) -> None:
    assert not any(of_field(survived[0], n) for n in (0, 1, 3, 5, 7, 11, 13))


def test_a_hole_stays_empty_in_the_tables(survived: tuple[list[str], Path]) -> None:
    inside = {
        row["n"]: (row["x_mm"], row["kappa1_per_m"])
        for row in rows(survived[1] / "targets.csv")
        if (row["row"], row["column"]) == ("3", "3")
    }
    assert inside[str(HOLED)] == ("", "")
    assert all(inside["11"])


def test_a_gap_in_the_ledger_is_named_and_a_table(survived: tuple[list[str], Path]) -> None:
    assert "3 after field 7" in survived[0][0]
    assert rows(survived[1] / "gaps.csv") == [{"after_n": "7", "until_n": "11", "missing": "3"}]


def test_the_report_has_the_same_problems(survived: tuple[list[str], Path]) -> None:
    assert json.loads((survived[1] / "report.json").read_text())["problems"] == survived[0]


# --- what is refused ---


def refused(
    kind: type[GrabberdError], capture: Path, folder: Path, *more: object, **changes: Any
) -> GrabberdError:
    """Of these changes to the inputs; nothing is left behind."""
    inputs = inputs_file(folder, {**INPUTS, **changes})
    error = refusal(kind, capture, "--inputs", inputs, *more, "--out", folder / "out")
    assert not (folder / "out").exists() or not written(folder / "out")
    return error


def test_a_log_that_does_not_cover_the_capture_is_refused(pulsating: Path, tmp_path: Path) -> None:
    short = tmp_path / "log.csv"
    short.write_text(log(1.2, start_s=-0.3))
    error = refused(InputError, pulsating, tmp_path, "--vacuum-log", short, vacuum=LOGGED)
    assert "the vacuum log covers" in error.message
    assert "have no vacuum" in error.message


@pytest.mark.parametrize(
    ("factor", "unit"), [(10.0, "mbar"), (1000.0, "Pa"), (0.2953, "inHg"), (-1.0, "vacuum")]
)
def test_a_log_in_another_unit_is_refused_by_its_magnitude(
    pulsating: Path, tmp_path: Path, factor: float, unit: str
) -> None:
    head, *rows = log(1.6, start_s=-0.3).splitlines()
    scaled = [
        ",".join([time, *(f"{float(value) * factor:.4f}" for value in values)])
        for time, *values in (row.split(",") for row in rows)
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([head, *scaled]))
    error = refused(InputError, pulsating, tmp_path, "--vacuum-log", path, vacuum=LOGGED)
    assert unit in error.message + error.hint


def test_a_log_that_is_none_is_refused(resting: Path, tmp_path: Path) -> None:
    picture = tmp_path / "log.csv"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n\xff")
    assert "cannot be read" in refused(InputError, resting, tmp_path, "--vacuum-log", picture).message
    nowhere = tmp_path / "nothing.csv"
    assert "cannot be read" in refused(InputError, resting, tmp_path, "--vacuum-log", nowhere).message


def test_a_log_without_a_place_for_it_is_refused(resting: Path, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(log())
    assert (
        "have no vacuum"
        in refusal(InputError, resting, "--vacuum-log", path, "--out", tmp_path / "out").message
    )


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"wall_mm": 0.0}, "wall_mm is 0, expected above 0"),
        ({"E_mpa": -1.0}, "E_mpa is -1"),
        ({"wall_mm": 40.0}, "thicker than a liner"),
        ({"poisson": 0.3}, "keeps the volume"),
        ({"hardness": 50}, "hardness"),
    ],
)
def test_a_wall_that_there_is_not_is_refused(
    resting: Path, tmp_path: Path, wrong: dict[str, float], words: str
) -> None:
    assert words in refused(InputError, resting, tmp_path, material={**MATERIAL, **wrong}).message


def test_a_material_that_lacks_something_names_it(resting: Path, tmp_path: Path) -> None:
    lacking = {key: value for key, value in MATERIAL.items() if key not in {"F0_n", "law"}}
    error = refused(InputError, resting, tmp_path, material=lacking)
    assert "F0_n" in error.message
    assert "law" in error.message


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"colour": "red"}, "colour"),
        ({"reference": "closed"}, "reference"),
        ({"reference": {"phase": 0.4}}, "does not exist"),
        ({"reference": {"field": 7}}, "field 7 has no points"),
        ({"plane": {"point_mm": [0, 0, 0], "normal": [0, 0, 0]}}, "plane.normal"),
        ({"phases": 1}, "phases"),
        ({"sought_kpa": 0}, "sought_kpa"),
        ({"vacuum": {"pulsation": {"kpa": 42}, "liner": {"kpa": 42, "sigma_kpa": 1}}}, "sigma_kpa"),
        ({"vacuum": {"pulsation": "log", "liner": "log"}}, "lack vacuum.log"),
        ({"free_rows": [3, 1]}, "free_rows"),
    ],
)
def test_inputs_that_cannot_be_meant_are_refused_by_name(
    resting: Path, tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    assert words in refused(InputError, resting, tmp_path, **changes).message


@pytest.mark.parametrize("text", ["- one\n- two\n", "reference: [", "nominal"])
def test_inputs_that_are_no_document_are_refused(resting: Path, tmp_path: Path, text: str) -> None:
    path = tmp_path / "inputs.yaml"
    path.write_text(text)
    assert str(path) in refusal(InputError, resting, "--inputs", path, "--out", tmp_path / "out").message


def test_a_capture_without_points_is_refused(tmp_path: Path) -> None:
    nothing = [changed(one, keep=np.zeros(35, bool)) for one in still(3)]
    error = refusal(AnalysisError, milking(tmp_path, nothing), "--out", tmp_path / "out")
    assert "no points" in error.message


def test_a_capture_that_was_measured_without_an_object_model_is_refused(tmp_path: Path) -> None:
    capture = milking(tmp_path, still(3), made_with={"object": None})
    assert "grabberd measure" in refusal(NotReady, capture, "--out", tmp_path / "out").hint


def test_points_of_another_object_are_refused(tmp_path: Path) -> None:
    other = object_document()
    for one in other["targets"]:
        one["id"] += 1000
    capture = milking(tmp_path, still(3), made_with={"object": other})
    error = refusal(AnalysisError, capture, "--out", tmp_path / "out")
    assert "targets that the object model does not" in error.message


def test_bursts_of_another_object_are_refused(resting: Path, tmp_path: Path) -> None:
    other = object_document(name="another liner")
    other["targets"][3]["x_mm"] += 0.5
    burst = milking(tmp_path, still(3), "burst", made_with={"object": other})
    error = refusal(InputError, resting, "--bursts", burst, "--out", tmp_path / "out")
    assert "another object model, another liner, than" in error.message


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


def test_a_folder_with_something_in_it_is_left_as_it_is(resting: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert "not empty" in refusal(StorageError, resting, "--out", tmp_path).message
    assert written(tmp_path) == {"mine.txt"}


def test_a_damaged_capture_is_refused(resting: Path, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.grab"
    damaged.write_bytes(resting.read_bytes()[:3000])
    refusal(CaptureFileError, damaged, "--out", tmp_path / "out")
    damaged.write_bytes(b"no capture at all" * 1000)
    refusal(CaptureFileError, damaged, "--out", tmp_path / "other")
    assert not any((tmp_path / name).exists() and written(tmp_path / name) for name in ("out", "other"))


def test_a_capture_that_is_not_there_is_refused(tmp_path: Path) -> None:
    error = run(tmp_path / "nothing.grab", "--out", tmp_path / "out").exception
    assert isinstance(error, GrabberdError)
    assert error.hint


@pytest.mark.usefixtures("undrawn")
def test_the_capture_is_not_changed(resting: Path, tmp_path: Path) -> None:
    before = resting.read_bytes()
    said(run(resting, "--formats", "", "--out", tmp_path / "out"))
    assert resting.read_bytes() == before
