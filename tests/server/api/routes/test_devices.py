"""The devices, and whether they can measure."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from grabberd.documents.enums import DeviceState
from grabberd.errors import Cause
from grabberd.instrument.acquisition import Signal
from grabberd.instrument.instrument import Instrument
from grabberd.server.api import create_app
from server.api.conftest import service_in
from server.api.gates import is_problem


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


def test_a_device_says_how_its_picture_is_lit_view_by_view(paced: TestClient) -> None:
    light = paced.get("/api/v1/devices/simulated/light").json()
    assert list(light["views"]) == ["left", "right"]
    for view in light["views"].values():
        assert sum(view["histogram"]) == 288 * 360
        assert view["targets"] > 20
        assert 3 < view["diameter_px"] < 12


def test_another_threshold_may_be_tried_without_setting_it(paced: TestClient) -> None:
    light = paced.get("/api/v1/devices/simulated/light", params={"threshold": 254}).json()
    assert (light["threshold"], light["views"]["left"]["targets"]) == (254, 0)
    assert paced.get("/api/v1/settings").json()["devices"]["simulated"]["as_configured"]


def test_a_device_without_fields_says_so_instead(still: TestClient) -> None:
    assert is_problem(still.get("/api/v1/devices/simulated/light"), 409, "not-ready")


def test_a_device_says_which_capture_is_armed_and_what_it_lacks(paced: TestClient) -> None:
    before = paced.get("/api/v1/devices/simulated").json()
    assert before["armed_capture_id"] is None
    # A busy computer may lose fields, which is a lack as well.
    assert not {"device", "signal", "calibration"} & {one["lacks"] for one in before["lacks"]}
    capture_id = paced.post("/api/v1/captures", json={"armed": True}).json()["id"]
    assert paced.get("/api/v1/devices/simulated").json()["armed_capture_id"] == capture_id


def test_a_device_shows_its_views_and_how_full_its_ring_is(idle: TestClient) -> None:
    device = idle.get("/api/v1/devices/simulated").json()
    assert device["views"]["right"] == {"first_column": 360, "end_column": 720}
    assert 0 <= device["ring"]["waiting"] <= device["ring"]["slots"]


def test_a_device_that_streams_with_signal_and_calibration_is_ready(idle: TestClient) -> None:
    answer = idle.get("/readyz")
    assert (answer.status_code, answer.json()) == (200, {"status": "ready", "faults": []})


def test_one_that_is_away_is_not_and_says_why(still: TestClient) -> None:
    instrument_of(still).board.enter(
        DeviceState.ABSENT, "the grabber is unplugged", "plug it in", Cause.DEVICE_LOST
    )
    answer = still.get("/readyz")
    assert is_problem(answer, 503, "not-ready")
    of_the_device, of_the_disk = answer.json()["lacks"]  # a daemon that has not started has no folder either
    assert of_the_device == {
        "device": "simulated",
        "lacks": "device",
        "message": "it is absent: the grabber is unplugged",
        "hint": "plug it in",
        "cause_code": "device_lost",
    }
    assert (of_the_disk["lacks"], of_the_disk["cause_code"]) == ("disk", "disk_missing")
    assert still.get("/api/v1/devices/simulated").json()["cause_code"] == "device_lost"


def test_nor_is_one_without_a_signal(still: TestClient) -> None:
    board = instrument_of(still).board
    board.enter(DeviceState.OPENING)
    board.enter(DeviceState.NO_SIGNAL, "the camera gives no signal", "check the cable")
    board.saw_signal(Signal.ABSENT)
    lacks = still.get("/readyz").json()["lacks"]
    assert (lacks[0]["lacks"], lacks[0]["hint"]) == ("signal", "check the cable")


def test_nor_is_one_without_a_calibration_or_an_object_model(fast: TestClient) -> None:
    instrument = instrument_of(fast)
    setup = instrument.setup
    for missing, code in (("calibration", "no_calibration"), ("object", "no_object")):
        instrument.captures.setup = replace(setup, documents={**setup.documents, missing: None})
        lacks = fast.get("/readyz").json()["lacks"]
        assert [(lack["lacks"], lack["cause_code"]) for lack in lacks] == [("calibration", code)]
        assert lacks[0]["hint"]


def test_head_answers_as_get_does_without_a_body(idle: TestClient) -> None:
    for path in ("/healthz", "/readyz", "/api/v1/devices", "/api/v1/openapi.json", "/api/v1/captures/none"):
        head, get = idle.head(path), idle.get(path)
        assert (head.status_code, head.content) == (get.status_code, b""), path
        assert head.headers["content-type"] == get.headers["content-type"]


def test_head_changes_nothing_where_there_is_no_get(idle: TestClient) -> None:
    assert idle.head("/api/v1/captures/none/stop").status_code == 405


def test_the_newest_points_can_be_asked_for(paced: TestClient) -> None:
    instrument = instrument_of(paced)
    with instrument.worker.published:
        assert instrument.worker.published.wait_for(lambda: instrument.worker.live is not None, 20)
    document = paced.get("/api/v1/devices/simulated/points").json()
    columns = {len(values) for values in document.values() if isinstance(values, list)}
    assert len(columns) == 1
    assert columns.pop() > 50
    age = datetime.now(UTC) - datetime.fromisoformat(document["utc"])
    assert timedelta(0) < age < timedelta(minutes=1)  # however busy the computer is


def test_before_the_first_there_are_none(still: TestClient) -> None:
    assert is_problem(still.get("/api/v1/devices/simulated/points"), 409, "not-ready")


def test_what_is_measured_is_known_target_by_target(idle: TestClient) -> None:
    document = idle.get("/api/v1/devices/simulated/object").json()
    assert (document["name"], len(document["target"])) == ("liner", 108)
    assert (max(document["row"]), max(document["column"])) == (17, 5)


def test_a_device_without_an_object_model_says_so(still: TestClient) -> None:
    instrument = instrument_of(still)
    instrument.captures.setup = replace(instrument.setup, documents={"calibration": None, "object": None})
    assert is_problem(still.get("/api/v1/devices/simulated/object"), 404, "not-found")


def test_the_newest_field_says_what_each_view_shows_and_how_wide_the_liner_is(paced: TestClient) -> None:
    worker = instrument_of(paced).worker
    with worker.published:
        assert worker.published.wait_for(lambda: worker.live is not None and len(worker.live[0].points), 20)
    live = paced.get("/api/v1/devices/simulated").json()["live"]
    assert set(live["views"]) == {"left", "right"}
    assert live["points"] <= min(live["views"].values()) <= live["blobs"]
    assert [width["targets"] for width in live["widths"]] == [[49, 54], [50, 53], [51, 52]]
    inner = live["widths"][-1]
    assert 5 < inner["width_mm"] < 9
    assert 0 < inner["sigma_mm"] < 0.5
