"""`grabberd measure --propose-object`: an object file that has the targets where a capture shows them."""

import json
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.config import default_config_file
from grabberd.core.reconstruction import ObjectModel

CONFIGS = default_config_file().parent
CALIBRATION, OBJECT = CONFIGS / "fake.calibration.json", CONFIGS / "objects" / "liner.yaml"


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def measure(capture: Path, model: Path, *words: object) -> Result:
    return run("measure", capture, "--calibration", CALIBRATION, "--object", model, *words)


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("proposal")
    out = folder / "liner.grab"
    config = yaml.safe_load(default_config_file().read_text())
    options = {**config["devices"]["simulated"]["options"], "pace": "free"}
    files = {"options": options, "calibration": str(CALIBRATION), "object": str(OBJECT)}
    config["devices"]["simulated"] |= files
    (folder / "free.yaml").write_text(yaml.safe_dump(config))
    assert run("capture", "--config", folder / "free.yaml", "--fields", 100, "--out", out).exit_code == 0
    return out


@pytest.fixture
def wrong(tmp_path: Path) -> Path:
    """An object file with target 57 a millimetre off."""
    document = yaml.safe_load(OBJECT.read_text())
    next(one for one in document["targets"] if one["id"] == 57)["z_mm"] += 1.0
    path = tmp_path / "wrong.yaml"
    path.write_text(yaml.safe_dump(document))
    return path


def test_a_file_with_the_target_where_it_is_seen_is_written_and_said_so(
    capture: Path, wrong: Path, tmp_path: Path
) -> None:
    out = tmp_path / "seen.yaml"
    said = measure(capture, wrong, "--propose-object", out, "--json")
    (moved,) = json.loads(said.stdout)["proposal"]["moved"]
    assert moved["id"] == 57
    assert moved["offset_mm"][2] == pytest.approx(-1.0, abs=0.2)
    seen, right = (ObjectModel.from_document(yaml.safe_load(one.read_text())) for one in (out, OBJECT))
    assert abs(seen.xyz_mm - right.xyz_mm).max() < 0.2
    assert seen.own_sigma_mm is not None
    assert "# moved by" in out.read_text()
    assert capture.stem in out.read_text()


def test_where_all_is_in_place_nothing_is_written(capture: Path, tmp_path: Path) -> None:
    out = tmp_path / "seen.yaml"
    said = measure(capture, OBJECT, "--propose-object", out)
    assert "no target is significantly off" in said.stdout
    assert not out.exists()


def test_a_file_that_exists_is_never_replaced(capture: Path, wrong: Path) -> None:
    before = wrong.read_text()
    said = measure(capture, wrong, "--propose-object", wrong)
    assert said.exit_code != 0
    assert "exists already" in str(said.exception)
    assert wrong.read_text() == before


def test_without_the_option_nothing_is_proposed(capture: Path) -> None:
    assert "proposal" not in json.loads(measure(capture, OBJECT, "--json").stdout)
