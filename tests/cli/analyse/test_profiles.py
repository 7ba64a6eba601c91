"""`grabberd analyse --profiles`: inputs from the profiles that the labels of a capture name."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from archive.milkings import milking
from cli.analyse.analysing import inputs_file, refusal, run, said
from core.chain.milking import still
from grabberd.archive.state.state_database import Annotation, AnnotationStore
from grabberd.cli.app import app
from grabberd.errors import InputError
from liner.chain.analysis.profiling import LINER, changed

pytestmark = [pytest.mark.timeout(600), pytest.mark.usefixtures("undrawn")]


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A state directory with the liner A."""
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    monkeypatch.delenv("GRABBERD_URL", raising=False)
    added(tmp_path, LINER)
    return tmp_path / "state" / "state.sqlite"


def added(folder: Path, document: dict[str, Any]) -> None:
    file = folder / "profile.yaml"
    file.write_text(yaml.safe_dump(document))
    result = CliRunner().invoke(app, ["profile", "add", str(file)])
    assert result.exit_code == 0, result.exception


def labelled(folder: Path, **labels: str) -> Path:
    return milking(folder, still(3), labels=labels)


def analysed(capture: Path, folder: Path, *more: object) -> dict[str, Any]:
    result = run(capture, "--formats", "", "--json", *more, "--out", folder / "out")
    assert result.exit_code == 0, (result.output, result.exception)
    document: dict[str, Any] = json.loads(result.stdout)
    return document


def report(folder: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((folder / "out" / "report.json").read_text())
    return document


def test_the_liner_of_the_label_gives_its_material_and_the_report_names_the_version(tmp_path: Path) -> None:
    added(tmp_path, changed(LINER, "age_milkings", 900))
    found = analysed(labelled(tmp_path, liner="A"), tmp_path, "--profiles")
    assert [(one["kind"], one["name"], one["version"]) for one in found["profiles"]] == [("liner", "A", 2)]
    inputs = report(tmp_path)["inputs"]
    assert inputs["given"]["material"] == LINER["material"]
    assert inputs["sources"]["material"] == "liner profile A, version 2"
    assert not any(words.startswith("material:") for words in found["lacks"])


def test_the_inputs_file_wins(tmp_path: Path) -> None:
    inputs = inputs_file(tmp_path, {"material": {**LINER["material"], "E_mpa": 2.0}})
    analysed(labelled(tmp_path, liner="A"), tmp_path, "--profiles", "--inputs", inputs)
    found = report(tmp_path)["inputs"]
    assert found["given"]["material"]["E_mpa"] == 2.0
    assert found["sources"]["material"].endswith("inputs.yaml")
    assert found["sources"]["reference"] == "liner profile A, version 1"


def test_without_being_asked_for_no_profile_is_used(tmp_path: Path) -> None:
    found = analysed(labelled(tmp_path, liner="A"), tmp_path)
    assert found["profiles"] == []
    assert any(words.startswith("material:") for words in found["lacks"])


def test_a_label_is_given_on_the_command_line_in_place_of_the_captures_own(tmp_path: Path) -> None:
    capture = labelled(tmp_path, liner="B")
    words = said(run(capture, "--profiles", "--label", "liner=A", "--formats", "", "--out", tmp_path / "out"))
    assert "none in use is called" not in words
    assert report(tmp_path)["about"]["labels"] == {"liner": "A"}


def test_a_label_that_the_capture_got_later_counts(tmp_path: Path, state: Path) -> None:
    capture = labelled(tmp_path, liner="B")
    AnnotationStore(state).put("milking", Annotation(labels={"liner": "A"}))
    assert analysed(capture, tmp_path, "--profiles")["profiles"][0]["name"] == "A"


def test_a_label_without_a_profile_is_said(tmp_path: Path) -> None:
    found = analysed(labelled(tmp_path, liner="B"), tmp_path, "--profiles")
    assert "liner profile: none in use is called 'B', as the label liner says" in found["lacks"]


def test_a_retired_profile_is_not_found(tmp_path: Path) -> None:
    CliRunner().invoke(app, ["profile", "retire", "liner", "A"])
    assert analysed(labelled(tmp_path, liner="A"), tmp_path, "--profiles")["profiles"] == []


def test_a_liner_of_another_diameter_is_refused(tmp_path: Path) -> None:
    added(tmp_path, changed(LINER, "material.radius_mm", 15.0))
    error = refusal(InputError, labelled(tmp_path, liner="A"), "--profiles", "--out", tmp_path / "out")
    assert "its targets lie 32.5 mm apart across the liner" in error.message


def test_labels_without_profiles_are_a_mistake(tmp_path: Path) -> None:
    capture = labelled(tmp_path)
    assert run(capture, "--label", "liner=A", "--out", tmp_path / "out").exit_code == 2
    assert run(capture, "--profiles", "--label", "liner", "--out", tmp_path / "out").exit_code == 2
