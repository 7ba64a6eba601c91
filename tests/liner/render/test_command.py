"""`grabberd render` as a person types it, on a capture of the simulated liner."""

import json
from pathlib import Path

import cv2
import pytest
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.config import shipped_configs
from grabberd.errors import GrabberdError, InputError, NotFound, NotReady, StorageError

CONFIG = """
devices:
  simulated:
    driver: fake
    options: {{scene: liner, pace: free}}
    calibration: {folder}/fake.calibration.json
    object: {folder}/objects/liner.yaml
"""


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("render")
    config, out = folder / "config.yaml", folder / "liner.grab"
    config.write_text(CONFIG.format(folder=shipped_configs()))
    result = run("capture", "--config", config, "--fields", 6, "--bits", 8, "--out", out)
    assert result.exit_code == 0, result.output
    return out


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def refusal(*words: object) -> GrabberdError:
    error = run("render", *words).exception
    assert isinstance(error, GrabberdError)
    return error


def test_a_model_from_every_side_with_a_name(capture: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = run("render", capture, "--side", "all", "--field", 3, "--size", "480x320", "--out", out)
    assert result.exit_code == 0, result.output
    assert names(out) == [f"model-3-{side}.png" for side in ("front", "oblique", "side", "top")]
    assert cv2.imread(str(out / "model-3-top.png")).shape == (320, 480, 3)


def test_the_fit_of_the_views_is_said_with_its_sigma(capture: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = run("render", capture, "--what", "overlay", "--field", 2, "--json", "--out", out)
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["field"] == 2
    for view in ("left", "right"):
        assert abs(found["fit"][view]["shift_x_px"]) < 0.15
        assert 0 < found["fit"][view]["sigma_x_px"] < 0.05
    assert names(out) == ["difference-2.png", "overlay-2.png"]
    words = run("render", capture, "--what", "synthetic", "--out", tmp_path / "other").output
    assert "left view: the model must be shifted by x" in words


def test_a_synthetic_view_from_anywhere_is_transparent_where_there_is_nothing(
    capture: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    free = ("--azimuth-deg", -60, "--elevation-deg", 35, "--size", "320x200")
    result = run("render", capture, "--what", "synthetic", *free, "--out", out)
    assert result.exit_code == 0, result.output
    picture = cv2.imread(str(out / "synthetic-0-free.png"), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (200, 320, 4)
    assert set(picture[:, :, 3].ravel()) == {0, 255}


@pytest.mark.parametrize("of", ["model", "overlay"])
@pytest.mark.parametrize("format", ["webm", "gif"])
def test_an_animation_has_a_picture_for_every_field(
    capture: Path, tmp_path: Path, of: str, format: str
) -> None:
    out = tmp_path / "out"
    words = ("--of", of, "--format", format, "--every", 2, "--size", "320x200", "--json")
    result = run("render", capture, "--what", "animation", *words, "--out", out)
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert (found["pictures"], found["per_s"]) == (3, 5.0)
    assert names(out) == [f"{of}.{format}"]


def test_what_cannot_be_is_refused_with_a_hint(capture: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert isinstance(refusal(capture, "--field", 99, "--out", out), NotFound)
    assert isinstance(refusal(capture, "--run", 7, "--out", out), NotFound)
    fast = refusal(capture, "--what", "animation", "--speed", 4, "--format", "gif", "--out", out)
    assert isinstance(fast, InputError)
    assert "--every 4" in fast.hint
    late = refusal(capture, "--what", "animation", "--from", 50, "--to", 60, "--out", out)
    assert isinstance(late, NotFound)
    assert not out.exists()
    (tmp_path / "mine").write_text("mine")
    assert isinstance(refusal(capture, "--out", tmp_path), StorageError)
    assert run("render", capture, "--size", "7x7", "--out", out).exit_code == 2
    assert run("render", capture, "--azimuth-deg", "5", "--out", out).exit_code == 2


def test_a_capture_without_points_says_what_to_do(tmp_path: Path) -> None:
    config, capture = tmp_path / "config.yaml", tmp_path / "bare.grab"
    config.write_text("devices: {simulated: {driver: fake, options: {scene: liner, pace: free}}}\n")
    assert run("capture", "--config", config, "--fields", 2, "--out", capture).exit_code == 0
    error = refusal(capture, "--out", tmp_path / "out")
    assert isinstance(error, NotReady | NotFound)
    assert "measure" in error.hint
