"""What an operator sets: in force at once, kept over restarts, not during a capture."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from grabberd.archive.capture.reader import CaptureReader
from grabberd.config import ThresholdConfig
from grabberd.documents.enums import Role
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service
from server.api.conftest import sealed, service_in
from server.api.gates import is_problem

SETTINGS = "/api/v1/settings"


def threshold(client: TestClient) -> dict[str, object]:
    found: dict[str, object] = client.get(SETTINGS).json()["devices"]["simulated"]
    return found


def level(client: TestClient) -> int:
    return int(client.get("/api/v1/devices/simulated").json()["ring"]["threshold"])


def test_the_configuration_is_in_force_until_something_is_set(idle: TestClient) -> None:
    assert threshold(idle)["as_configured"] is True


def test_what_is_set_is_in_force_at_once_and_can_be_taken_back(fast: TestClient) -> None:
    before = threshold(fast)
    order = {"threshold": {"kind": "fixed", "value": 77}}
    answer = fast.put(SETTINGS, json=order)
    assert answer.status_code == 200
    assert answer.json()["devices"]["simulated"] == {
        "threshold": {"kind": "fixed", "value": 77, "map": False},
        "as_configured": False,
    }
    assert level(fast) == 77
    assert fast.put(SETTINGS, json={"threshold": None}).json()["devices"]["simulated"] == before


def test_a_capture_is_made_and_described_with_it(fast: TestClient) -> None:
    fast.put(SETTINGS, json={"device": "simulated", "threshold": {"kind": "fixed", "value": 66}})
    capture_id = fast.post("/api/v1/captures", json={"fields": 5}).json()["id"]
    sealed(fast, capture_id)
    service: Service = fast.app.state.service  # type: ignore[attr-defined]
    with CaptureReader(service.archive.path(capture_id)) as reader:
        assert reader.meta.config["threshold"]["value"] == 66
        assert reader.field(0).numbered.packed.threshold == 66


def test_it_is_kept_over_a_restart(tmp_path: Path) -> None:
    first = service_in(tmp_path)
    first.open_stores()
    first.settings.set_threshold(first.instrument(None), _fixed(55))
    again = service_in(tmp_path)
    again.open_stores()
    assert again.instrument(None).pipeline.thresholds.in_force.level == 55
    assert again.settings.document().devices["simulated"].as_configured is False
    again.settings.set_threshold(again.instrument(None), None)
    once_more = service_in(tmp_path)
    once_more.open_stores()
    assert once_more.settings.document().devices["simulated"].as_configured is True


def _fixed(value: int) -> ThresholdConfig:
    return ThresholdConfig(kind="fixed", value=value)


def test_what_was_kept_and_cannot_be_used_is_left_and_said_so(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    service = service_in(tmp_path)
    service.open_stores()
    service.state_store.put({"threshold.simulated": {"kind": "of old"}})
    again = service_in(tmp_path)
    again.open_stores()
    assert again.settings.document().devices["simulated"].as_configured is True
    assert "cannot be used" in caplog.text


@pytest.mark.parametrize(
    "wrong",
    [{}, {"threshold": {"kind": "fixed"}}, {"threshold": {"kind": "automatic", "value": 3}}, {"light": 1}],
)
def test_what_makes_no_sense_is_refused(idle: TestClient, wrong: dict[str, object]) -> None:
    assert is_problem(idle.put(SETTINGS, json=wrong), 422, "bad-request")


def test_a_device_that_there_is_not_is_a_problem(idle: TestClient) -> None:
    answer = idle.put(SETTINGS, json={"device": "other", "threshold": None})
    assert is_problem(answer, 404, "not-found")


def test_it_is_not_changed_during_a_capture(paced: TestClient) -> None:
    capture_id = paced.post("/api/v1/captures", json={}).json()["id"]
    answer = paced.put(SETTINGS, json={"threshold": {"kind": "fixed", "value": 66}})
    assert is_problem(answer, 409, "capture-running")
    assert threshold(paced)["as_configured"] is True
    paced.post(f"/api/v1/captures/{capture_id}/stop")


def test_the_configuration_is_shown_to_an_admin_as_it_was_read(tmp_path: Path) -> None:
    service = service_in(tmp_path)
    service.access.open()
    client = TestClient(create_app(service), "http://localhost")
    assert client.get("/api/v1/config").status_code == 403
    headers = {"Authorization": f"Bearer {service.access.add('admin', Role.ADMIN)}"}
    device = client.get("/api/v1/config", headers=headers).json()["devices"]["simulated"]
    assert device["driver"] == "fake"
    assert device["ring"]["slots"] == 32
