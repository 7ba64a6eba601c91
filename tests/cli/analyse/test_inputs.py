"""Inputs and vacuum logs that `grabberd analyse` reads or refuses."""

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from cli.analyse.analysing import (
    LOGGED,
    MATERIAL,
    refusal,
    refused,
)
from core.chain.milking import log
from grabberd.cli.app import app
from grabberd.config import shipped_configs
from grabberd.errors import (
    InputError,
)

pytestmark = pytest.mark.timeout(600)


def test_inputs_that_are_shipped_are_read_and_give_what_a_wall_at_rest_allows(
    resting: Path, tmp_path: Path
) -> None:
    inputs = shipped_configs() / "analysis" / "liner.yaml"
    words = ["analyse", resting, "--inputs", inputs, "--out", tmp_path / "out"]
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == 0, done.output
    assert "no pressure: vacuum.lag" in done.stderr
    assert "no strain, tension and pressure: the reference state phase 0.3" in done.stderr
    assert (tmp_path / "out" / "sections.csv").stat().st_size > 0


def test_a_log_that_does_not_cover_the_capture_is_refused(pulsating: Path, tmp_path: Path) -> None:
    short = tmp_path / "log.csv"
    short.write_text(log(1.2, start_s=-0.3))
    error = refused(InputError, pulsating, tmp_path, "--vacuum-log", short, vacuum=LOGGED)
    assert "the vacuum log covers" in error.message
    assert "have no vacuum" in error.message


@pytest.mark.parametrize(
    ("factor", "unit"), [(10.0, "mbar"), (1000.0, "Pa"), (0.2953, "inHg"), (-1.0, "vacuum")]
)
def test_a_log_in_another_unit_is_refused_by_its_magnitude(
    pulsating: Path, tmp_path: Path, factor: float, unit: str
) -> None:
    head, *rows = log(1.6, start_s=-0.3).splitlines()
    scaled = [
        ",".join([time, *(f"{float(value) * factor:.4f}" for value in values)])
        for time, *values in (row.split(",") for row in rows)
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([head, *scaled]))
    error = refused(InputError, pulsating, tmp_path, "--vacuum-log", path, vacuum=LOGGED)
    assert unit in error.message + error.hint


def test_a_log_that_is_none_is_refused(resting: Path, tmp_path: Path) -> None:
    picture = tmp_path / "log.csv"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n\xff")
    assert "cannot be read" in refused(InputError, resting, tmp_path, "--vacuum-log", picture).message
    nowhere = tmp_path / "nothing.csv"
    assert "cannot be read" in refused(InputError, resting, tmp_path, "--vacuum-log", nowhere).message


def test_a_log_without_a_place_for_it_is_refused(resting: Path, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(log())
    assert (
        "have no vacuum"
        in refusal(InputError, resting, "--vacuum-log", path, "--out", tmp_path / "out").message
    )


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"wall_mm": 0.0}, "wall_mm is 0, expected above 0"),
        ({"E_mpa": -1.0}, "E_mpa is -1"),
        ({"wall_mm": 40.0}, "thicker than a liner"),
        ({"poisson": 0.3}, "keeps the volume"),
        ({"hardness": 50}, "hardness"),
    ],
)
def test_a_wall_that_there_is_not_is_refused(
    resting: Path, tmp_path: Path, wrong: dict[str, float], words: str
) -> None:
    assert words in refused(InputError, resting, tmp_path, material={**MATERIAL, **wrong}).message


def test_a_material_that_lacks_something_names_it(resting: Path, tmp_path: Path) -> None:
    lacking = {key: value for key, value in MATERIAL.items() if key not in {"F0_n", "target_mm"}}
    error = refused(InputError, resting, tmp_path, material=lacking)
    assert "F0_n" in error.message
    assert "target_mm" in error.message


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"colour": "red"}, "colour"),
        ({"reference": "closed"}, "reference"),
        ({"reference": {"field": 7}}, "field 7 has no points"),
        ({"plane": {"point_mm": [0, 0, 0], "normal": [0, 0, 0]}}, "plane.normal"),
        ({"phases": 1}, "phases"),
        ({"sought_kpa": 0}, "sought_kpa"),
        ({"vacuum": {"pulsation": {"kpa": 42}, "liner": {"kpa": 42, "sigma_kpa": 1}}}, "sigma_kpa"),
        ({"vacuum": {"pulsation": "log", "liner": "log"}}, "lack vacuum.log"),
        ({"free_rows": [3, 1]}, "free_rows: unknown key"),
        (
            {"material": {**MATERIAL, "first_end_mm": 65, "last_end_mm": -65}},
            "first_end_mm is 65, expected below",
        ),
    ],
)
def test_inputs_that_cannot_be_meant_are_refused_by_name(
    resting: Path, tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    assert words in refused(InputError, resting, tmp_path, **changes).message


@pytest.mark.parametrize("text", ["- one\n- two\n", "reference: [", "nominal"])
def test_inputs_that_are_no_document_are_refused(resting: Path, tmp_path: Path, text: str) -> None:
    path = tmp_path / "inputs.yaml"
    path.write_text(text)
    assert str(path) in refusal(InputError, resting, "--inputs", path, "--out", tmp_path / "out").message
