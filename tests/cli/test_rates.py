"""A progressive camera at any rate, from a folder of pictures to exported points; OpenCV draws them."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from core.chain.sized_pictures import Picture
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.catalogue.capture_documents import describe
from grabberd.cli.app import app
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents.captures import CaptureDocument
from grabberd.files.reading import read_yaml

CAMERA = Picture(640, 480, 0.0160)
SECONDS, STROKE_MM, SWINGS_HZ = 0.5, 2.5, 2.0
CONFIG = """
devices:
  folder:
    driver: replay
    options: {{path: {pictures}, pictures: progressive, rate_hz: {rate_hz}, pace: free}}
    rig:
      columns: 640
      lines: 480
      views:
        left: {{first_column: 0, end_column: 320}}
        right: {{first_column: 320, end_column: 640}}
      pixel_x_mm: 0.0160
      pixel_y_mm: 0.0160
"""


def run(*words: object) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words])
    if result.exception:
        raise result.exception
    return result.output


def swing_mm(time_s: np.ndarray) -> np.ndarray:
    """How far the object has moved along X at a time."""
    return STROKE_MM * np.sin(2 * np.pi * SWINGS_HZ * time_s)


def draw(folder: Path, places_mm: np.ndarray, moved_mm: np.ndarray) -> Path:
    """A picture for each displacement along X."""
    folder.mkdir()
    rng = np.random.default_rng(3)
    for number, along in enumerate(moved_mm):
        shown = CAMERA.draw(places_mm + np.array([along, 0, 0]), 1.5)
        grey = np.clip(np.rint(shown + rng.normal(0, 3, shown.shape)), 0, 255).astype(np.uint8)
        cv2.imwrite(str(folder / f"{number:03}.png"), grey)
    return folder


def captured(folder: Path, name: str, pictures: Path, rate_hz: float, bits: int) -> Path:
    config, out = folder / f"{name}.yaml", folder / f"{name}.grab"
    text = CONFIG.format(pictures=pictures, rate_hz=rate_hz)
    if (pictures / "fields.csv").exists():
        text = text.replace("pictures: progressive, ", "")
    config.write_text(text)
    run("capture", "--config", config, "--bits", bits, "--out", out)
    return out


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a calibration frame's file, and the calibration that pictures of it have given."""
    folder = tmp_path_factory.mktemp("rates")
    run(
        "frame",
        "--rows",
        12,
        "--columns",
        9,
        "--pitch-mm",
        6.5,
        "--depth-mm",
        16,
        "--out",
        folder / "stand.yaml",
    )
    places = ObjectModel.from_document(read_yaml(folder / "stand.yaml")).xyz_mm
    still = captured(folder, "still", draw(folder / "still", places, np.zeros(4)), 120, 8)
    run("calibrate", still, "--calibration-frame", folder / "stand.yaml", "--out", folder / "rig.json")
    return folder


@pytest.mark.parametrize(("rate_hz", "bits"), [(25, 8), (60_000 / 1001, 1), (120, 1), (120, 8)])
def test_every_picture_comes_out_as_points_at_its_own_time(rig: Path, rate_hz: float, bits: int) -> None:
    stand, name = rig / "stand.yaml", f"{rate_hz:.0f}-{bits}"
    places = ObjectModel.from_document(read_yaml(stand)).xyz_mm
    time_s = np.arange(round(SECONDS * rate_hz)) / rate_hz
    capture = captured(rig, name, draw(rig / f"pictures-{name}", places, swing_mm(time_s)), rate_hz, bits)
    assert_complete(describe(capture), time_s, rate_hz)
    run("measure", capture, "--calibration", rig / "rig.json", "--object", stand)
    run("export", capture, "--format", "csv", "--out", rig / f"exported-{name}")
    (file,) = (rig / f"exported-{name}").glob("*points*.csv")
    with file.open() as opened:
        rows = [
            (int(one["n"]), float(one["time_s"]), int(one["target"]), float(one["x_mm"]))
            for one in csv.DictReader(opened)
        ]
    n, at_s, target, x_mm = (np.array(one) for one in zip(*rows, strict=True))
    assert np.array_equal(np.unique(n), np.arange(len(time_s)))
    assert len(rows) > 0.98 * len(places) * len(time_s)
    assert np.abs(at_s - n / rate_hz).max() < 1e-6
    # When the object was where the points are, by the movement that was drawn: no clock is in it.
    moved_mm = x_mm - places[target - 1, 0]
    speed_mm_s = 2 * np.pi * SWINGS_HZ * STROKE_MM * np.cos(2 * np.pi * SWINGS_HZ * at_s)
    late_s = ((moved_mm - swing_mm(at_s)) @ speed_mm_s) / (speed_mm_s @ speed_mm_s)
    assert abs(late_s) < 0.05 / rate_hz
    assert np.sqrt(np.mean((moved_mm - swing_mm(at_s)) ** 2)) < 0.1


def assert_complete(document: CaptureDocument, time_s: np.ndarray, rate_hz: float) -> None:
    assert (document.verdict, document.fields) == ("complete", len(time_s))
    assert (document.rate_hz, document.lines, document.field_order) == (pytest.approx(rate_hz), None, None)


def test_the_ledger_tells_a_lost_picture_with_its_time(rig: Path) -> None:
    """At 100 pictures a second by their own times, of which two are missing."""
    pictures = rig / "with-a-gap"
    draw(pictures, np.zeros((1, 3)), np.zeros(18))
    kept = [n for n in range(20) if n not in (12, 13)]
    rows = [f"{n},{n * 10_000_000},{n},2,0,1,received,{i:03}.png" for i, n in enumerate(kept)]
    (pictures / "fields.csv").write_text(
        "\n".join(["n,time_ns,sequence,parity,y0,y_step,outcome,file", *rows])
    )
    capture = captured(rig, "gap", pictures, 100, 1)
    document = describe(capture)
    assert document.ledger.in_words == "2 fields lost at 0.12 s (time gap)"
    with CaptureReader(capture) as reader:
        assert reader.first_time_ns is not None
        assert [round((one.numbered.time_ns - reader.first_time_ns) / 1e7) for one in reader.fields()] == kept
