"""Captures are pinned, spoken of and deleted."""

from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from running import wait_until_it_accepts

from grabberd.archive.capture.reader import CaptureReader
from grabberd.server.api import create_app
from server.api.conftest import sealed, service_in

CAPTURES = "/api/v1/captures"


def patched(client: TestClient, capture_id: str, patch: Any) -> Any:
    answer = client.patch(f"{CAPTURES}/{capture_id}", json=patch)
    assert answer.status_code == 200, answer.json()
    assert answer.json()["note"] == client.get(f"{CAPTURES}/{capture_id}").json()["note"]
    return answer.json()


def test_only_what_is_given_changes(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    before = client.get(f"{CAPTURES}/{capture_id}").json()
    assert before["pinned"] is False
    assert patched(client, capture_id, {}) == before
    assert patched(client, capture_id, {"note": "liner slipped"}) == before | {"note": "liner slipped"}
    assert patched(client, capture_id, {"pinned": True})["note"] == "liner slipped"
    labels = patched(client, capture_id, {"labels": {"teat": "front left", "cow": None}})["labels"]
    assert labels == {"teat": "front left"}


def test_the_file_stays_as_it_was_recorded(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    path = client.app.state.service.archive.path(capture_id)  # type: ignore[attr-defined]
    before = path.read_bytes()
    patched(client, capture_id, {"note": "other", "labels": {"cow": "7"}, "pinned": True})
    assert path.read_bytes() == before
    with CaptureReader(path) as reader:
        assert reader.meta.labels == {"cow": "112"}


def test_what_is_said_outlives_the_daemon(tmp_path: Path) -> None:
    service = service_in(tmp_path, pace="free")
    with TestClient(create_app(service), "http://localhost") as client:
        wait_until_it_accepts(service)
        capture_id = client.post(CAPTURES, json={"fields": 5}).json()["id"]
        sealed(client, capture_id)
        patched(client, capture_id, {"note": "good", "pinned": True})
    with TestClient(create_app(service_in(tmp_path, pace="free")), "http://localhost") as client:
        document = client.get(f"{CAPTURES}/{capture_id}").json()
        assert (document["note"], document["pinned"]) == ("good", True)


def test_a_running_capture_can_be_spoken_of(paced: TestClient) -> None:
    capture_id = paced.post(CAPTURES, json={}).json()["id"]
    assert patched(paced, capture_id, {"note": "restless"})["state"] == "recording"


@pytest.mark.parametrize("patch", [{"note": 3}, {"state": "sealed"}, {"labels": {"cow": 3}}, []])
def test_what_cannot_be_meant_is_refused(kept: tuple[TestClient, str], patch: Any) -> None:
    client, capture_id = kept
    assert client.patch(f"{CAPTURES}/{capture_id}", json=patch).status_code == 422


def test_labels_do_not_grow_without_end(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    patched(client, capture_id, {"labels": {f"label {i}": "" for i in range(31)}})
    refused = client.patch(f"{CAPTURES}/{capture_id}", json={"labels": {"one": "more"}})
    assert refused.status_code == 422
    assert "33 labels" in refused.json()["detail"]


def test_a_deleted_capture_is_gone_with_its_file(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    path = client.app.state.service.archive.path(capture_id)  # type: ignore[attr-defined]
    patched(client, capture_id, {"note": "bad"})
    assert client.delete(f"{CAPTURES}/{capture_id}").status_code == 204
    assert not path.exists()
    assert client.get(f"{CAPTURES}/{capture_id}").status_code == 404
    assert client.get(CAPTURES).json()["captures"] == []
    assert client.delete(f"{CAPTURES}/{capture_id}").status_code == 404


def test_a_pinned_capture_is_not_deleted_until_it_is_unpinned(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    patched(client, capture_id, {"pinned": True})
    refused = client.delete(f"{CAPTURES}/{capture_id}")
    assert refused.status_code == 409
    assert "unpin" in refused.json()["hint"]
    patched(client, capture_id, {"pinned": False})
    assert client.delete(f"{CAPTURES}/{capture_id}").status_code == 204


def test_a_running_capture_is_not_deleted(paced: TestClient) -> None:
    capture_id = paced.post(CAPTURES, json={}).json()["id"]
    refused = paced.delete(f"{CAPTURES}/{capture_id}")
    assert (refused.status_code, paced.get(f"{CAPTURES}/{capture_id}").status_code) == (409, 200)


def test_one_that_a_job_works_on_is_not_deleted(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    # It stays in the queue, however long this test waits for a processor.
    client.app.state.service.job_runner.stop()  # type: ignore[attr-defined]
    job = client.post(f"{CAPTURES}/{capture_id}/measure").json()["id"]
    refused = client.delete(f"{CAPTURES}/{capture_id}")
    assert refused.status_code == 409
    assert job in refused.json()["hint"]
    client.delete(f"/api/v1/jobs/{job}")
    assert client.delete(f"{CAPTURES}/{capture_id}").status_code == 204


def test_a_file_removed_by_hand_hides_no_other(captured: tuple[TestClient, str]) -> None:
    client, first = captured
    second = client.post(CAPTURES, json={"fields": 5}).json()["id"]
    sealed(client, second)
    client.app.state.service.archive.path(first).unlink()  # type: ignore[attr-defined]
    assert [one["id"] for one in client.get(CAPTURES).json()["captures"]] == [second]
