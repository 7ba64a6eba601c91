"""Captures over HTTP."""

import csv
import io
import sqlite3
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
import pytest
from fastapi.testclient import TestClient

from grabberd.archive.capture.reader import CaptureReader

CAPTURES = "/api/v1/captures"


def test_a_capture_is_started_and_can_be_found_where_the_answer_says(fast: TestClient) -> None:
    answer = fast.post(CAPTURES, json={"fields": 10})
    assert answer.status_code == 202
    found = fast.get(answer.headers["Location"])
    assert found.status_code == 200
    assert found.json()["id"] == answer.json()["id"]


def test_a_sealed_capture_says_what_became_of_every_field(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    document = client.get(f"{CAPTURES}/{capture_id}").json()
    assert document["state"] == "sealed"
    assert document["verdict"] == "complete"
    assert document["ended_because"] == "length reached"
    assert document["ledger"]["in_words"] == "complete"
    assert document["ledger"]["counts"] == {
        "received": 20,
        "lost": 0,
        "damaged": 0,
        "no_signal": 0,
        "overrun": 0,
    }
    assert document["labels"] == {"cow": "112"}
    assert [run["kind"] for run in document["runs"]] == ["live"]


def test_captures_are_listed_newest_first(captured: tuple[TestClient, str]) -> None:
    client, first = captured
    second = client.post(CAPTURES, json={"fields": 5}).json()["id"]
    listed = [capture["id"] for capture in client.get(CAPTURES).json()["captures"]]
    assert listed == [second, first]


def test_a_second_start_is_refused_with_the_running_ones_id(paced: TestClient) -> None:
    running = paced.post(CAPTURES, json={}).json()["id"]
    refused = paced.post(CAPTURES, json={"fields": 5})
    assert refused.status_code == 409
    assert refused.headers["content-type"] == "application/problem+json"
    assert refused.json()["capture_id"] == running
    assert "stop" in refused.json()["hint"]


def test_a_running_capture_is_stopped_and_sealed(paced: TestClient) -> None:
    capture_id = paced.post(CAPTURES, json={}).json()["id"]
    assert paced.get(f"{CAPTURES}/{capture_id}").json()["state"] == "recording"
    assert paced.post(f"{CAPTURES}/{capture_id}/stop").status_code == 202
    service = paced.app.state.service  # type: ignore[attr-defined]
    assert service.instrument(None).captures.recording.sealed.wait(30)
    document = paced.get(f"{CAPTURES}/{capture_id}").json()
    assert (document["state"], document["ended_because"]) == ("sealed", "stopped by the operator")
    assert paced.post(f"{CAPTURES}/{capture_id}/stop").status_code == 409


def test_a_duration_is_a_number_of_fields(fast: TestClient) -> None:
    capture_id = fast.post(CAPTURES, json={"duration_s": 0.5}).json()["id"]
    service = fast.app.state.service  # type: ignore[attr-defined]
    assert service.instrument(None).captures.recording.sealed.wait(30)
    assert fast.get(f"{CAPTURES}/{capture_id}").json()["fields"] == 25


@pytest.mark.parametrize(
    "order",
    [
        {"fields": 0},
        {"fields": 10, "duration_s": 1},
        {"bits": 7},
        {"lines": "tripled"},
        {"pre_trigger_fields": -1},
        {"fields": 10, "pre_trigger_fields": 10},
        {"field": 10},
        {"labels": {"cow": 3}},
        {"duration_s": 1e300},
        [],
    ],
)
def test_what_cannot_be_meant_is_refused_with_where_it_stands(idle: TestClient, order: object) -> None:
    refused = idle.post(CAPTURES, json=order)
    assert refused.status_code == 422
    assert refused.headers["content-type"] == "application/problem+json"
    assert refused.json()["faults"]


def test_an_unknown_device_is_refused_with_those_there_are(idle: TestClient) -> None:
    refused = idle.post(CAPTURES, json={"device": "other"})
    assert refused.status_code == 404
    assert "simulated" in refused.json()["hint"]


def test_points_come_as_csv_with_their_sigma(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    answer = client.get(f"{CAPTURES}/{capture_id}/points.csv")
    assert answer.headers["content-type"].startswith("text/csv")
    assert capture_id in answer.headers["content-disposition"]
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert len({row["n"] for row in rows}) == 20
    assert all(0 < float(row["sigma_z_mm"]) < 0.5 for row in rows)


def test_a_field_comes_as_a_picture(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    answer = client.get(f"{CAPTURES}/{capture_id}/fields/3.png")
    picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    assert picture.shape == (576, 720)
    assert set(np.unique(picture)) == {0, 255}


def test_the_file_is_taken_home_whole(kept: tuple[TestClient, str], tmp_path: Path) -> None:
    client, capture_id = kept
    file = tmp_path / "home.sqlite"
    file.write_bytes(client.get(f"{CAPTURES}/{capture_id}/file").content)
    connection = sqlite3.connect(file)
    assert connection.execute("SELECT count(*) FROM fields").fetchone() == (20,)
    connection.close()


@pytest.mark.parametrize("format", ["csv", "ply", "parquet", "mat", "c3d"])
def test_points_that_the_disk_has_changed_are_refused_before_the_first_is_sent(
    captured: tuple[TestClient, str], format: str
) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow")
    client, capture_id = captured
    path = client.app.state.service.archive.path(capture_id)  # type: ignore[attr-defined]
    good = path.read_bytes()
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE points SET target = zeroblob(9)")
    refused = client.get(f"{CAPTURES}/{capture_id}/points.{format}")
    path.write_bytes(good)
    assert refused.status_code == 410
    assert "it is not what was written" in refused.json()["detail"]


def test_measuring_again_is_a_job_that_adds_a_run(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    answer = client.post(f"{CAPTURES}/{capture_id}/measure")
    assert answer.status_code == 202
    service = client.app.state.service  # type: ignore[attr-defined]
    service.jobs.wait(answer.json()["id"], 60)
    job = client.get(answer.headers["Location"]).json()
    assert job["state"] == "done", job
    assert job["result"]["run"] == 2
    again = client.get(f"{CAPTURES}/{capture_id}/points.csv?run=2").text
    assert again == client.get(f"{CAPTURES}/{capture_id}/points.csv?run=1").text


@pytest.mark.parametrize(
    "path",
    [
        "/api/v1/captures/nothing",
        "/api/v1/captures/nothing/points.csv",
        "/api/v1/captures/nothing/file",
        "/api/v1/captures/nothing/fields/0.png",
        "/api/v1/jobs/job-77",
        "/api/v1/devices/nothing",
        "/api/v1/nothing",
    ],
)
def test_what_is_not_there_is_a_problem_with_a_hint(idle: TestClient, path: str) -> None:
    answer = idle.get(path)
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["hint"]


def test_missing_fields_and_runs_are_problems_too(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    assert client.get(f"{CAPTURES}/{capture_id}/fields/20.png").status_code == 404
    assert client.get(f"{CAPTURES}/{capture_id}/points.csv?run=9").status_code == 404


@pytest.mark.parametrize("capture_id", ["..", "../index", "a/b", "%2e%2e%2findex", "x" * 200, "a.b"])
def test_no_id_reaches_the_file_system(idle: TestClient, capture_id: str) -> None:
    assert idle.get(f"{CAPTURES}/{capture_id}/file").status_code in (404, 422)


@pytest.mark.parametrize("wanted", ["continue", "end"])
def test_a_capture_may_say_what_an_interruption_does_to_it(fast: TestClient, wanted: str) -> None:
    answer = fast.post(CAPTURES, json={"fields": 5, "on_interruption": wanted})
    assert answer.status_code == 202
    service = fast.app.state.service  # type: ignore[attr-defined]
    assert service.instrument(None).captures.recording.sealed.wait(30)
    with CaptureReader(service.archive.path(answer.json()["id"])) as reader:
        assert reader.meta.extra["on_interruption"] == wanted


def test_another_policy_is_refused_by_its_key(fast: TestClient) -> None:
    answer = fast.post(CAPTURES, json={"fields": 5, "on_interruption": "wait"})
    assert answer.status_code == 422
    assert "on_interruption" in answer.text
