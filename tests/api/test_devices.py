"""The devices, and whether they can measure."""

from dataclasses import replace
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.conftest import service_in
from api.gates import is_problem
from grabberd.acquisition import Signal
from grabberd.api import create_app
from grabberd.service.instrument import Instrument
from grabberd.service.states import DeviceState


def instrument_of(client: TestClient) -> Instrument:
    instrument: Instrument = client.app.state.service.instrument(None)  # type: ignore[attr-defined]
    return instrument


@pytest.fixture
def still(tmp_path: Path) -> TestClient:
    """Over a service that has not been started: nothing changes by itself."""
    service = service_in(tmp_path)
    service.access.open()
    return TestClient(create_app(service), "http://localhost")


def test_all_devices_are_listed(idle: TestClient) -> None:
    devices = idle.get("/api/v1/devices").json()["devices"]
    assert [device["name"] for device in devices] == ["simulated"]
    assert devices[0]["state"] == idle.get("/api/v1/devices/simulated").json()["state"]


def test_a_device_that_there_is_not_is_a_problem(idle: TestClient) -> None:
    assert is_problem(idle.get("/api/v1/devices/other"), 404, "not-found")


def test_a_device_that_streams_with_signal_and_calibration_is_ready(idle: TestClient) -> None:
    answer = idle.get("/readyz")
    assert (answer.status_code, answer.json()) == (200, {"status": "ready"})


def test_one_that_is_away_is_not_and_says_why(still: TestClient) -> None:
    instrument_of(still).board.enter(DeviceState.ABSENT, "the grabber is unplugged", "plug it in")
    answer = still.get("/readyz")
    assert is_problem(answer, 503, "not-ready")
    assert answer.json()["lacks"] == [
        {
            "device": "simulated",
            "lacks": "device",
            "message": "it is absent: the grabber is unplugged",
            "hint": "plug it in",
        }
    ]


def test_nor_is_one_without_a_signal(still: TestClient) -> None:
    board = instrument_of(still).board
    board.enter(DeviceState.OPENING)
    board.enter(DeviceState.NO_SIGNAL, "the camera gives no signal", "check the cable")
    board.saw_signal(Signal.ABSENT)
    lacks = still.get("/readyz").json()["lacks"]
    assert [(lack["lacks"], lack["hint"]) for lack in lacks] == [("signal", "check the cable")]


def test_nor_is_one_without_a_calibration_or_an_object_model(fast: TestClient) -> None:
    instrument = instrument_of(fast)
    setup = instrument.setup
    for missing in ("calibration", "object"):
        instrument.setup = replace(setup, documents={**setup.documents, missing: None})
        lacks = fast.get("/readyz").json()["lacks"]
        assert [lack["lacks"] for lack in lacks] == ["calibration"]
        assert lacks[0]["hint"]


def test_head_answers_as_get_does_without_a_body(idle: TestClient) -> None:
    for path in ("/healthz", "/readyz", "/api/v1/devices", "/api/v1/openapi.json", "/api/v1/captures/none"):
        head, get = idle.head(path), idle.get(path)
        assert (head.status_code, head.content) == (get.status_code, b""), path
        assert head.headers["content-type"] == get.headers["content-type"]


def test_head_changes_nothing_where_there_is_no_get(idle: TestClient) -> None:
    assert idle.head("/api/v1/captures/none/stop").status_code == 405
