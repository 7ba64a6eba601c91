"""Channels over HTTP: live in the state, and those of captures as JSON and CSV."""

import csv
import io
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families
from running import PATIENCE_S, configuration, wait_until_it_accepts
from starlette.testclient import WebSocketDenialResponse

from grabberd.archive.capture.reader import CaptureReader
from grabberd.config import ChannelConfig, LocationConfig, LoggerConfig, default_config_file
from grabberd.instrument.channels.logger_setup import set_up_loggers
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service
from server.api.conftest import sealed

STREAM = "ws://localhost/api/v1/curves/stream"
VACUUM = LoggerConfig(
    driver="fake",
    options={"dating": "monotonic"},
    channels={
        "pulsation": ChannelConfig(column="pulsation", sigma_kpa=0.2),
        "liner": ChannelConfig(column="liner", sigma_kpa=0.2),
    },
)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    config = configuration({"pace": "real"}, location=LocationConfig(method="centroid"))
    config = config.model_copy(update={"loggers": {"tank": VACUUM}})
    file = default_config_file()
    folder = tmp_path_factory.mktemp("channels")
    service = Service(set_up(config, file), folder, loggers=set_up_loggers(config, file))
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        yield client


@pytest.fixture(scope="module")
def capture(client: TestClient) -> dict:
    made = client.post("/api/v1/captures", json={"fields": 50}).json()
    return sealed(client, made["id"])


def test_the_state_has_the_present_vacuum(client: TestClient) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while True:
        tank = client.get("/api/v1/state").json()["loggers"]["tank"]
        if tank["channels"]["liner"]["kpa"] is not None:
            break
        assert time.monotonic() < until_s, tank
    assert (tank["state"], tank["model"], tank["dating"]) == ("ready", "simulated logger", "monotonic")
    assert tank["channels"]["liner"]["kpa"] == pytest.approx(42.0, abs=0.5)
    assert tank["channels"]["liner"]["sigma_kpa"] == 0.2


def test_a_captures_description_has_a_verdict_of_its_channels_beside_that_of_its_fields(
    capture: dict,
) -> None:
    assert capture["channels"]["names"] == ["pulsation", "liner"]
    assert capture["channels"]["verdict"] in ("complete", "with gaps")
    assert capture["channels"]["in_words"].startswith(capture["channels"]["verdict"])


def test_its_channels_are_curves_on_the_time_axis_of_its_points(client: TestClient, capture: dict) -> None:
    document = client.get(f"/api/v1/captures/{capture['id']}/channels", params={"max_readings": 100}).json()
    pulsation, liner = document["channels"]
    assert (pulsation["quantity"], pulsation["logger"]) == ("pulsation", "tank")
    assert 50 < len(liner["kpa"]) <= 100
    assert liner["time_s"][0] < 0.0
    assert liner["time_s"][-1] > 0.98
    assert liner["kpa"][0] == pytest.approx(42.0, abs=1.0)


def test_all_readings_are_rows(client: TestClient, capture: dict) -> None:
    answer = client.get(f"/api/v1/captures/{capture['id']}/channels.csv")
    assert answer.headers["content-disposition"] == f'attachment; filename="{capture["id"]}-channels.csv"'
    found = list(csv.DictReader(io.StringIO(answer.text)))
    assert {one["channel"] for one in found} == {"pulsation", "liner"}
    assert len(found) > 2 * 150


def test_an_unknown_capture_has_no_channels(client: TestClient) -> None:
    assert client.get("/api/v1/captures/nothing/channels").status_code == 404


def test_a_capture_that_is_downloaded_has_its_channels(
    client: TestClient, capture: dict, tmp_path: Path
) -> None:
    path = tmp_path / "a.grab"
    path.write_bytes(client.get(f"/api/v1/captures/{capture['id']}/file").content)
    with CaptureReader(path) as reader:
        assert [one.name for one in reader.channels.all] == ["pulsation", "liner"]


def test_the_vacuum_and_the_walls_width_are_followed_on_one_clock(client: TestClient) -> None:
    with client.websocket_connect(f"{STREAM}?device=simulated") as socket:
        until_s = time.monotonic() + PATIENCE_S
        while not (curves := socket.receive_json())["channels"][1]["kpa"] or not curves["widths"]:
            assert time.monotonic() < until_s, curves
        later = socket.receive_json()
    pulsation, liner = curves["channels"]
    assert [pulsation["name"], liner["name"]] == ["pulsation", "liner"]
    assert liner["kpa"][-1] == pytest.approx(42.0, abs=0.5)
    assert all(curves["now_s"] - 2 < one <= curves["now_s"] + 0.02 for one in liner["time_s"])
    assert 0 < later["now_s"] - curves["now_s"] < 5
    assert set(later["time_s"]) & set(curves["time_s"])


def test_the_curves_of_a_device_that_there_is_not_are_refused(client: TestClient) -> None:
    with pytest.raises(WebSocketDenialResponse) as refused:
        client.websocket_connect(f"{STREAM}?device=other").__enter__()
    assert refused.value.status_code == 404


def test_a_logger_is_counted_and_its_channels_are_measured(client: TestClient) -> None:
    liner, until_s = ("grabberd_channel_kpa", "liner", "tank", "liner"), time.monotonic() + PATIENCE_S
    while True:
        families = text_string_to_metric_families(client.get("/metrics").text)
        samples = [one for family in families for one in family.samples]
        found = {(one.name, *one.labels.values()): one.value for one in samples}
        if liner in found:  # it is not there while a busy computer has no reading of the last half second
            break
        assert time.monotonic() < until_s, found
    assert found["grabberd_logger_state", "tank", "ready"] == 1
    assert found["grabberd_logger_state", "tank", "absent"] == 0
    assert found["grabberd_logger_openings_total", "tank"] == 1
    assert found["grabberd_logger_readings_total", "tank"] > 50
    assert found["grabberd_logger_lost_readings_total", "tank"] >= 0
    assert 0 <= found["grabberd_logger_reading_age_seconds", "tank"] < 5
    assert found[liner] == pytest.approx(42.0, abs=0.5)
