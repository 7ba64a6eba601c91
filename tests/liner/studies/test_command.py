"""`grabberd study` on folders of results and on an archive, local and through a daemon."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from archive.captures import slots, write
from grabberd.archive.state.capture_index import CaptureIndex
from grabberd.cli.app import app
from grabberd.errors import ExtraMissing, GrabberdError, InputError, NotReady, StorageError
from liner.studies.results import COMPRESSION, OVERPRESSURE, report, store
from server.api.daemons import Daemon, serving


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.delenv("GRABBERD_URL", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["study", *(str(word) for word in words)])


def said(*words: object) -> Result:
    result = run(*words)
    assert result.exit_code == 0, (result.output, result.exception)
    return result


def refusal(kind: type[GrabberdError], *words: object) -> GrabberdError:
    error = run(*words).exception
    assert isinstance(error, kind), error
    assert error.hint
    return error


@pytest.fixture
def results(folder: Path) -> Path:
    """Two liners on four cows."""
    for number in range(8):
        liner, cow = "AB"[number % 2], str(100 + number // 2)
        value = 40.0 + number // 2 + 3 * (number % 2) + 0.05 * (number % 3)
        labels = {"liner": liner, "cow": cow, "milkings": str(100 * number)}
        store(folder / "results" / f"c{number}", report(f"c{number}", value, labels=labels))
    return folder / "results"


def test_liners_are_compared_within_cows(results: Path) -> None:
    result = said(results, "--by", "liner", "--within", "cow", "--out", "out")
    assert "8 captures, liner: A, B" in result.stdout
    assert "differ" in result.stdout
    names = ("captures", "quantities", "groups", "comparison", "trend", "left_out")
    written = {path.name for path in Path("out").iterdir()}
    assert written == {*(f"{name}.csv" for name in names), "study.json", "report.html"}
    assert f"{OVERPRESSURE}: 8 captures have none" not in result.stderr


def test_json_is_the_document_with_the_files(results: Path) -> None:
    told = json.loads(
        said(
            results, "--by", "liner", "--over", "milkings", "--formats", "parquet", "--out", "out", "--json"
        ).stdout
    )
    assert told["question"]["over"] == "milkings"
    assert [one["name"] for one in told["quantities"]] == [COMPRESSION]
    assert "out/comparison.parquet" in told["files"]
    assert told["quantities"][0]["differences"][0]["value"] == pytest.approx(3.0, abs=0.1)
    assert json.loads(Path("out/study.json").read_text())["quantities"] == told["quantities"]


def test_conditions_choose_among_folders_too(results: Path) -> None:
    told = json.loads(said(results, "cow=100,101", "--by", "liner", "--out", "out", "--json").stdout)
    assert told["captures"] == 4


def test_what_is_left_out_is_told(results: Path) -> None:
    store(results / "odd", report("odd", None, labels={"cow": "1"}))
    (results / "broken").mkdir()
    (results / "broken" / "report.json").write_text("{")
    result = said(results, "--by", "liner", "--quantities", f"{COMPRESSION},{OVERPRESSURE}", "--out", "out")
    assert "left out: odd: it has no liner" in result.stderr
    assert f"left out: {results}/broken: its report.json cannot be read" in result.stderr
    assert f"{OVERPRESSURE}: 8 captures have none: flow_stop was not given" in result.stderr


def test_without_matplotlib_the_tables_are_there(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise ExtraMissing("a report with figures", "report")

    monkeypatch.setattr("grabberd_liner.studies.report.require_matplotlib", missing)
    result = said(results, "--by", "liner", "--out", "out")
    assert "grabberd[report]" in result.stderr
    assert Path("out/comparison.csv").exists()
    assert not Path("out/report.html").exists()


def test_refusals_come_before_any_work_and_leave_no_folder(results: Path) -> None:
    assert (
        "cannot be written as xlsx"
        in refusal(InputError, results, "--formats", "xlsx", "--out", "out").message
    )
    assert (
        "no capture has the quantity"
        in refusal(InputError, results, "--quantities", "lc", "--out", "out").message
    )
    assert "does not exist" in refusal(InputError, "nowhere", "--out", "out").message
    assert not Path("out").exists()
    Path("out").mkdir()
    Path("out/mine").touch()
    assert "is not empty" in refusal(StorageError, results, "--out", "out").message


def analysed(state: Path) -> None:
    """An archive with an analysed capture of each of two liners, and one that is not analysed."""
    (state / "captures").mkdir(parents=True, exist_ok=True)
    for name, liner in (("a1", "A"), ("b1", "B"), ("b2", "B")):
        write(
            state / "captures", slots(2), name=name, id=name, device={"name": "cup"}, labels={"liner": liner}
        )
    CaptureIndex(state / "captures").rebuild()
    for name, value in (("a1", 9.0), ("b1", 10.0)):
        home = state / "analyses" / name / "1"
        home.mkdir(parents=True)
        one: dict[str, Any] = {
            "name": "overpressure_map_kpa",
            "unit": "kPa",
            "value": value,
            "sigma": 1.0,
            "sigma_common": 0.8,
        }
        record = {
            "created_utc": "2026-11-20T08:00:00.000Z",
            "pressure_method": "equilibrium",
            "quantities": [one],
        }
        (home / "record.json").write_text(json.dumps(record))
        (home / "report.json").write_text(json.dumps(report(name)))


def told_of(*words: object) -> Any:
    return json.loads(said(*words, "--by", "liner", "--out", "out", "--json").stdout)


def check(told: Any) -> None:
    assert told["captures"] == 2
    quantity = told["quantities"][0]
    assert quantity["name"] == "overpressure_map_kpa"
    assert quantity["title"] == "title of overpressure_map_kpa"
    assert quantity["differences"][0]["value"] == pytest.approx(1.0)
    assert quantity["verdict"] == "not tested"
    assert told["left_out"] == [
        {"capture": "b2", "quantity": "", "reason": "it has not been analysed", "count": 1}
    ]


def test_the_archive_of_the_state_directory_is_studied(folder: Path) -> None:
    analysed(folder / "state")
    check(told_of("device=cup"))


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    home = tmp_path_factory.mktemp("daemon")
    analysed(home)
    with serving(home, pace="real") as running:
        yield running


def test_the_archive_of_a_daemon_is_the_same(daemon: Daemon, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grabberd_liner.studies.access._PAGE", 1)
    check(told_of("device=cup", "since=2026-03-01", "--url", daemon.url))


def test_a_daemon_that_does_not_answer_is_told(folder: Path) -> None:
    refusal(NotReady, "liner=A", "--url", "http://127.0.0.1:9", "--out", "out")
    assert not Path("out").exists()
