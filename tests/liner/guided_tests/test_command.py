"""`grabberd test`: evaluates captures or records one, prints what to do, and stores an offer on request."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner, Result

from archive.milkings import milking
from core.chain.milking import still
from grabberd.cli.app import app
from grabberd.errors import Conflict, InputError
from grabberd_liner.guided_tests import run as liner_test_run
from grabberd_liner.guided_tests.documents import LinerTestDocument, ProfileOffer
from liner.chain.analysis.profiling import LINER

pytestmark = pytest.mark.timeout(600)


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A state directory with the liner A."""
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    monkeypatch.delenv("GRABBERD_URL", raising=False)
    monkeypatch.setenv("COLUMNS", "80")
    file = tmp_path / "profile.yaml"
    file.write_text(yaml.safe_dump(LINER))
    assert CliRunner().invoke(app, ["profile", "add", str(file)]).exit_code == 0


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["test", *(str(word) for word in words)])


def judged(result: Result) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(result.stdout)
    return {one["name"]: one for one in document["checks"]}


def test_a_capture_is_judged_with_its_liner_s_profile(tmp_path: Path) -> None:
    capture = milking(tmp_path, still(24), labels={"liner": "A"})
    result = run("reference", capture, "--json", "--out", tmp_path / "out")
    checks = judged(result)
    assert checks["liner_profile"]["verdict"] == "passed"
    assert checks["wall_still"]["verdict"] == "passed"
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"test.json"}
    kept = json.loads((tmp_path / "out" / "test.json").read_text())
    assert kept == json.loads(result.stdout)
    assert kept["captures"][0]["profiles"][0]["version"] == 1
    analysed = json.loads((tmp_path / "out" / "analysis-1" / "report.json").read_text())
    assert analysed["id"] == kept["captures"][0]["id"]


def test_a_check_that_failed_ends_with_3_and_says_what_to_do_within_80_columns(tmp_path: Path) -> None:
    capture = milking(tmp_path, still(24))
    result = run("milking", capture, "--liner", "B", "--out", tmp_path / "out")
    assert result.exit_code == 3
    said = " ".join(result.output.split())
    assert "no profile in use is called 'B'" in said
    assert "capture while the pulsator runs" in said
    shown = [line for line in result.stdout.splitlines() if str(tmp_path) not in line]
    assert max(map(len, shown)) <= 80


def test_a_capture_is_recorded_with_the_recipe_s_length_bits_and_labels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[dict[str, Any]] = []

    def record(config: object, file: object, device: object, request: dict[str, Any], out: Path) -> None:
        asked.append(request)
        milking(tmp_path, still(24), labels=request["labels"]).rename(out)

    monkeypatch.setattr("grabberd.cli.direct_capture.capture_directly", record)
    result = run("reference", "--liner", "A", "--label", "cow=112", "--json", "--out", tmp_path / "out")
    (request,) = asked
    assert (request["duration_s"], request["bits"]) == (2.0, 8)
    assert request["labels"] == {"cow": "112", "liner": "A", "test": "reference"}
    assert "1. Mount the liner" in result.stderr
    (recorded,) = (tmp_path / "out").glob("reference-2*.grab")
    assert recorded.is_file()
    assert judged(result)["liner_profile"]["verdict"] == "passed"


def test_a_test_of_several_captures_cannot_be_recorded_at_once(tmp_path: Path) -> None:
    result = run("artificial-teat", "--out", tmp_path / "out")
    assert isinstance(result.exception, InputError)
    assert "grabberd capture --label test=artificial-teat" in result.exception.hint


@pytest.mark.parametrize(
    ("words", "said"),
    [(("gauge", "--out", "out"), "is none of reference, ramp"), (("ramp",), "name a folder for the results")],
)
def test_a_command_that_says_too_little_is_refused(words: tuple[str, ...], said: str) -> None:
    result = run(*words)
    assert result.exit_code == 2
    assert said in " ".join(result.output.replace("│", " ").split())


def offering(after: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets every test offer another modulus."""
    material = {**LINER["material"], "E_mpa": 3.3}
    offer = ProfileOffer(
        profile={**LINER, "material": material}, after=after, changes=["material.E_mpa: 3 → 3.3"]
    )
    made = liner_test_run.run_liner_test

    def with_offer(*given: Any) -> liner_test_run.LinerTestOutput:
        output = made(*given)
        document: LinerTestDocument = output.document.model_copy(update={"offer": offer})
        return liner_test_run.LinerTestOutput(document, output.analyses)

    monkeypatch.setattr(liner_test_run, "run_liner_test", with_offer)


def stored(folder: Path) -> float:
    """Modulus of the profile's newest version."""
    result = CliRunner().invoke(app, ["profile", "show", "liner", "A", "--json"])
    return float(json.loads(result.stdout)["profile"]["material"]["E_mpa"])


def test_an_offer_is_stored_only_if_it_is_accepted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offering(1, monkeypatch)
    capture = milking(tmp_path, still(24), labels={"liner": "A"})
    said = run("reference", capture, "--out", tmp_path / "first").output
    assert "material.E_mpa: 3 → 3.3" in " ".join(said.split())
    assert stored(tmp_path) == LINER["material"]["E_mpa"]
    result = run("reference", capture, "--accept", "--out", tmp_path / "second")
    assert "liner A: version 2" in result.stderr
    assert stored(tmp_path) == 3.3


def test_an_offer_on_an_older_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offering(0, monkeypatch)
    capture = milking(tmp_path, still(24), labels={"liner": "A"})
    result = run("reference", capture, "--accept", "--out", tmp_path / "out")
    assert isinstance(result.exception, Conflict)
    assert "has version 1 by now" in result.exception.message
