"""From the simulator to the agreement of both methods: capture, truth of a mat, analysis, table, report."""

import csv
import json
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from cli.analyse.analysing import inputs_file, refusal, rows, run, said
from core.chain.milking import MATERIAL
from grabberd.cli.app import app
from grabberd.config import shipped_configs
from grabberd.errors import InputError
from grabberd_fake.__main__ import main

pytestmark = pytest.mark.timeout(600)

FIELDS = 8
END_MM, TURNED_DEG = 15.0, 8.0
"""Of the teat's end in the object's frame; how far the mat lies turned."""
MOSTLY_CLOSED = {"rising": 0.03, "open": 0.01, "falling": 0.03}
"""Wherever in the cycle a capture begins, most of its fields show the closed liner."""
CLOSED_VACUUM = {"pulsation": {"kpa": 0.0, "sigma_kpa": 0.2}, "liner": {"kpa": 42.0, "sigma_kpa": 0.2}}
INPUTS = {
    "reference": "nominal",
    "material": MATERIAL
    | {"E_sigma_mpa": 0.1, "wall_sigma_mm": 0.05, "F0_sigma_n": 3.0}
    | {"first_end_mm": -65.0, "last_end_mm": 65.0},
    "vacuum": CLOSED_VACUUM,
    "sought_kpa": 1.0,
}


@pytest.fixture(scope="module")
def liner(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of the simulated liner."""
    folder = tmp_path_factory.mktemp("captured")
    config, shipped = yaml.safe_load((shipped_configs() / "fake.yaml").read_text()), shipped_configs()
    device = config["devices"]["simulated"]
    device["options"]["liner"] = {"vacuum": MOSTLY_CLOSED}
    device |= {name: str(shipped / device[name]) for name in ("calibration", "object")}
    file, path = folder / "fake.yaml", folder / "liner.grab"
    file.write_text(yaml.safe_dump({"devices": {"simulated": device}}))
    words = ["capture", "--config", file, "--fields", FIELDS, "--bits", 8, "--out", path]
    made = CliRunner().invoke(app, [str(word) for word in words])
    assert made.exit_code == 0, made.output
    return path


def truth(capture: Path, capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert main(["truth", str(capture), *(str(word) for word in words)]) == 0
    return capsys.readouterr().out


@pytest.fixture
def closed(liner: Path, capsys: pytest.CaptureFixture[str]) -> int:
    """The first field in which the liner is closed as far as it goes."""
    table = csv.DictReader(truth(liner, capsys, "--of", "wall").splitlines())
    return next(int(row["n"]) for row in table if float(row["rest_kpa"]) > 41.9)


@pytest.fixture
def mat(liner: Path, closed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """Readings of a mat on the simulated teat at that field."""
    path = tmp_path / "mat.csv"
    words = ("--of", "mat", "--field", closed, "--noise-kpa", 1, "--turned-deg", TURNED_DEG)
    path.write_text(truth(liner, capsys, *words))
    return path


def test_the_map_of_a_simulated_capture_agrees_with_a_mat_on_the_simulated_teat(
    liner: Path, closed: int, mat: Path, tmp_path: Path
) -> None:
    inputs = inputs_file(tmp_path, {**INPUTS, "agreement": {"state": {"field": closed}}})
    out = tmp_path / "out"
    result = run(liner, "--inputs", inputs, "--compare-with", mat, "--out", out, "--json")
    assert result.exit_code == 0, (result.output, result.exception)
    found = json.loads(result.stdout)["agreement"]
    assert (found["state"], found["above"], found["reason"]) == (f"field {closed}", "liner", "")
    assert abs(found["bias_kpa"]) < 2 * found["sigma_bias_kpa"]
    assert abs(found["origin_x_mm"] - END_MM) < 2.5 * found["sigma_origin_x_mm"]
    assert abs(found["origin_round_deg"] - TURNED_DEG) < 2.5 * found["sigma_origin_round_deg"]
    assert found["chi2"] < 1.5 * found["dof"]
    assert len(rows(out / "agreement_places.csv")) == found["places"] > 20
    report = json.loads((out / "report.json").read_text())
    assert report["inputs"]["sources"]["agreement.table"] == str(mat)
    assert "Agreement with another method" in (out / "report.html").read_text()


def test_a_table_without_what_the_inputs_have_to_say_is_refused(resting: Path, tmp_path: Path) -> None:
    table = tmp_path / "film.csv"
    table.write_text("along_mm,round_deg,pressure_kpa,sigma_kpa\n" + "1,0,20,1\n" * 12)
    error = refusal(InputError, resting, "--compare-with", table, "--out", tmp_path / "out")
    assert "agreement.state: is None, expected greatest" in error.message
    assert "agreement.above" in error.message


def test_a_comparison_without_a_pressure_is_a_problem_and_no_failure(resting: Path, tmp_path: Path) -> None:
    table = tmp_path / "film.csv"
    table.write_text("along_mm,round_deg,pressure_kpa,sigma_kpa,above\n" + "1,0,20,1,liner\n" * 12)
    inputs = inputs_file(tmp_path, {"agreement": {"state": "greatest"}})
    shown = said(run(resting, "--inputs", inputs, "--compare-with", table, "--out", tmp_path / "out"))
    assert "no agreement with the other method: the analysis has no pressure" in shown
