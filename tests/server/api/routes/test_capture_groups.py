"""Captures of several devices together, over HTTP."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from several import UNPLUGGED, sealed_all, service_of, wait_until_they_accept

from grabberd.server.api import create_app

GROUPS = "/api/v1/capture-groups"
CAPTURES = "/api/v1/captures"
PACED: dict[str, Any] = {"left": {"pace": "real"}, "right": {"pace": "real", "seed": 2}}


@pytest.fixture
def fast(tmp_path: Path) -> Iterator[TestClient]:
    """Two devices, whose captures are over in no time."""
    yield from client_of(tmp_path, {"left": {}, "right": {"seed": 2}})


@pytest.fixture
def paced(tmp_path: Path) -> Iterator[TestClient]:
    """Two devices, whose captures last as long as they last."""
    yield from client_of(tmp_path, PACED)


@pytest.fixture
def half(tmp_path: Path) -> Iterator[TestClient]:
    """Two devices, of which one is not there."""
    yield from client_of(tmp_path, {"left": {}, "right": UNPLUGGED}, "left")


def client_of(folder: Path, devices: dict[str, Any], *accepting: str) -> Iterator[TestClient]:
    service = service_of(folder, devices)
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_they_accept(service, *accepting)
        yield client


def sealed(client: TestClient, group_id: str) -> Any:
    sealed_all(client.app.state.service)  # type: ignore[attr-defined]
    return client.get(f"{GROUPS}/{group_id}").json()


def test_a_group_is_started_and_can_be_found_where_the_answer_says(fast: TestClient) -> None:
    answer = fast.post(GROUPS, json={"devices": "all", "fields": 5, "labels": {"cow": "112"}})
    assert answer.status_code == 202
    group = sealed(fast, answer.json()["id"])
    assert fast.get(answer.headers["Location"]).json() == group
    assert group["devices"] == ["left", "right"]
    assert [(one["device"], one["verdict"], one["labels"]) for one in group["captures"]] == [
        ("left", "complete", {"cow": "112"}),
        ("right", "complete", {"cow": "112"}),
    ]


def test_each_capture_says_of_which_group_it_is_and_when_that_began(fast: TestClient) -> None:
    group = fast.post(GROUPS, json={"fields": 5}).json()
    own = {key: group[key] for key in ("id", "devices", "start_utc", "start_ns")}
    sealed(fast, group["id"])
    for capture in group["captures"]:
        document = fast.get(f"{CAPTURES}/{capture['id']}").json()
        assert document["group"] == own
        assert document["created_utc"] == own["start_utc"]


def test_labels_may_be_of_single_devices(fast: TestClient) -> None:
    labels_of = {"left": {"teat": "front left"}, "right": {"teat": "front right", "cow": "113"}}
    order = {"fields": 5, "labels": {"cow": "112"}, "labels_of": labels_of}
    group = sealed(fast, fast.post(GROUPS, json=order).json()["id"])
    assert [one["labels"] for one in group["captures"]] == [
        {"cow": "112", "teat": "front left"},
        {"cow": "113", "teat": "front right"},
    ]
    assert fast.post(GROUPS, json={"devices": ["left"], "labels_of": labels_of}).status_code == 404


def test_a_refusal_says_of_each_device_why_and_nothing_begins(half: TestClient) -> None:
    refused = half.post(GROUPS, json={"fields": 5})
    assert refused.status_code == 409
    assert refused.headers["content-type"] == "application/problem+json"
    (refusal,) = refused.json()["refusals"]
    assert refusal["device"] == "right"
    assert refusal["type"] == "urn:grabberd:problem:not-ready"
    assert refusal["detail"] in refused.json()["detail"]
    assert refusal["hint"]
    assert half.get(CAPTURES).json()["captures"] == []
    assert half.post(GROUPS, json={"devices": ["left"], "fields": 5}).status_code == 202


def test_a_refusal_names_the_capture_that_runs(paced: TestClient) -> None:
    running = paced.post(CAPTURES, json={"device": "right"}).json()["id"]
    (refusal,) = paced.post(GROUPS, json={}).json()["refusals"]
    assert (refusal["device"], refusal["capture_id"]) == ("right", running)


def test_an_order_with_a_key_takes_effect_once_for_all_of_them(paced: TestClient) -> None:
    headers = {"Idempotency-Key": "one"}
    first, again = (paced.post(GROUPS, json={"fields": 500}, headers=headers) for _ in range(2))
    assert (again.status_code, again.headers["Idempotent-Replayed"]) == (202, "true")
    assert again.json() == first.json()
    assert again.headers["Location"] == first.headers["Location"]
    assert len(paced.get(CAPTURES).json()["captures"]) == 2


def test_a_group_is_armed_triggered_and_stopped_as_one(paced: TestClient) -> None:
    group = paced.post(GROUPS, json={"armed": True, "pre_trigger_fields": 3}).json()
    assert group["start_utc"] is None
    assert {one["state"] for one in group["captures"]} == {"armed"}
    devices = paced.get("/api/v1/state").json()["devices"]
    assert {one["group_id"] for one in devices.values()} == {group["id"]}
    triggered = paced.post(f"{GROUPS}/{group['id']}/trigger")
    assert triggered.status_code == 202
    assert {one["state"] for one in triggered.json()["captures"]} == {"recording"}
    assert paced.post(f"{GROUPS}/{group['id']}/stop").status_code == 202
    assert {one["state"] for one in sealed(paced, group["id"])["captures"]} == {"sealed"}
    devices = paced.get("/api/v1/state").json()["devices"]
    assert {one["group_id"] for one in devices.values()} == {None}
    for what in ("stop", "trigger"):
        assert paced.post(f"{GROUPS}/{group['id']}/{what}").status_code == 409


def test_the_trigger_of_one_armed_capture_is_that_of_all_its_group(paced: TestClient) -> None:
    group = paced.post(GROUPS, json={"armed": True, "post_trigger_fields": 5}).json()
    assert paced.post(f"{CAPTURES}/{group['id']}-left/trigger").status_code == 202
    assert {one["state"] for one in sealed(paced, group["id"])["captures"]} == {"sealed"}


def test_stopping_armed_ones_leaves_nothing(paced: TestClient) -> None:
    group_id = paced.post(GROUPS, json={"armed": True}).json()["id"]
    stopped = paced.post(f"{GROUPS}/{group_id}/stop")
    assert {one["state"] for one in stopped.json()["captures"]} == {"disarmed"}
    assert paced.get(f"{GROUPS}/{group_id}").status_code == 404
    assert paced.get(CAPTURES).json()["captures"] == []


@pytest.mark.parametrize(
    ("order", "status"),
    [
        ({"devices": []}, 422),
        ({"devices": "some"}, 422),
        ({"device": "left"}, 422),
        ({"fields": 5, "duration_s": 1}, 422),
        ({"devices": ["left", "middle"]}, 404),
        ({"pre_trigger_fields": 33}, 409),
    ],
)
def test_what_cannot_be_done_is_refused(fast: TestClient, order: Any, status: int) -> None:
    refused = fast.post(GROUPS, json=order)
    assert refused.status_code == status
    assert refused.json()["hint"]
    assert fast.get(CAPTURES).json()["captures"] == []


def test_there_is_no_group_of_another_id(fast: TestClient) -> None:
    for answer in (
        fast.get(f"{GROUPS}/20200101T000000000Z"),
        fast.post(f"{GROUPS}/20200101T000000000Z/stop"),
        fast.post(f"{GROUPS}/20200101T000000000Z/trigger"),
    ):
        assert answer.status_code == 404
