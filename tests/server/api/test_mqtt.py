"""How the publisher shows over HTTP, and that a broker that is away is nobody's trouble."""

import socket
import time
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from running import PATIENCE_S, configuration, wait_until_it_accepts

from grabberd.config import MqttConfig, default_config_file
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service
from server.api.conftest import sealed
from server.api.routes.test_metrics import metrics


def test_captures_that_wait_for_the_broker_are_shown_and_counted(tmp_path: Path) -> None:
    pytest.importorskip("aiomqtt", reason="pip install 'grabberd[mqtt]'")
    config = configuration({"pace": "free"})
    storage = config.storage.model_copy(update={"directory": tmp_path})
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))  # and does not listen
        mqtt = MqttConfig(host="127.0.0.1", port=nobody.getsockname()[1])
        config = config.model_copy(update={"mqtt": mqtt, "storage": storage})
        service = Service.from_config(config, set_up(config, default_config_file()))
        with TestClient(create_app(service), "http://localhost") as client:
            wait_until_it_accepts(service)
            sealed(client, client.post("/api/v1/captures", json={"fields": 5}).json()["id"])
            end_s = time.monotonic() + PATIENCE_S
            while client.get("/api/v1/state").json()["mqtt"]["waiting_captures"] != 1:
                assert time.monotonic() < end_s
                time.sleep(0.05)
            shown = client.get("/api/v1/state").json()["mqtt"]
            assert (shown["connected"], shown["acknowledged_captures"]) == (False, 0)
            assert "Connection refused" in shown["problem"]
            found = metrics(client)
            assert found["grabberd_mqtt_connected",] == 0
            assert found["grabberd_mqtt_waiting_captures",] == 1
            assert found["grabberd_mqtt_missed_captures_total",] == 0


def test_without_a_broker_there_is_nothing_to_show(idle: TestClient) -> None:
    assert idle.get("/api/v1/state").json()["mqtt"] is None
    assert not [name for name, *_ in metrics(idle) if "mqtt" in name]
