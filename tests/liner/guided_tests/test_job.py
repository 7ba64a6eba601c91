"""The job of a guided test, on capture files: stored once, with its analyses, whatever its captures lack."""

import json
from pathlib import Path

import pytest

from archive.milkings import milking
from core.chain.milking import still
from grabberd.errors import InputError
from grabberd.work.job_spec import JobContext
from grabberd_liner.analyses.store import AnalysisStore
from grabberd_liner.guided_tests import run as liner_test_run
from grabberd_liner.guided_tests.documents import LinerTestDocument
from grabberd_liner.guided_tests.job import LinerTestJob
from grabberd_liner.guided_tests.run import run_liner_test
from grabberd_liner.guided_tests.store import LinerTestStore
from grabberd_liner.profiles.documents import ProfileDocument
from grabberd_liner.profiles.profiles import FoundProfiles
from liner.chain.analysis.profiling import LINER

KIND = "reference"


def silent(share: float) -> None:
    """Nobody looks."""


def refused(*_: object, **__: object) -> None:
    raise AssertionError("it is made already")


def found(**content: object) -> FoundProfiles:
    """Labels of a capture, and the liner's profile that they name."""
    profile = ProfileDocument(
        kind="liner",
        name="A",
        version=3,
        newest=3,
        created_utc="2026-03-01T09:30:00.000Z",
        retired_utc=None,
        sha256="0" * 64,
        note="",
        problem=None,
        profile={**LINER, "name": "A", **content},
        yaml="",
    )
    return FoundProfiles({"liner": "A"}, [profile])


class Folder:
    """Stores and captures of a test."""

    def __init__(self, folder: Path, captures: int = 1) -> None:
        self.analyses = AnalysisStore(folder / "analyses")
        self.tests = LinerTestStore(folder / "tests")
        for store in (self.analyses, self.tests):
            store.open()
        names = [f"c{at}" for at in range(captures)]
        self.files = {name: milking(folder, still(24), name) for name in names}

    def context(self, job: str = "job-7") -> JobContext:
        folders = {"analyses": self.analyses.directory, "tests": self.tests.directory}
        return JobContext(job=job, files=self.files, folders=folders)


def checks(document: LinerTestDocument) -> dict[str, str]:
    return {one.name: one.verdict for one in document.checks}


def test_a_test_is_stored_with_its_analysis_under_the_id_of_its_job(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    result = LinerTestJob(subject="c0", test=KIND, profiles={"c0": found()}).run(silent, folder.context())
    assert result.model_dump() == {"test": "job-7", "kind": KIND, "verdict": result.verdict, "analyses": [1]}
    document = folder.tests.document("job-7")
    assert document.liner == "A"
    assert [one.id for one in document.captures] == ["c0"]
    assert document.analyses == [1]
    record = folder.analyses.record("c0", 1)
    assert record["job"] == "job-7"
    assert record["inputs"]["vacuum"]["liner"] == {"kpa": 0.0, "sigma_kpa": 0.2}


def test_it_is_not_made_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = Folder(tmp_path)
    job = LinerTestJob(subject="c0", test=KIND)
    first = job.run(silent, folder.context())
    monkeypatch.setattr(liner_test_run, "run_liner_test", refused)
    assert job.run(silent, folder.context()) == first


def test_an_analysis_that_an_earlier_attempt_has_stored_is_not_stored_again(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    job = LinerTestJob(subject="c0", test=KIND)
    job.run(silent, folder.context())
    for file in (folder.tests.directory / "job-7").iterdir():
        file.unlink()
    (folder.tests.directory / "job-7").rmdir()
    assert job.run(silent, folder.context()).analyses == [1]
    assert folder.analyses.numbers("c0") == [1]


def test_a_profile_that_contradicts_the_capture_fails_with_its_reason(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    wide = found(material={**LINER["material"], "radius_mm": 16.0})
    result = LinerTestJob(subject="c0", test=KIND, profiles={"c0": wide}).run(silent, folder.context())
    document = folder.tests.document("job-7")
    analysed = next(one for one in document.checks if one.name == "analysed")
    assert (result.verdict, analysed.verdict, result.analyses) == ("failed", "failed", [])
    assert "profiles contradict the capture" in analysed.reason
    assert checks(document)["mounted_radius"] == "not checked"
    assert folder.analyses.numbers("c0") == []


def test_what_is_given_wins_over_the_recipe(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    vacuum = {"liner": {"kpa": 1.0, "sigma_kpa": 0.1}}
    inputs = {"average": 6, "vacuum": vacuum}
    LinerTestJob(subject="c0", test=KIND, inputs=inputs, source="a test").run(silent, folder.context())
    given = folder.analyses.record("c0", 1)["inputs"]
    assert given["average"] == 6
    assert given["vacuum"]["liner"] == vacuum["liner"]
    assert given["vacuum"]["pulsation"] == {"kpa": 0.0, "sigma_kpa": 0.2}
    report = json.loads(folder.analyses.file("c0", 1, "report.json").read_text())
    assert report["inputs"]["sources"]["average"] == "a test"
    assert report["inputs"]["sources"]["vacuum.pulsation"] == "the recipe reference"


def test_the_capture_of_the_reference_state_is_that_of_the_artificial_teat(tmp_path: Path) -> None:
    folder = Folder(tmp_path, captures=4)
    labels = {"c0": {"test": "reference"}} | {
        f"c{at}": {"test": "artificial-teat", "known_kpa": f"{2 * at - 2}"} for at in (1, 2, 3)
    }
    profiles = {name: found()._replace(labels={"liner": "A", **one}) for name, one in labels.items()}
    job = LinerTestJob(subject="c3", others=("c0", "c1", "c2"), test="artificial-teat", profiles=profiles)
    assert job.run(silent, folder.context()).analyses == [1, 1, 1]
    assert folder.analyses.numbers("c0") == []
    assert folder.analyses.record("c2", 1)["inputs"]["reference"] == {"capture": "c0"}
    document = folder.tests.document("job-7")
    assert [one.id for one in document.captures] == ["c1", "c2", "c3"]
    assert checks(document)["steps"] == "passed"


def test_a_test_of_one_capture_refuses_two(tmp_path: Path) -> None:
    folder = Folder(tmp_path, captures=2)
    with pytest.raises(InputError, match="the test reference evaluates one capture, not 2"):
        run_liner_test(silent, KIND, list(folder.files.values()), lambda path: None, {})
