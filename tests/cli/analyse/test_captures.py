"""Captures that `grabberd analyse` refuses, and leaves as they are."""

from pathlib import Path

import numpy as np
import pytest

from archive.milkings import milking, object_document
from cli.analyse.analysing import (
    refusal,
    run,
    said,
    written,
)
from core.chain.milking import changed, still
from grabberd.errors import (
    AnalysisError,
    CaptureFileError,
    GrabberdError,
    InputError,
    NotReady,
)

pytestmark = pytest.mark.timeout(600)


def test_a_capture_without_points_is_refused(tmp_path: Path) -> None:
    nothing = [changed(one, keep=np.zeros(35, bool)) for one in still(3)]
    error = refusal(AnalysisError, milking(tmp_path, nothing), "--out", tmp_path / "out")
    assert "no points" in error.message


def test_a_capture_that_was_measured_without_an_object_model_is_refused(tmp_path: Path) -> None:
    capture = milking(tmp_path, still(3), made_with={"object": None})
    assert "grabberd measure" in refusal(NotReady, capture, "--out", tmp_path / "out").hint


def test_points_of_another_object_are_refused(tmp_path: Path) -> None:
    other = object_document()
    for one in other["targets"]:
        one["id"] += 1000
    capture = milking(tmp_path, still(3), made_with={"object": other})
    error = refusal(AnalysisError, capture, "--out", tmp_path / "out")
    assert "targets that the object model does not" in error.message


def test_bursts_of_another_object_are_refused(resting: Path, tmp_path: Path) -> None:
    other = object_document(name="another liner")
    other["targets"][3]["x_mm"] += 0.5
    burst = milking(tmp_path, still(3), "burst", made_with={"object": other})
    error = refusal(InputError, resting, "--bursts", burst, "--out", tmp_path / "out")
    assert "another object model, another liner, than" in error.message


def test_a_damaged_capture_is_refused(resting: Path, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.grab"
    damaged.write_bytes(resting.read_bytes()[:3000])
    refusal(CaptureFileError, damaged, "--out", tmp_path / "out")
    damaged.write_bytes(b"no capture at all" * 1000)
    refusal(CaptureFileError, damaged, "--out", tmp_path / "other")
    assert not any((tmp_path / name).exists() and written(tmp_path / name) for name in ("out", "other"))


def test_a_capture_that_is_not_there_is_refused(tmp_path: Path) -> None:
    error = run(tmp_path / "nothing.grab", "--out", tmp_path / "out").exception
    assert isinstance(error, GrabberdError)
    assert error.hint


@pytest.mark.usefixtures("undrawn")
def test_the_capture_is_not_changed(resting: Path, tmp_path: Path) -> None:
    before = resting.read_bytes()
    said(run(resting, "--formats", "", "--out", tmp_path / "out"))
    assert resting.read_bytes() == before
