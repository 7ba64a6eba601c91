"""A calibration frame's file from its dimensions, as a person types it."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner, Result

from grabberd.archive.calibrations.calibration_catalog import calibration_frame_model
from grabberd.cli.app import app
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import GrabberdError, InputError, StorageError
from grabberd.files.reading import read_yaml

SIZE = ("--rows", 12, "--columns", 9, "--pitch-mm", 6.5)


def run(*words: object) -> Result:
    result = CliRunner().invoke(app, ["frame", *map(str, words)])
    if isinstance(result.exception, GrabberdError):
        raise result.exception
    return result


def made(folder: Path, *words: object) -> tuple[Result, ObjectModel]:
    out = folder / "stand.yaml"
    result = run(*SIZE, *words, "--out", out)
    assert result.exit_code == 0, result.output
    return result, calibration_frame_model(read_yaml(out))


def test_the_file_is_one_of_a_calibration_frame(tmp_path: Path) -> None:
    result, model = made(tmp_path, "--depth-mm", 16, "--sigma-mm", 0.02)
    assert (model.name, len(model), model.target_diameter_mm, model.sigma_mm) == ("stand", 108, 1.5, 0.02)
    assert np.ptp(model.xyz_mm, axis=0).tolist() == [71.5, 52.0, 16.0]
    for said in (
        "calibration frame stand",
        "108 targets",
        "12 rows",
        "9 columns",
        "71.5 x 52.0 mm",
        "16.0 mm",
    ):
        assert said in result.stdout
    assert not result.stderr


def test_the_file_explains_itself(tmp_path: Path) -> None:
    made(tmp_path, "--depth-mm", 16)
    text = (tmp_path / "stand.yaml").read_text()
    comments = [line for line in text.splitlines() if "#" in line]
    for key in ("target_diameter_mm", "sigma_mm", "certificate", "check_length", "z_mm"):
        assert any(key in line for line in comments), key
    # What a certificate adds is there as a comment: without its mark it is read.
    again = text.replace("# certificate:", "certificate:").replace("# temperature_C:", "temperature_C:")
    again = again.replace("# check_length:", "check_length:")
    assert {"certificate", "temperature_C", "check_length"} <= set(yaml.safe_load(again))
    assert len(calibration_frame_model(yaml.safe_load(again))) == 108


def test_a_plane_is_written_and_its_refusal_foretold(tmp_path: Path) -> None:
    result, model = made(tmp_path)
    assert np.ptp(model.xyz_mm[:, 2]) == 0
    assert "lie in a plane" in result.stderr
    assert "--depth-mm" in result.stderr
    assert "lie in a plane" in (tmp_path / "stand.yaml").read_text()


def test_a_plane_is_nothing_to_remark_of_an_object(tmp_path: Path) -> None:
    result, model = made(tmp_path, "--object")
    assert not result.stderr
    assert result.stdout.startswith(f"{tmp_path / 'stand.yaml'}: object stand")
    assert model.sigma_mm == 0.3
    assert "certificate" not in (tmp_path / "stand.yaml").read_text()


def test_rows_may_stand_further_apart_and_share_a_depth(tmp_path: Path) -> None:
    _, model = made(
        tmp_path, "--row-pitch-mm", 9.75, "--depth-mm", 12, "--depth-steps", 4, "--depth-along", "rows"
    )
    assert np.ptp(model.xyz_mm[:, 0]) == 107.25
    assert len(np.unique(model.xyz_mm[model.row == 3, 2])) == 1


def test_scripts_get_numbers(tmp_path: Path) -> None:
    result, _ = made(tmp_path, "--depth-mm", 16, "--json")
    assert json.loads(result.stdout) == {
        "file": str(tmp_path / "stand.yaml"),
        "name": "stand",
        "targets": 108,
        "rows": 12,
        "columns": 9,
        "target_diameter_mm": 1.5,
        "extent_mm": [71.5, 52.0],
        "depth_mm": 16.0,
        "remarks": [],
    }


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    made(tmp_path, "--depth-mm", 16)
    with pytest.raises(StorageError, match="exists already"):
        run(*SIZE, "--out", tmp_path / "stand.yaml")


def test_what_cannot_be_built_is_refused_and_not_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="overlap"):
        run(*SIZE, "--diameter-mm", 7, "--out", tmp_path / "stand.yaml")
    assert not (tmp_path / "stand.yaml").exists()


@pytest.mark.parametrize("name", ["yes", "12", "a: b", "ä", "#1"])
def test_any_name_is_kept(tmp_path: Path, name: str) -> None:
    _, model = made(tmp_path, "--depth-mm", 16, "--name", name)
    assert model.name == name
