"""The documents that the simulated rig and scenes hand out, and the shipped ones."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from grabberd_fake import FakeOptions, truth_at
from grabberd_fake.__main__ import calibration_document, main, object_document
from grabberd_fake.optics import build_views

CONFIGS = Path(__file__).parents[3] / "configs"
SHIPPED = {
    "fake.calibration.json": ["calibration"],
    "objects/liner.yaml": ["object", "liner"],
    "objects/ellipse.yaml": ["object", "ellipse"],
    "objects/accuracy-object.yaml": ["object", "accuracy_object"],
    "calibration-frames/paper-108.yaml": ["object", "calibration_frame"],
}


@pytest.mark.parametrize("name", SHIPPED)
def test_the_shipped_file_is_what_its_command_prints(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(SHIPPED[name]) == 0
    assert (CONFIGS / name).read_text() == capsys.readouterr().out


def test_the_calibration_has_both_views_with_the_models_parameters() -> None:
    document = calibration_document(FakeOptions())
    assert document["schema"] == "grabberd/calibration/1"
    assert document["image"] == {"columns": 720, "lines": 576}
    left, right = document["views"]["left"], document["views"]["right"]
    assert [(v["first_column"], v["end_column"]) for v in (left, right)] == [(0, 360), (360, 720)]
    assert all(len(view["b"]) == 9 for view in (left, right))
    assert left["Y0_mm"] == pytest.approx(-64, abs=2)
    assert right["Y0_mm"] == pytest.approx(64, abs=2)
    assert json.loads(json.dumps(document)) == document


@pytest.mark.parametrize("reflections", [1, 2])
def test_the_calibration_is_the_rigs_own_to_the_last_bit(reflections: int) -> None:
    options = FakeOptions.read({"rig": {"reflections": reflections}})
    views = calibration_document(options)["views"]
    for view in build_views(options):
        told = views[view.name]
        assert [told["X0_mm"], told["Y0_mm"], told["Z0_mm"]] == view.center_mm().tolist()
        assert told["y0_px"] == options.camera.y0_px - 0.5
        assert abs(told["phi_rad"]) < 0.1


def test_the_object_model_of_the_liner_is_its_open_state(capsys: pytest.CaptureFixture[str]) -> None:
    document = yaml.safe_load(object_document(FakeOptions()))
    assert (document["name"], document["target_diameter_mm"]) == ("liner", 1.5)
    places = np.array([[t["x_mm"], t["y_mm"], t["z_mm"]] for t in document["targets"]])
    assert_allclose(places, truth_at({}, 400_000_000).xyz_mm, atol=6e-5)


@pytest.mark.parametrize("scene", ["calibration_frame", "accuracy_object"])
def test_certified_places_are_the_true_ones_exactly(scene: str) -> None:
    options = FakeOptions.read({"scene": scene})
    document = yaml.safe_load(object_document(options))
    places = np.array([[t["x_mm"], t["y_mm"], t["z_mm"]] for t in document["targets"]])
    truth = truth_at(options, 0)
    assert_allclose(places, truth.xyz_mm, atol=1e-12)
    assert [t["id"] for t in document["targets"]] == truth.ids.tolist()
    assert document["sigma_mm"] > 0


def test_other_options_give_other_documents(capsys: pytest.CaptureFixture[str]) -> None:
    main(["calibration", "--options", '{"rig": {"reflections": 1}}'])
    document = json.loads(capsys.readouterr().out)
    assert document["views"]["left"]["handedness"] == -1
    main(["object", "liner", "--options", '{"liner": {"rows": 2}}'])
    assert len(yaml.safe_load(capsys.readouterr().out)["targets"]) == 12


@pytest.mark.parametrize("options", ["[1]", '{"rig": {"reflections": 4}}'])
def test_the_command_refuses_options_that_cannot_be_used(
    options: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(["calibration", "--options", options])
    assert left.value.code == 2
    assert "not" in capsys.readouterr().err


def test_an_object_without_targets_is_still_yaml(capsys: pytest.CaptureFixture[str]) -> None:
    main(["object", "blank"])
    assert yaml.safe_load(capsys.readouterr().out)["targets"] in (None, [])
