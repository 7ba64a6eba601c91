"""Fields in the wrong sequence of time, as the points show them: said by whatever command measures them."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.config import default_config_file
from grabberd.instrument.acquisition import GRABBERS
from grabberd_fake.__main__ import calibration_document, object_document
from grabberd_fake.options import FakeOptions

LINER = {"pace": "free", "picture": {"stamp": False}}
FIELDS = 250


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Woven frames of a pulsating liner, top field older, and what belongs to them."""
    made = tmp_path_factory.mktemp("reversed")
    frames = made / "frames"
    frames.mkdir()
    grabber, fields = GRABBERS.create("fake", LINER), []
    grabber.open()
    while len(fields) < FIELDS:
        with grabber.dequeue(1.0) as grabbed:
            fields += [one.field.luma.copy() for one in grabbed]
    grabber.close()
    for number in range(0, FIELDS, 2):
        frame = np.empty((576, 720), np.uint8)
        frame[0::2], frame[1::2] = fields[number : number + 2]
        cv2.imwrite(str(frames / f"{number:04}.png"), frame, [cv2.IMWRITE_PNG_COMPRESSION, 0])
    options = FakeOptions.read(LINER)
    (made / "rig.json").write_text(json.dumps(calibration_document(options)))
    (made / "liner.yaml").write_text(object_document(options))
    return made


def capture(folder: Path, older: str) -> tuple[Path, Result]:
    """Plays the frames, one field of each taken for the older, into a capture of its own."""
    config = yaml.safe_load(default_config_file().read_text())
    options = {"path": str(folder / "frames"), "field_order": f"{older}_first", "pace": "free"}
    made_with = {"calibration": str(folder / "rig.json"), "object": str(folder / "liner.yaml")}
    config["devices"]["simulated"] |= {"driver": "replay", "options": options, **made_with}
    (folder / f"{older}.yaml").write_text(yaml.safe_dump(config))
    out = folder / f"{older}.grab"
    return out, run("capture", "--config", folder / f"{older}.yaml", "--fields", FIELDS, "--out", out)


def run(*words: object) -> Result:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == 0, result.output
    return result


def test_a_capture_with_reversed_fields_is_told_and_so_is_measuring_it_again(folder: Path) -> None:
    out, captured = capture(folder, "bottom")
    assert f"note: {out}: the two fields of each frame change places" in captured.stderr
    again = run(
        "measure", out, "--calibration", folder / "rig.json", "--object", folder / "liner.yaml", "--json"
    )
    assert "change places" in again.stderr
    document = json.loads(again.stdout)
    assert document["field_order"]["order"] == "reversed"
    assert "--check-field-order" in document["warnings"][0]
    how = ("--calibration", folder / "rig.json", "--object", folder / "liner.yaml", "--workers", 1)
    points = run("reprocess", out, *how, "--out", folder / "points", "--json")
    assert "change places" in json.loads(points.stdout)["warned"][0]["reason"]


def test_of_a_capture_whose_fields_are_in_sequence_nothing_is_said(folder: Path) -> None:
    _, captured = capture(folder, "top")
    assert "change places" not in captured.output
