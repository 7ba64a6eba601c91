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


def test_where_it_is_good_is_the_same_from_the_file_and_in_the_report(
    made: grabberd.Calibration, tmp_path: Path
) -> None:
    loaded = grabberd.Calibration.load(made.save(tmp_path / "rig.json"))
    assert made.report is not None
    assert loaded.validity() == made.report.validity
    far = loaded.validity({"x": (-50, 50), "y": (-20, 20), "z": (30, 50)}, pointing_px=0.1)
    assert far.views[0].z_mm == 40.0
    assert far.pointing_px == [0.1, 0.1]


def test_a_calibration_that_states_no_volume_asks_for_it(made: grabberd.Calibration) -> None:
    details = {key: value for key, value in made.document["details"].items() if key != "volume"}
    older = grabberd.Calibration({**made.document, "details": details})
    with pytest.raises(InputError, match="does not state the volume") as refused:
        older.validity()
    assert "volume_mm=" in refused.value.hint
    assert older.validity({"x": (-50, 50), "y": (-20, 20), "z": (-8, 8)}, pointing_px=0.1).movements


@pytest.mark.parametrize(
    "volume",
    [
        {"x": (0, 1)},
        {"x": (1, 0), "y": (0, 1), "z": (0, 1)},
        {"x": (0, "a"), "y": (0, 1), "z": (0, 1)},
        {"x": 1},
    ],
)
def test_what_is_no_volume_is_refused(made: grabberd.Calibration, volume) -> None:
    with pytest.raises(InputError):
        made.validity(volume)
    with pytest.raises(InputError, match="pointing"):
        made.validity({"x": (0, 1), "y": (0, 1), "z": (0, 1)}, pointing_px=float("nan"))
