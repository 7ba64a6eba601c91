"""`grabberd inspect`: from a folder of pictures of unknown origin to a configuration that captures them."""

import json
import shutil
from pathlib import Path

import cv2
import pytest
import yaml
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from processes.drawn_footage import footage

VGA = {"columns": 640, "lines": 480, "split": 300, "diameter_px": 5.0, "pitch_px": 24.0}


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty progressive pictures of 640 x 480 pixels."""
    folder = tmp_path_factory.mktemp("footage")
    for number, picture in enumerate(footage("progressive", 40, **VGA)):
        cv2.imwrite(str(folder / f"picture-{number:04d}.png"), picture)
    return folder


def test_what_it_writes_captures_the_pictures_as_they_are(folder: Path, tmp_path: Path) -> None:
    config = tmp_path / "rig.yaml"
    result = run("inspect", folder, "--rate-hz", 60, "--out", config)
    assert result.exit_code == 0, result.output
    assert "progressive: every line is of the same moment" in result.output
    assert run("check-config", config).exit_code == 0
    device = yaml.safe_load(config.read_text())["devices"]["camera"]
    assert device["options"] == {"path": str(folder), "pictures": "progressive", "rate_hz": 60}
    assert (device["rig"]["columns"], device["rig"]["lines"]) == (640, 480)
    assert device["rig"]["views"]["left"]["end_column"] == pytest.approx(300, abs=12)
    captured = run("capture", "--config", config, "--fields", 30, "--out", tmp_path / "c.grab", "--json")
    assert captured.exit_code == 0, captured.output
    document = json.loads(captured.stdout)
    assert (document["verdict"], document["lines"], document["rate_hz"]) == ("complete", None, 60.0)
    again = json.loads(run("inspect", tmp_path / "c.grab", "--json").stdout)
    assert (again["interlacing"], again["lines"], again["rate_hz"]) == ("progressive", 480, 60.0)
    assert again["problems"] == []


def test_a_rig_of_another_size_is_refused_before_anything_is_captured(folder: Path, tmp_path: Path) -> None:
    config, wrong = tmp_path / "rig.yaml", tmp_path / "wrong.yaml"
    run("inspect", folder, "--rate-hz", 60, "--out", config)
    document = yaml.safe_load(config.read_text())
    del document["devices"]["camera"]["rig"]
    wrong.write_text(yaml.safe_dump(document))
    result = run("capture", "--config", wrong, "--fields", 10, "--out", tmp_path / "c.grab")
    assert result.exit_code != 0
    assert "640x480" in str(result.exception)
    assert "720x576" in str(result.exception)
    assert not (tmp_path / "c.grab").exists()


def test_a_rate_that_nothing_tells_is_asked_for(folder: Path, tmp_path: Path) -> None:
    result = run("inspect", folder, "--out", tmp_path / "rig.yaml")
    assert "give --rate-hz" in result.output
    assert "# rate_hz" in (tmp_path / "rig.yaml").read_text()


def test_what_comes_before_a_damaged_picture_is_looked_at_all_the_same(folder: Path, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged"
    shutil.copytree(folder, damaged)
    (damaged / "picture-0036.png").write_bytes(b"no picture")
    found = json.loads(run("inspect", damaged, "--json").stdout)
    assert found["interlacing"] == "progressive"
    assert any("picture-0036.png" in problem for problem in found["problems"])


def test_nothing_is_overwritten(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("mine")
    assert run("inspect", folder, "--out", tmp_path / "rig.yaml").exit_code != 0
    assert (tmp_path / "rig.yaml").read_text() == "mine"
