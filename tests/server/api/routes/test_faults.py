"""What is wrong with the daemon itself, as its clients see it."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from grabberd.archive.capture import writer
from grabberd.archive.state.capture_index import IndexKeeper
from grabberd.errors import Cause, IndexRebuilding, StorageError
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.server.daemon.service import Service


@pytest.fixture
def service(fast: TestClient) -> Service:
    started: Service = fast.app.state.service  # type: ignore[attr-defined]
    started.upkeep.stop()
    return started


def test_a_daemon_in_order_has_none(fast: TestClient) -> None:
    assert fast.get("/api/v1/state").json()["faults"] == []


def test_the_state_and_the_readiness_say_what_is_lost_and_from_when_the_rest_is(
    fast: TestClient, service: Service, tmp_path: Path
) -> None:
    (tmp_path / "state.sqlite").write_bytes(b"garbage " * 2000)
    (fault,) = fast.get("/api/v1/state").json()["faults"]
    assert fault["cause_code"] == "settings_restored"
    assert fault["level"] == "warning"
    assert "grabberd storage accept" in fault["hint"]
    assert fast.get("/readyz").json()["faults"] == [fault]
    assert fast.post("/api/v1/captures", json={"fields": 5}).status_code == 202


@pytest.mark.parametrize("fate", ["sealed later", "given up"])
def test_a_capture_is_counted_once_by_the_verdict_of_the_seal_that_holds(
    fast: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, fate: str
) -> None:
    def refuse(_: Path) -> Path:
        raise StorageError("it cannot be renamed", "wait")

    def counted() -> list[int]:
        ended = service.instrument(None).captures.ended
        return [ended["complete"], ended["incomplete"]]

    with monkeypatch.context() as patch:
        patch.setattr(writer, "publish", refuse)
        service.capture_control.start(None, CaptureRequest(fields=5))
        recording = service.instrument(None).captures.recording
        assert recording
        assert recording.sealed.wait(30)
    assert counted() == [0, 0]
    if fate == "given up":
        recording.path.unlink()
    service.unsealed._due_ns = 0
    service.unsealed.retry()
    assert service.unsealed.captures == ()
    assert counted() == ([1, 0] if fate == "sealed later" else [0, 1])


def test_a_folder_that_is_gone_is_a_problem_with_a_hint_on_every_route(
    captured: tuple[TestClient, str], tmp_path: Path
) -> None:
    client, capture_id = captured
    client.app.state.service.upkeep.stop()  # type: ignore[attr-defined]
    (tmp_path / "captures").rename(tmp_path / "away")
    capture = f"/api/v1/captures/{capture_id}"
    for path in (
        "/api/v1/captures",
        capture,
        *(f"{capture}/{part}" for part in ("file", "points", "points.csv")),
    ):
        answer = client.get(path)
        assert answer.status_code == 507, path
        assert "is gone" in answer.json()["detail"]
        assert "put it back" in answer.json()["hint"]
    for answer in (
        client.post("/api/v1/captures", json={"fields": 5}),
        client.patch(capture, json={"pinned": True}),
        client.delete(capture),
    ):
        assert answer.status_code == 507
    state = client.get("/api/v1/state").json()
    assert state["storage"]["cause_code"] == "captures_missing"
    assert [fault["cause_code"] for fault in state["faults"]] == ["captures_missing"]
    (tmp_path / "away").rename(tmp_path / "captures")
    assert client.get(capture).status_code == 200


def test_while_the_index_is_rebuilt_clients_are_told_to_ask_again(
    fast: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(*_: object) -> None:
        raise IndexRebuilding("3 of 12 have been read", "ask again", Cause.INDEX_REBUILDING)

    with monkeypatch.context() as patch:
        patch.setattr(IndexKeeper, "heal", slow)  # first, as the daemon itself notices what is gone
        service.archive.index.path.unlink()
        answer = fast.get("/api/v1/captures")
        assert answer.status_code == 503
        assert answer.json()["type"].endswith("index-rebuilding")
    assert fast.get("/api/v1/captures").status_code == 200


def test_faults_are_counted_for_prometheus(fast: TestClient, service: Service, tmp_path: Path) -> None:
    garbage = tmp_path / "garbage"
    garbage.write_bytes(b"garbage " * 2000)
    garbage.replace(service.archive.index.path)  # at once: the daemon would also notice half of it
    fast.get("/api/v1/captures")
    lines = fast.get("/metrics").text.splitlines()
    assert "grabberd_index_rebuilds_total 1.0" in lines
    assert 'grabberd_faults_total{cause="index_rebuilding"} 1.0' in lines
    assert 'grabberd_fault{cause="index_rebuilding"} 0.0' in lines
    assert "grabberd_unsealed_captures 0.0" in lines
