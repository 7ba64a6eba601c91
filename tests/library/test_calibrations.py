"""Calibrations as a Python program has them."""

from pathlib import Path

import pytest

import grabberd
from grabberd.errors import InputError, StorageError

FRAME = grabberd.example("frame.grab")
TARGETS = grabberd.example("calibration-frame.yaml")


@pytest.fixture(scope="module")
def made() -> grabberd.Calibration:
    return grabberd.calibrate(FRAME, TARGETS, note="first")


def test_a_calibration_is_made_judged_saved_and_loaded(made: grabberd.Calibration, tmp_path: Path) -> None:
    assert made.verdict == "passed_with_remarks"
    assert made.sigma0 == pytest.approx(1.0, abs=0.1)
    loaded = grabberd.Calibration.load(made.save(tmp_path / "rig.json"))
    assert (loaded.id, loaded.verdict, loaded.report) == (made.id, made.verdict, None)
    assert loaded.model.views[0].name == "left"
    with pytest.raises(StorageError):
        made.save(tmp_path / "rig.json")
    with pytest.raises(InputError, match="has no report"):
        loaded.save_report(tmp_path / "report.json")


def test_its_report_is_saved_as_what_the_name_says(made: grabberd.Calibration, tmp_path: Path) -> None:
    assert made.save_report(tmp_path / "report.json").read_text().startswith("{")
    pytest.importorskip("matplotlib")
    assert "<html" in made.save_report(tmp_path / "report.html").read_text()[:200]
    with pytest.raises(InputError, match=r"neither \.html nor \.json"):
        made.save_report(tmp_path / "report.pdf")


def test_options_are_those_of_the_adjustment() -> None:
    with pytest.raises(InputError, match="weights") as caught:
        grabberd.calibrate(FRAME, TARGETS, weights="heavy")
    assert "alpha" in caught.value.hint


def test_what_is_no_calibration_is_refused(tmp_path: Path) -> None:
    (tmp_path / "rig.json").write_text("{}")
    with pytest.raises(InputError):
        grabberd.Calibration.load(tmp_path / "rig.json")
