"""`grabberd plan` as a person types it."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.config import shipped_configs


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def test_the_shipped_rig_is_planned_without_any_option() -> None:
    result = run("plan")
    assert result.exit_code == 0, result.output
    for words in ("centre", "+X −Y +Z", "base +20 %", "distance -20 %", "8 bits, intact lines", "mm/px"):
        assert words in result.output


def test_json_has_places_and_influence() -> None:
    found = json.loads(run("plan", "--bits", 8, "--json").stdout)
    assert found["places"][0]["pointing"]["xyz_mm"] < 0.06
    assert found["places"][0]["calibration"]["xyz_mm"] < 0.03
    assert found["influence"][0]["name"] == "as it is"


def test_the_papers_rig_from_a_configuration_gives_the_papers_precision(tmp_path: Path) -> None:
    file = tmp_path / "paper.yaml"
    rig = "{distance_mm: 240, base_mm: 127.2, convergence_deg: 29.7, pixel_x_mm: .01, pixel_y_mm: .01}"
    file.write_text(f"devices: {{paper: {{driver: fake, rig: {rig}}}}}")
    found = json.loads(run("plan", "--config", file, "--sigma-px", 0.17, 0.225, "--json").stdout)
    sigma = found["places"][0]["pointing"]
    assert [sigma[f"{axis}_mm"] for axis in "xyz"] == pytest.approx([0.048, 0.036, 0.135], rel=0.06)


def test_pictures_that_no_interlaced_video_has_are_planned_as_progressive() -> None:
    camera = shipped_configs() / "v4l2-camera.yaml"
    own, told, field = (
        json.loads(run("plan", "--config", camera, "--bits", 8, "--json", *lines).stdout)
        for lines in ((), ("--lines", "progressive"), ("--lines", "field"))
    )
    assert own == told
    assert own["places"][0]["pointing"]["xyz_mm"] < field["places"][0]["pointing"]["xyz_mm"]
    assert "8 bits, progressive lines" in {one["name"] for one in own["influence"]}


def test_a_calibration_takes_the_nominal_rigs_place() -> None:
    calibration = shipped_configs() / "fake.calibration.json"
    found = json.loads(run("plan", "--calibration", calibration, "--json").stdout)
    assert found["places"][0]["calibration"] is None


def test_the_plan_says_what_more_columns_of_targets_would_give_for_pressure_and_load() -> None:
    shown = run("plan", "--config", shipped_configs() / "fake.yaml")
    assert "What more columns or rows of targets give" in shown.output
    assert "solved independently" in " ".join(shown.output.split())
    (advice,) = json.loads(run("plan", "--json").stdout)["advice"]
    load = {(one["columns"], one["row_pitch_mm"]): one["load_percent"] for one in advice["figures"]}
    assert load[6, 6.5] < 0.65 * load[4, 6.5]
