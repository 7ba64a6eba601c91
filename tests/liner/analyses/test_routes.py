"""Analyses over HTTP."""

import csv
import io
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from running import PATIENCE_S, wait_until_it_accepts

from archive.milkings import milking, object_document
from core.chain.milking import CONSTANT, PERIOD_S, field, still
from core.chain.milking import MATERIAL as EXAMPLE
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service
from grabberd.work.job_spec import JobContext
from grabberd_liner.analyses.documents import AnalysisDocument
from grabberd_liner.analyses.job import AnalysisJob
from grabberd_liner.analyses.store import RECORD
from grabberd_liner.part import liner_of
from server.api.conftest import service_in

pytestmark = pytest.mark.timeout(600)
CAPTURES = "/api/v1/captures"
BUSY_S = 4 * PATIENCE_S
"""Jobs are niced: a busy computer does them late."""
MATERIAL = {name: value for name, value in EXAMPLE.items() if not name.endswith("_end_mm")}
"""Without the ends that hold the liner: pressures take long, and are the same as those of the processes."""
INPUTS = {
    "reference": "nominal",
    "material": MATERIAL,
    "vacuum": CONSTANT,
    "plane": "symmetry",
    "heights_mm": [-10, 0, 10],
    "phases": 4,
    "sought_kpa": 20.0,
}
SHAPE = {"heights_mm": [0]}


def client_of(folder: Path) -> Iterator[TestClient]:
    """With captures of the milking (pulsating, one field missing), of its open liner, and others."""
    captures = folder / "captures"
    captures.mkdir()
    milking(captures, [field(n) for n in range(46) if n != 30], "pulsating")
    milking(captures, still(3), "resting")
    milking(captures, still(2), "kept")
    milking(captures, still(2), "untouched")
    other = object_document(name="another liner")
    other["targets"][3]["x_mm"] += 0.5
    milking(captures, still(2), "another", made_with={"object": other})
    service = service_in(folder, pace="real")
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        yield client


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    yield from client_of(tmp_path_factory.mktemp("analyses"))


def service_of(client: TestClient) -> Service:
    service: Service = client.app.state.service  # type: ignore[attr-defined]
    return service


def ordered(client: TestClient, capture_id: str, order: Any = None, **headers: str) -> Any:
    return client.post(f"{CAPTURES}/{capture_id}/analysis", json=order, headers=headers)


def ended(client: TestClient, answer: Any) -> dict[str, Any]:
    """The job that was answered with, once it has ended."""
    assert answer.status_code == 202, answer.json()
    service_of(client).jobs.wait(answer.json()["id"], BUSY_S)
    job: dict[str, Any] = client.get(answer.headers["Location"]).json()
    return job


def done(client: TestClient, capture_id: str, **order: Any) -> int:
    """The number of a new analysis."""
    job = ended(client, ordered(client, capture_id, order))
    assert job["state"] == "done", job
    number: int = job["result"]["analysis"]
    return number


def rows(client: TestClient, capture_id: str) -> list[dict[str, Any]]:
    listed: list[dict[str, Any]] = client.get(f"{CAPTURES}/{capture_id}/analyses").json()["analyses"]
    return listed


def column(table: dict[str, Any], name: str) -> list[Any]:
    values: list[Any] = next(one["values"] for one in table["columns"] if one["name"] == name)
    return values


def is_problem(answer: Any, status: int) -> bool:
    kind = answer.headers["content-type"] == "application/problem+json"
    return bool(answer.status_code == status and kind and answer.json()["hint"])


@pytest.fixture(scope="module")
def analysed(client: TestClient) -> str:
    """The address of an analysis with everything, the first of its capture; made as the job makes it."""
    service = service_of(client)
    files = {"pulsating": service.archive.sealed_path("pulsating")}
    context = JobContext(job="job-1", files=files, folders={"analyses": liner_of(service).analyses.directory})
    made = AnalysisJob(subject="pulsating", inputs=INPUTS).run(lambda share: None, context)
    assert made.analysis == 1
    return f"{CAPTURES}/pulsating/analyses/1"


def test_it_is_listed_with_its_inputs_and_what_was_found(client: TestClient, analysed: str) -> None:
    row = rows(client, "pulsating")[-1]
    assert (row["analysis"], row["run"], row["bursts"]) == (1, 1, [])
    assert row["inputs"] == INPUTS
    assert row["lacks"] == [
        "material.first_end_mm, material.last_end_mm: without them no pressure",
        "flow_stop: without it no overpressure by the map",
    ]
    assert (row["pressure_method"], row["outdated_pressure"]) == ("equilibrium", False)
    assert "1 after field 29" in row["problems"][0]
    assert row["created_utc"].endswith("Z")
    assert abs(row["summary"]["period_s"] - PERIOD_S) < 5 * row["summary"]["sigma_period_s"]
    assert (row["missing_extra"], row["page_problem"], row["problem"]) == (None, None, None)


def test_a_list_comes_page_by_page(client: TestClient, analysed: str) -> None:
    analyses = liner_of(service_of(client)).analyses
    record = analyses.directory / "pulsating" / "1" / RECORD
    with analyses.scratch() as folder:
        shutil.copy(record, folder)
        number = analyses.publish("pulsating", folder)
    try:
        page = client.get(f"{CAPTURES}/pulsating/analyses", params={"limit": 1}).json()
        assert [row["analysis"] for row in page["analyses"]] == [number]
        following = {"limit": 500, "cursor": page["next"]}
        page = client.get(f"{CAPTURES}/pulsating/analyses", params=following).json()
        assert page["analyses"][-1]["analysis"] == 1
        assert page["next"] is None
    finally:
        shutil.rmtree(analyses.directory / "pulsating" / str(number))


def test_the_curves_come_as_columns_with_unit_and_sigma(client: TestClient, analysed: str) -> None:
    document = client.get(analysed).json()
    assert AnalysisDocument.model_validate(document).id == "pulsating"
    assert document["pressure_method"] == "equilibrium"
    assert set(document["inputs"]["sources"]) == set(INPUTS)
    fields = document["tables"]["fields"]
    assert column(fields, "n") == [n for n in range(46) if n != 30]
    for name in ("movement_mm", "area_mm2", "mean_contact_kpa", "sigma_mean_contact_kpa"):
        assert len(column(fields, name)) == 45
    units = {one["name"]: one["unit"] for one in fields["columns"]}
    assert units["sigma_mean_contact_kpa"] == "kPa"
    assert column(document["tables"]["phases"], "phase") == [0, 0.25, 0.5, 0.75]


def test_what_a_client_has_already_is_not_sent_again(client: TestClient, analysed: str) -> None:
    for address in (analysed, f"{analysed}/maps?field=3"):
        first = client.get(address)
        assert "immutable" in first.headers["Cache-Control"]
        for known in (first.headers["ETag"], "*"):
            again = client.get(address, headers={"If-None-Match": known})
            assert (again.status_code, again.content) == (304, b"")
        assert client.get(address, headers={"If-None-Match": '"other"'}).status_code == 200


def test_a_map_is_of_a_field_or_of_the_nearest_phase(client: TestClient, analysed: str) -> None:
    found = client.get(f"{analysed}/maps?field=31").json()
    assert (found["field"], found["phase"]) == (31, None)
    assert {len(values) for values in found["columns"].values()} == {35}
    assert found["units"]["tension1_n_per_m"] == "N/m"
    assert client.get(f"{analysed}/maps?phase=0.9").json()["phase"] == 0
    assert client.get(f"{analysed}/maps?phase=0.8").json()["phase"] == 0.75
    assert client.get(f"{analysed}/maps").json()["phase"] == 0
    assert client.get(f"{analysed}/maps?field=31&phase=0.5").json() == found


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ("field=30", 404),
        ("field=400", 404),
        ("phase=2", 422),
        ("field=x", 422),
    ],
)
def test_a_map_that_there_is_not_is_a_problem(
    client: TestClient, analysed: str, query: str, status: int
) -> None:
    assert is_problem(client.get(f"{analysed}/maps?{query}"), status)


def test_the_report_is_a_page_that_loads_nothing(client: TestClient, analysed: str) -> None:
    answer = client.get(f"{analysed}/report")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.text.startswith("<!DOCTYPE html>")
    assert answer.headers["content-security-policy"].startswith("default-src 'none'")


def test_every_table_comes_as_csv(client: TestClient, analysed: str) -> None:
    answer = client.get(f"{analysed}/targets.csv")
    assert answer.headers["content-type"].startswith("text/csv")
    assert 'filename="pulsating-analysis-1-targets.csv"' in answer.headers["content-disposition"]
    table = list(csv.DictReader(io.StringIO(answer.text)))
    assert len(table) == 45 * 35
    assert {"x_mm", "sigma_x_mm", "contact_kpa", "reason"} < set(table[0])
    for name in ("summary", "phase_targets", "triangles", "gaps"):
        assert client.get(f"{analysed}/{name}.csv").status_code == 200
    assert is_problem(client.get(f"{analysed}/nothing.csv"), 404)


def test_an_analysis_with_outdated_pressures_says_so_wherever_it_is_read(client: TestClient) -> None:
    number = done(client, "resting", inputs=SHAPE)
    folder = liner_of(service_of(client)).analyses.directory / "resting" / str(number)
    record = json.loads((folder / "record.json").read_text())
    document = json.loads((folder / "report.json").read_text())
    del record["pressure_method"], document["pressure_method"]
    (folder / "record.json").write_text(json.dumps({**record, "inputs": INPUTS, "lacks": []}))
    (folder / "report.json").write_text(json.dumps(document))
    address = f"{CAPTURES}/resting/analyses/{number}"
    assert [row["outdated_pressure"] for row in rows(client, "resting") if row["analysis"] == number] == [
        True
    ]
    assert "The pressures of this analysis are wrong" in client.get(f"{address}/report").text
    name = client.get(f"{address}/targets.csv").headers["content-disposition"]
    assert f"resting-analysis-{number}-targets-outdated-pressure.csv" in name
    assert AnalysisDocument.model_validate(client.get(address).json()).pressure_method is None


def test_an_analysis_with_the_earlier_overpressure_says_so_wherever_it_is_read(client: TestClient) -> None:
    number = done(client, "resting", inputs=SHAPE)
    folder = liner_of(service_of(client)).analyses.directory / "resting" / str(number)
    record = json.loads((folder / "record.json").read_text())
    old = {"name": "overpressure_kpa", "unit": "kPa", "value": 48.4, "sigma": 5.2}
    (folder / "record.json").write_text(json.dumps({**record, "quantities": [old]}))
    address = f"{CAPTURES}/resting/analyses/{number}"
    (row,) = (row for row in rows(client, "resting") if row["analysis"] == number)
    assert (row["outdated_overpressure"], row["outdated_pressure"]) == (True, False)
    assert row["quantities"][0]["name"] == "teat_end_beyond_flow_stop_kpa"
    name = client.get(f"{address}/quantities.csv").headers["content-disposition"]
    assert f"resting-analysis-{number}-quantities-outdated-overpressure.csv" in name


def test_without_inputs_there_is_the_shape_and_what_lacks_is_said(client: TestClient) -> None:
    job = ended(client, ordered(client, "resting"))
    assert (job["kind"], job["subject"], job["state"], job["progress"]) == ("analyse", "resting", "done", 1)
    assert len(job["result"]["lacks"]) == 6
    assert any("only 3 fields" in words for words in job["result"]["problems"])


def test_a_second_one_gets_a_number_of_its_own_and_leaves_the_first_as_it_is(client: TestClient) -> None:
    first = rows(client, "resting")[0]["analysis"] if rows(client, "resting") else done(client, "resting")
    before = client.get(f"{CAPTURES}/resting/analyses/{first}").content
    second = done(client, "resting", inputs={**SHAPE, "reference": {"field": 1}}, run=1)
    assert second == first + 1
    assert client.get(f"{CAPTURES}/resting/analyses/{first}").content == before
    newer, older = rows(client, "resting")[:2]
    assert (newer["analysis"], older["analysis"]) == (second, first)
    assert "reference" in older["lacks"][0]
    assert "reference" not in newer["lacks"][0]


def test_an_order_that_comes_again_with_its_key_is_done_once(client: TestClient) -> None:
    count = len(rows(client, "resting"))
    key = {"Idempotency-Key": "0b4ad6c8"}
    order = {"inputs": SHAPE, "bursts": ["kept"]}
    first, again = ordered(client, "resting", order, **key), ordered(client, "resting", order, **key)
    assert again.headers["Idempotent-Replayed"] == "true"
    assert again.json()["id"] == first.json()["id"]
    assert ended(client, first)["state"] == "done"
    assert len(rows(client, "resting")) == count + 1
    assert rows(client, "resting")[0]["bursts"] == ["kept"]
    assert is_problem(ordered(client, "resting", {"inputs": {}}, **key), 422)


def test_cancelled_it_leaves_nothing(client: TestClient) -> None:
    before = rows(client, "pulsating")
    jobs = [ordered(client, "pulsating", {"inputs": INPUTS}).json()["id"] for _ in range(2)]
    for job in reversed(jobs):
        assert client.delete(f"/api/v1/jobs/{job}").json()["state"] == "cancelled"
    assert done(client, "another", inputs=SHAPE)
    assert rows(client, "pulsating") == before
    assert list(liner_of(service_of(client)).analyses.directory.glob(".*")) == []


def test_they_are_deleted_with_the_capture(client: TestClient) -> None:
    number = done(client, "kept", inputs=SHAPE)
    address = f"{CAPTURES}/kept/analyses/{number}"
    assert client.get(address).status_code == 200
    assert client.delete(f"{CAPTURES}/kept").status_code == 204
    for gone in (address, f"{address}/report", f"{address}/fields.csv", f"{CAPTURES}/kept/analyses"):
        assert is_problem(client.get(gone), 404)
    assert not (liner_of(service_of(client)).analyses.directory / "kept").exists()


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ({"inputs": {"colour": "red"}}, "colour"),
        ({"inputs": {**INPUTS, "material": {**MATERIAL, "wall_mm": 0}}}, "wall_mm is 0"),
        ({"inputs": {"reference": {"field": 7}}}, "field 7 has no points"),
        ({"inputs": SHAPE, "bursts": ["another"]}, "another object model, another liner"),
        ({"inputs": SHAPE, "run": 7}, "no run 7"),
        ({"inputs": SHAPE, "vacuum_log": "time_s\n1"}, "have no vacuum"),
    ],
)
def test_what_cannot_be_analysed_fails_the_job_with_a_hint(
    client: TestClient, order: dict[str, Any], words: str
) -> None:
    before = rows(client, "resting")
    job = ended(client, ordered(client, "resting", order))
    assert job["state"] == "failed"
    assert words in job["problem"]["message"]
    assert job["problem"]["hint"]
    assert rows(client, "resting") == before


@pytest.mark.parametrize(
    "order",
    [
        [],
        {"colour": "red"},
        {"inputs": []},
        {"inputs": "nominal"},
        {"bursts": "one"},
        {"bursts": ["../../etc/passwd"]},
        {"bursts": ["one"] * 101},
        {"run": 0},
        {"run": "latest"},
        {"vacuum_log": 3},
    ],
)
def test_what_cannot_be_meant_is_refused(client: TestClient, order: Any) -> None:
    assert is_problem(ordered(client, "resting", order), 422)


def test_what_is_not_there_is_a_problem_with_a_hint(client: TestClient) -> None:
    assert is_problem(ordered(client, "nothing", {}), 404)
    assert is_problem(ordered(client, "resting", {"bursts": ["nothing"]}), 404)
    for address in (
        f"{CAPTURES}/nothing/analyses",
        f"{CAPTURES}/nothing/analyses/1",
        f"{CAPTURES}/resting/analyses/999",
        f"{CAPTURES}/resting/analyses/999/report",
        f"{CAPTURES}/resting/analyses/999/maps?field=0",
        f"{CAPTURES}/resting/analyses/999/fields.csv",
    ):
        assert is_problem(client.get(address), 404), address


@pytest.mark.parametrize("name", ["../index", "%2e%2e%2frecord", "record.json", "Fields", "x" * 41])
def test_no_name_of_a_table_reaches_the_file_system(client: TestClient, analysed: str, name: str) -> None:
    assert client.get(f"{analysed}/{name}.csv").status_code in (404, 422)


def test_a_running_capture_is_not_analysed(client: TestClient) -> None:
    running = client.post(CAPTURES, json={}).json()["id"]
    try:
        assert is_problem(ordered(client, running, {}), 409)
        assert is_problem(ordered(client, "resting", {"bursts": [running]}), 409)
    finally:
        client.post(f"{CAPTURES}/{running}/stop")


def test_a_report_that_could_not_be_drawn_says_why_and_keeps_its_numbers(client: TestClient) -> None:
    number = rows(client, "another")[0]["analysis"] if rows(client, "another") else done(client, "another")
    folder = liner_of(service_of(client)).analyses.directory / "another" / str(number)
    address = f"{CAPTURES}/another/analyses/{number}"
    record = json.loads((folder / "record.json").read_text())
    for reason, status in (({"missing_extra": "report"}, 501), ({"page_problem": "KeyError: 'x'"}, 404)):
        (folder / "record.json").write_text(json.dumps({**record, **reason}))
        assert is_problem(client.get(f"{address}/report"), status)
        assert client.get(address).status_code == 200
    (folder / "record.json").write_text("{")
    assert rows(client, "another")[0]["problem"]


def prepared(client: TestClient, capture_id: str, **order: Any) -> Any:
    return client.post(f"{CAPTURES}/{capture_id}/analysis/inputs", json=order)


def test_what_an_analysis_would_be_made_with_is_told_without_making_it(client: TestClient) -> None:
    before = rows(client, "resting")
    answer = prepared(client, "resting", inputs={"plane": "symmetry"}, profiles=True)
    assert answer.status_code == 200
    told = answer.json()
    assert (told["run"], told["inputs"]) == (1, {"plane": "symmetry"})
    assert any(text.startswith("material: without it") for text in told["lacks"])
    assert any("profile: none in use" in text for text in told["lacks"])
    assert rows(client, "resting") == before


def test_everything_for_which_it_would_be_refused_is_told_at_once(client: TestClient) -> None:
    wrong = {"material": {"law": "linear"}, "vacuum": {"liner": "channel"}, "phases": 1}
    problems = "\n".join(prepared(client, "resting", inputs=wrong).json()["problems"])
    assert "E_mpa" in problems
    assert "vacuum.liner" in problems
    assert "phases" in problems


def test_a_capture_that_is_not_there_prepares_nothing(client: TestClient) -> None:
    assert prepared(client, "nonsuch").status_code == 404
    assert prepared(client, "resting", inputs=3).status_code == 422


def test_captures_are_compared_by_their_newest_analyses(client: TestClient) -> None:
    done(client, "resting", inputs=SHAPE)
    answer = client.get("/api/v1/study", params={"captures": ["resting", "untouched"], "by": "id"})
    assert answer.status_code == 200
    reasons = {one["capture"]: one["reason"] for one in answer.json()["left_out"] if one["capture"]}
    assert reasons == {"untouched": "it has not been analysed"}
    assert client.get("/api/v1/study").status_code == 422
    assert client.get("/api/v1/study", params={"captures": ["nonsuch"]}).json()["hint"]
