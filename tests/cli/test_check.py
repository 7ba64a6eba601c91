"""`grabberd check` and `grabberd diagnostics` as a person types them."""

import json
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.config import shipped_configs
from grabberd.errors import StorageError

CALIBRATION = shipped_configs() / "fake.calibration.json"
NOWHERE = "http://127.0.0.1:9"


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("check") / "frame.grab"
    config = shipped_configs() / "fake-calibration-frame.yaml"
    result = run("capture", "--config", config, "--fields", 16, "--bits", 8, "--out", out)
    assert result.exit_code == 0, result.output
    return out


def test_a_calibration_that_fits_is_said_with_its_numbers(frame: Path) -> None:
    result = run("check", frame, "--calibration", CALIBRATION)
    assert result.exit_code == 0, result.output
    assert "go on measuring" in " ".join(result.output.split())
    assert "108 of 108" in result.output


def test_one_that_does_not_is_said_to_scripts_too(frame: Path, tmp_path: Path) -> None:
    known = json.loads(CALIBRATION.read_text())
    known["views"]["left"]["y0_px"] += 3
    moved = tmp_path / "moved.json"
    moved.write_text(json.dumps(known))
    result = run("check", frame, "--calibration", moved, "--in-place", "--json")
    assert result.exit_code == 3
    found = json.loads(result.stdout)
    assert found["verdict"] == "recalibrate"
    assert found["shift_px"]["left"]["y"] == pytest.approx(-3, abs=0.2)


def test_diagnostics_without_a_daemon_say_how_the_computer_is(tmp_path: Path) -> None:
    out = tmp_path / "barn.zip"
    result = run("diagnostics", "--out", out, "--url", NOWHERE)
    assert result.exit_code == 0, result.output
    with zipfile.ZipFile(out) as archive:
        assert "versions.json" in archive.namelist()
    again = run("diagnostics", "--out", out, "--url", NOWHERE)
    assert isinstance(again.exception, StorageError)
