"""`grabberd accuracy` as a person types it, on a capture of the simulated accuracy object."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from grabberd.archive.capture.reader import CaptureReader
from grabberd.cli.app import app
from grabberd.config import shipped_configs
from grabberd.errors import InputError, NotReady
from grabberd_fake import FakeOptions, truth_at

CALIBRATION = shipped_configs() / "fake.calibration.json"
CONFIG = """
devices:
  simulated:
    driver: fake
    options: {{scene: accuracy_object, pace: free}}
    object: {object}
"""


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def captured(folder: Path, bits: int) -> Path:
    config, out = folder / "config.yaml", folder / f"object-{bits}.grab"
    config.write_text(CONFIG.format(object=shipped_configs() / "objects" / "accuracy-object.yaml"))
    result = run("capture", "--config", config, "--fields", 8, "--bits", bits, "--out", out)
    assert result.exit_code == 0, result.output
    return out


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("accuracy")


@pytest.fixture(scope="module")
def grey(folder: Path) -> Path:
    return captured(folder, 8)


@pytest.fixture(scope="module")
def binary(folder: Path) -> Path:
    return captured(folder, 1)


@pytest.fixture(scope="module")
def truth(folder: Path) -> Path:
    known = truth_at(FakeOptions.read({"scene": "accuracy_object"}), 0)
    rows = zip(known.ids, *known.xyz_mm.T, strict=True)
    file = folder / "truth.csv"
    file.write_text("target,x_mm,y_mm,z_mm\n" + "".join(f"{i},{x},{y},{z}\n" for i, x, y, z in rows))
    return file


def document(*words: object) -> dict[str, Any]:
    result = run("accuracy", *words, "--json")
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def test_a_capture_without_points_is_measured_with_the_calibration_and_not_changed(
    binary: Path, truth: Path
) -> None:
    before = binary.read_bytes()
    found = document(binary, "--calibration", CALIBRATION, "--truth", truth)
    assert found["matched"] == 8 * 60
    assert found["missing"] == found["wrong"] == found["unknown"] == 0
    assert found["rmse"]["xyz_mm"] < 0.141
    assert binary.read_bytes() == before
    with CaptureReader(binary) as reader:
        assert not reader.runs


def test_table_1_stands_beside_the_papers_with_lengths_and_pointing(binary: Path, truth: Path) -> None:
    result = run("accuracy", binary, "--calibration", CALIBRATION, "--truth", truth)
    assert result.exit_code == 0, result.output
    for words in ("paper, RMSE", "0.1410", "1 bit, smoothed, RMSE", "precision"):
        assert words in result.output
    assert "VDI/VDE 2634-1: 7 lines" in result.output
    assert "within 0.2 mm" in result.output
    assert "from 8 measurements of 60 targets (paper: 0.170, 0.225)" in result.output


def test_the_verdict_follows_the_limit(binary: Path, truth: Path) -> None:
    words = (binary, "--calibration", CALIBRATION, "--truth", truth)
    assert "NOT within 0.001 mm" in run("accuracy", *words, "--limit-mm", 0.001).output
    assert document(*words)["lengths"]["passed"] is True


def test_an_8_bit_capture_is_compared_with_any_number_of_bits(grey: Path, truth: Path) -> None:
    found = document(grey, "--calibration", CALIBRATION, "--truth", truth, "--bits", "1,7,8")
    assert [one["bits"] for one in found["investigations"]] == [1, 7, 8]


def test_a_1_bit_capture_is_not(binary: Path, truth: Path) -> None:
    result = run("accuracy", binary, "--calibration", CALIBRATION, "--truth", truth, "--bits", "4")
    assert isinstance(result.exception, InputError)
    assert "cannot be requantised" in str(result.exception)


@pytest.mark.parametrize("bits", ["0", "9", "one", "1;2"])
def test_bits_that_do_not_exist_are_refused(grey: Path, truth: Path, bits: str) -> None:
    assert run("accuracy", grey, "--truth", truth, "--bits", bits).exit_code == 2


def test_a_rigid_fit_says_what_it_did(grey: Path, truth: Path) -> None:
    words = (grey, "--calibration", CALIBRATION, "--truth", truth, "--fit", "rigid")
    assert "not scaled" in run("accuracy", *words).output
    fitted = document(*words)["fitted"]
    assert abs(fitted["angle_deg"]) < 0.1


def test_without_any_calibration_it_says_which_option_names_one(binary: Path, truth: Path) -> None:
    result = run("accuracy", binary, "--truth", truth, "--bits", "1")
    assert isinstance(result.exception, NotReady)
    assert "--calibration" in result.exception.hint


def test_an_unknown_method_names_those_that_there_are(grey: Path, truth: Path) -> None:
    words = (grey, "--calibration", CALIBRATION, "--truth", truth)
    result = run("accuracy", *words, "--method", "magic")
    assert isinstance(result.exception, InputError)
    assert "centroid" in str(result.exception)
