"""From a capture of the calibration frame to a calibration, and on to points, as a person types it."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner, Result

from grabberd.archive.capture.reader import CaptureReader
from grabberd.cli.app import app
from grabberd.config import shipped_configs
from grabberd.core.geometry import Calibration, project, rotation_matrix
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import GrabberdError
from grabberd_fake import FakeOptions
from grabberd_fake.__main__ import calibration_document
from grabberd_fake.truth import capture_truth

FRAME = shipped_configs() / "calibration-frames" / "paper-108.yaml"
OBJECT = shipped_configs() / "objects" / "accuracy-object.yaml"
MARKED = {1: (-53.625, -26, -7), 9: (-53.625, 26, 1), 62: (4.875, 19.5, 4.5), 28: (-24.375, -26, -8)}
CONFIG = """
devices:
  simulated:
    driver: fake
    options: {{scene: {scene}, pace: free, rig: {{reflections: {reflections}}}}}
    ring: {{bits: 8}}
"""


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def taken(folder: Path, scene: str, reflections: int = 1, fields: int = 24, name: str = "") -> Path:
    config, out = folder / f"{name or scene}.yaml", folder / f"{name or scene}.grab"
    config.write_text(CONFIG.format(scene=scene, reflections=reflections))
    result = run("capture", "--config", config, "--fields", fields, "--out", out)
    assert result.exit_code == 0, result.output
    return out


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return taken(tmp_path_factory.mktemp("frame"), "calibration_frame")


@pytest.fixture(scope="module")
def calibrated(frame: Path) -> Path:
    """With handedness −1; the documents and what was printed lie beside the capture."""
    out, report = frame.with_name("rig.json"), frame.with_name("report.html")
    result = run("calibrate", frame, "--calibration-frame", FRAME, "--out", out, "--report", report)
    assert result.exit_code == 0, result.output
    frame.with_name("printed.txt").write_text(result.output)
    return out


def test_what_was_found_is_printed(calibrated: Path) -> None:
    printed = calibrated.with_name("printed.txt").read_text()
    assert "108 of 108" in printed
    assert "-1" in printed
    assert "sigma 0" in printed
    assert "report.html" in printed


def test_the_calibration_says_where_it_comes_from(calibrated: Path) -> None:
    document = json.loads(calibrated.read_text())
    calibration = Calibration.from_document(document)
    assert calibration.source == "capture calibration_frame of calibration frame calibration_frame"
    assert [view.handedness for view in calibration.views] == [-1, -1]
    assert calibration.details["capture"]["bits"] == 8
    assert calibration.details["tests"]
    assert calibration.sigma0_px


def test_the_report_stands_alone(calibrated: Path) -> None:
    report = calibrated.with_name("report.html").read_text()
    assert report.startswith("<!DOCTYPE html>")
    assert "<script" not in report


def test_points_measured_with_it_are_near_the_truth(
    calibrated: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    capture = taken(tmp_path_factory.mktemp("object"), "accuracy_object")
    truth = capture.with_suffix(".csv")
    truth.write_text("\n".join(capture_truth(capture)))
    measured = run("measure", capture, "--calibration", calibrated, "--object", OBJECT)
    assert measured.exit_code == 0, measured.output
    result = run("accuracy", capture, "--truth", truth, "--json")
    assert result.exit_code == 0, result.output
    with CaptureReader(capture) as reader:
        assert reader.run(1).made_with["calibration"] == json.loads(calibrated.read_text())
    assert '"missing": 0' in result.output


def test_a_report_as_json_is_what_json_prints(frame: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    result = run(
        "calibrate", frame, "--calibration-frame", FRAME, "--out", tmp_path / "rig.json", "--report", report,
        "--lens", "shared", "--weights", "equal", "--targets", "held", "--tied", "--no-local-field",
        "--handedness", "-1", "--note", "a test", "--json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    printed = json.loads(result.stdout)
    assert json.loads(report.read_text()) == printed
    assert printed["settings"]["weights"] == "equal"
    assert printed["note"] == "a test"
    assert "lens.f_mm" in printed["unknowns"]["names"]


def test_identifications_by_hand_are_taken(frame: Path, tmp_path: Path) -> None:
    marks = tmp_path / "marks.csv"
    exact = Calibration.from_document(calibration_document(FakeOptions.read({"rig": {"reflections": 1}})))
    lines = [
        f"{view.name},{target},{x:.0f},{y:.0f}"
        for view in exact.views
        for target, place in MARKED.items()
        for x, y in project(view, np.array([place]))
    ]  # fmt: skip
    marks.write_text("\n".join(["view,target,x_px,y_px", *lines]))
    result = run(
        "calibrate", frame, "--calibration-frame", FRAME, "--out", tmp_path / "rig.json",
        "--identifications", marks, "--no-local-field",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "108 of 108" in result.output


def test_measuring_something_else_says_so_and_adds_no_run(calibrated: Path, frame: Path) -> None:
    with CaptureReader(frame) as reader:
        before = len(reader.runs)
    wrong = shipped_configs() / "objects" / "liner.yaml"
    result = run("measure", frame, "--calibration", calibrated, "--object", wrong)
    assert isinstance(result.exception, GrabberdError)
    assert "no target" in result.exception.message
    with CaptureReader(frame) as reader:
        assert len(reader.runs) == before


def test_without_a_check_length_it_passes_with_a_remark(calibrated: Path) -> None:
    printed = calibrated.with_name("printed.txt").read_text()
    assert "acceptance: passed with remarks" in printed
    assert "no check length" in printed
    acceptance = json.loads(calibrated.read_text())["details"]["acceptance"]
    assert acceptance["verdict"] == "passed_with_remarks"


def test_a_check_length_that_is_missed_fails_it_which_is_written_all_the_same(
    frame: Path, calibrated: Path, tmp_path: Path
) -> None:
    out = tmp_path / "rig.json"
    result = run(
        "calibrate", frame, "--calibration-frame", FRAME, "--out", out, "--check-length", "1,108,117.0",
        "--previous", calibrated,
    )  # fmt: skip
    assert result.exit_code == 3, result.output
    printed = " ".join(result.output.split())
    assert "acceptance: failed" in printed
    assert "the scale is off by +2.05 %" in printed
    assert json.loads(out.read_text())["details"]["acceptance"]["verdict"] == "failed"


class TestBadInput:
    def refused(self, frame: Path, tmp_path: Path, *words: object) -> str:
        out = tmp_path / "rig.json"
        result = run("calibrate", frame, "--calibration-frame", FRAME, "--out", out, *words)
        assert result.exit_code != 0
        assert not out.exists()
        error = result.exception
        return f"{error.message} {error.hint}" if isinstance(error, GrabberdError) else result.output

    def test_nothing_is_overwritten(self, frame: Path, calibrated: Path) -> None:
        before = calibrated.read_bytes()
        result = run("calibrate", frame, "--calibration-frame", FRAME, "--out", calibrated)
        assert isinstance(result.exception, GrabberdError)
        assert "exists already" in result.exception.message
        assert calibrated.read_bytes() == before

    def test_a_report_of_another_kind(self, frame: Path, tmp_path: Path) -> None:
        assert ".html" in self.refused(frame, tmp_path, "--report", tmp_path / "report.pdf")

    def test_a_folder_that_is_not_there(self, frame: Path, tmp_path: Path) -> None:
        assert "no folder" in self.refused(frame, tmp_path, "--report", tmp_path / "none" / "report.html")

    def test_a_parameter_that_does_not_exist(self, frame: Path, tmp_path: Path) -> None:
        assert "b10" in self.refused(frame, tmp_path, "--free", "f_mm,b10")

    def test_a_file_of_identifications_without_its_columns(self, frame: Path, tmp_path: Path) -> None:
        marks = tmp_path / "marks.csv"
        marks.write_text("view,target\nleft,1\n")
        assert "x_px" in self.refused(frame, tmp_path, "--identifications", marks)

    def test_a_capture_without_its_file_of_identifications(self, frame: Path, tmp_path: Path) -> None:
        marks = tmp_path / "marks.csv"
        marks.write_text("view,target,x_px,y_px\n")
        assert "marks of 1 captures, and 2" in self.refused(
            frame, tmp_path, frame, "--identifications", marks
        )

    @pytest.mark.parametrize("line", ["middle,1,2,3", "left,one,2,3", "left,1,,3", "left,1"])
    def test_a_line_that_is_no_identification_is_named(self, frame: Path, tmp_path: Path, line: str) -> None:
        marks = tmp_path / "marks.csv"
        marks.write_text(f"view,target,x_px,y_px\n{line}\n")
        assert "line 2" in self.refused(frame, tmp_path, "--identifications", marks)

    @pytest.mark.parametrize(
        ("length", "said"),
        [("1,108", "two ids"), ("1,999,100", "999"), ("7,7,100", "two of"), ("1,2,-4", "length_mm")],
    )
    def test_a_check_length_that_is_none(self, frame: Path, tmp_path: Path, length: str, said: str) -> None:
        assert said in self.refused(frame, tmp_path, "--check-length", length)

    @pytest.mark.parametrize(
        ("line", "said"),
        [
            (
                "check_length: {between: [1, 108], length_mm: 1_00}",
                "length_mm: '1_00' (line 1, column 46: a text",
            ),
            (
                "check_length: {between: [1, yes], length_mm: 1}",
                "not 'yes' (line 1, column 29: a text in YAML 1.2",
            ),
            ("check_length: {between: [1, 108]}", "check_length.length_mm: Field required"),
            ("temperature_C: warm", "temperature_C: is 'warm', expected a finite number"),
            ("temperature_C: .nan", "temperature_C: is nan, expected a finite number"),
        ],
    )
    def test_a_certificate_that_cannot_be(self, frame: Path, tmp_path: Path, line: str, said: str) -> None:
        stand = tmp_path / "stand.yaml"
        text = "".join(
            one for one in FRAME.read_text().splitlines(True) if not one.startswith("check_length")
        )
        stand.write_text(f"{line}\n{text}")
        assert said in self.refused(frame, tmp_path, "--calibration-frame", stand)

    def test_a_capture_of_something_else(self, tmp_path: Path) -> None:
        capture = taken(tmp_path, "blank", fields=4)
        assert "blob" in self.refused(capture, tmp_path)


def moved(folder: Path) -> Path:
    """The calibration frame, turned and moved, before the same rig."""
    turn = rotation_matrix(*np.radians([9.0, -7.0, 30.0]).tolist())
    model = ObjectModel.from_document(yaml.safe_load(FRAME.read_text()))
    keys = ("id", "x_mm", "y_mm", "z_mm", "nx", "ny", "nz")
    points = [
        dict(zip(keys, (int(target), *place, *turn[:, 2].tolist()), strict=True))
        for target, place in zip(model.target, (model.xyz_mm @ turn.T + [3, -2, 2]).tolist(), strict=True)
    ]
    return taken(folder, f"points, points: {json.dumps(points)}", name="moved")


def test_several_poses_calibrate_together(frame: Path, tmp_path: Path) -> None:
    out, report = tmp_path / "rig.json", tmp_path / "report.html"
    second = moved(tmp_path)
    words = ("--calibration-frame", FRAME, "--out", out, "--report", report, "--no-local-field")
    result = run("calibrate", frame, second, *words)
    assert result.exit_code == 0, result.output
    assert "pose 2: turned by 31." in result.output
    (pose,) = Calibration.from_document(json.loads(out.read_text())).details["poses"]
    assert pose["capture"] == "moved"
    assert "Pose 2 of the calibration frame" in report.read_text()
    again = run("calibrate", frame, frame, "--calibration-frame", FRAME, "--out", tmp_path / "twice.json")
    assert again.exit_code == 1
    assert "is named twice" in str(again.exception)
