"""A capture is replayed stretch by stretch, and its fields are marked."""

from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from running import wait_until_it_accepts

from grabberd.archive.export.page_documents import Stretch, replay_pictures, replay_points
from grabberd.server.api import create_app
from server.api.conftest import sealed, service_in

CAPTURES = "/api/v1/captures"


def marked(client: TestClient, capture_id: str, marks: Any) -> Any:
    answer = client.patch(f"{CAPTURES}/{capture_id}", json={"marks": marks})
    assert answer.status_code == 200, answer.json()
    assert client.get(f"{CAPTURES}/{capture_id}").json()["marks"] == answer.json()["marks"]
    return answer.json()["marks"]


def test_points_and_pictures_come_as_the_file_has_them(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    path = client.app.state.service.archive.path(capture_id)  # type: ignore[attr-defined]
    points = client.get(f"{CAPTURES}/{capture_id}/replay/points?first_n=5&count=10&run=1")
    assert points.content == replay_points(path, 1, Stretch(5, 15))
    pictures = client.get(f"{CAPTURES}/{capture_id}/replay/pictures?first_n=5&count=10")
    assert pictures.content == replay_pictures(path, Stretch(5, 15))
    assert {one.headers["content-type"] for one in (points, pictures)} == {"application/octet-stream"}


@pytest.mark.parametrize(
    ("query", "status"),
    [
        *(("points?count=0", 422), ("points?count=251", 422), ("points?first_n=-1", 422)),
        *(("points?run=7", 404), ("pictures?count=51", 422), ("pictures?first_n=x", 422)),
    ],
)
def test_what_cannot_be_meant_is_a_problem(kept: tuple[TestClient, str], query: str, status: int) -> None:
    client, capture_id = kept
    answer = client.get(f"{CAPTURES}/{capture_id}/replay/{query}")
    assert (answer.status_code, bool(answer.json()["hint"])) == (status, True)
    assert client.get(f"{CAPTURES}/nosuch/replay/{query.split('?', maxsplit=1)[0]}").status_code == 404


def test_fields_are_marked_renamed_and_unmarked_in_their_order(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    assert client.get(f"{CAPTURES}/{capture_id}").json()["marks"] == []
    marked(client, capture_id, {"12": " kick "})
    assert marked(client, capture_id, {"3": "closes"}) == [
        {"n": 3, "name": "closes"},
        {"n": 12, "name": "kick"},
    ]
    assert marked(client, capture_id, {"12": "slips", "3": None}) == [{"n": 12, "name": "slips"}]


def test_marks_leave_what_else_is_said(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    client.patch(f"{CAPTURES}/{capture_id}", json={"note": "good", "pinned": True})
    marked(client, capture_id, {"3": "closes"})
    client.patch(f"{CAPTURES}/{capture_id}", json={"labels": {"teat": "rear left"}})
    document = client.get(f"{CAPTURES}/{capture_id}").json()
    assert (document["note"], document["pinned"], len(document["marks"])) == ("good", True, 1)


def test_marks_outlive_the_daemon(tmp_path: Path) -> None:
    service = service_in(tmp_path, pace="free")
    with TestClient(create_app(service), "http://localhost") as client:
        wait_until_it_accepts(service)
        capture_id = client.post(CAPTURES, json={"fields": 5}).json()["id"]
        sealed(client, capture_id)
        marked(client, capture_id, {"4": "the last"})
    with TestClient(create_app(service_in(tmp_path, pace="free")), "http://localhost") as client:
        assert client.get(f"{CAPTURES}/{capture_id}").json()["marks"] == [{"n": 4, "name": "the last"}]


@pytest.mark.parametrize("marks", [{"x": "a"}, {"-1": "a"}, {"3": ""}, {"3": "a" * 201}, {"3": 4}, ["a"]])
def test_a_mark_that_cannot_be_meant_is_refused(kept: tuple[TestClient, str], marks: Any) -> None:
    client, capture_id = kept
    assert client.patch(f"{CAPTURES}/{capture_id}", json={"marks": marks}).status_code == 422


def test_a_field_that_is_not_there_cannot_be_marked(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    refused = client.patch(f"{CAPTURES}/{capture_id}", json={"marks": {"20": "beyond"}})
    assert refused.status_code == 422
    assert "no field 20" in refused.json()["detail"]


def test_marks_do_not_grow_without_end(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    many = {str(n): "a" for n in range(201)}
    assert client.patch(f"{CAPTURES}/{capture_id}", json={"marks": many}).status_code == 422
