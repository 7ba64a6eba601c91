"""Large and small pictures, from a folder to points, with a calibration frame that the program wrote."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from core.chain.sized_pictures import Picture
from grabberd.archive.capture.reader import CaptureReader
from grabberd.cli.app import app
from grabberd.core.field import PROGRESSIVE
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents.document import JobProblem
from grabberd.files.reading import read_yaml
from grabberd.library.jobs.calibration_frame import identify_file

CAMERAS = {"1920x1080": Picture(1920, 1080, 0.0031), "640x480": Picture(640, 480, 0.0160)}
"""Targets of 1.5 mm are 15.6 and 3 pixels wide."""
CONFIG = """
devices:
  folder:
    driver: replay
    options: {{path: {pictures}, pictures: frames}}
    rig:
      columns: {columns}
      lines: {lines}
      views:
        left: {{first_column: 0, end_column: {half}}}
        right: {{first_column: {half}, end_column: {columns}}}
      pixel_x_mm: {pixel_mm}
      pixel_y_mm: {pixel_mm}
    ring: {{bits: 1, lines: doubled}}
    targets: {targets}
"""


def run(*words: object) -> None:
    result = CliRunner().invoke(app, [str(word) for word in words])
    if result.exception:
        raise result.exception


@pytest.fixture(scope="module", params=CAMERAS)
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pictures of a calibration frame, and its file."""
    made, camera = tmp_path_factory.mktemp("sizes"), CAMERAS[request.param]
    stand = made / "stand.yaml"
    run("frame", "--rows", 12, "--columns", 9, "--pitch-mm", 6.5, "--depth-mm", 16, "--out", stand)
    rng = np.random.default_rng(5)
    shown = camera.draw(ObjectModel.from_document(read_yaml(stand)).xyz_mm, 1.5)
    (made / "pictures").mkdir()
    half = camera.columns // 2
    (made / "rig.yaml").write_text(
        CONFIG.format(**camera._asdict(), half=half, pictures=made / "pictures", targets="{targets}")
    )
    for number in range(6):
        grey = np.clip(np.rint(shown + rng.normal(0, 3, shown.shape)), 0, 255).astype(np.uint8)
        cv2.imwrite(str(made / "pictures" / f"{number}.png"), grey)
    return made


def captured(folder: Path, name: str, targets: str) -> Path:
    config, out = folder / f"{name}.config.yaml", folder / f"{name}.grab"
    config.write_text((folder / "rig.yaml").read_text().replace("{targets}", targets))
    run("capture", "--config", config, "--out", out)
    return out


def identified(folder: Path, capture: Path) -> tuple[list[int], JobProblem | None]:
    found = identify_file(lambda _: None, capture, read_yaml(folder / "stand.yaml"))
    return [len(view.found) for view in found.views.values()], found.problem


def test_it_is_identified_calibrated_and_measured(folder: Path) -> None:
    capture = captured(folder, "usual", "{}")
    assert identified(folder, capture) == ([108, 108], None)
    calibration, stand = folder / "rig.json", folder / "stand.yaml"
    run("calibrate", capture, "--calibration-frame", stand, "--out", calibration)
    run("measure", capture, "--calibration", calibration, "--object", stand)
    with CaptureReader(capture) as reader:
        assert {len(points) for _, _, points in reader.timed_points()} == {108}


def test_progressive_pictures_go_the_same_way_with_all_their_lines(folder: Path) -> None:
    config, capture, calibration = (folder / f"whole.{end}" for end in ("yaml", "grab", "json"))
    frames = (folder / "rig.yaml").read_text().replace("{targets}", "{}")
    whole = frames.replace("pictures: frames", "pictures: progressive, rate_hz: 60")
    config.write_text(whole.replace(", lines: doubled", ""))
    run("capture", "--config", config, "--out", capture)
    stand = folder / "stand.yaml"
    run("calibrate", capture, "--calibration-frame", stand, "--out", calibration)
    run("measure", capture, "--calibration", calibration, "--object", stand)
    with CaptureReader(capture) as reader:
        assert (reader.meta.rate_hz, reader.meta.lines) == (60.0, "field")
        assert {one.numbered.packed.parity for one in reader.fields()} == {PROGRESSIVE}
        places = ObjectModel.from_document(read_yaml(stand)).xyz_mm
        errors = np.concatenate([points.xyz_mm - places for _, _, points in reader.timed_points()])
    assert len(errors) == 6 * 108
    rig = read_yaml(config)["devices"]["folder"]["rig"]
    pixel_on_object_mm = rig["pixel_x_mm"] * 240.0 / 8.0
    assert np.sqrt((errors**2).sum(axis=1).mean()) < 0.35 * pixel_on_object_mm


def test_limits_of_the_configuration_hold(folder: Path) -> None:
    counts, problem = identified(folder, captured(folder, "small", "{most_mm: 1.0}"))
    assert counts == [0, 0]
    assert "108 blobs" in problem.message
    assert "to 1.00 mm on the object" in problem.message
