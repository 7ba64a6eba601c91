"""What a real MQTT broker is told, whatever happens to it and to the daemon."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from brokers import broker, needs_mosquitto, receiver
from running import PATIENCE_S, configuration, sealed, wait_until_it_accepts

from archive.liner_tests import stored_test
from grabberd.config import MqttConfig, MqttTlsConfig, default_config_file, shipped_configs
from grabberd.documents.document import JobProblem
from grabberd.documents.enums import JobState
from grabberd.documents.jobs import JobDocument
from grabberd.documents.state import MqttDocument
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service
from grabberd_liner.guided_tests.documents import LinerTestResult
from grabberd_liner.part import liner_of

BARN = "Stall 3/Nord"
START = "grabberd/Stall%203%2FNord"


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A broker that comes back is found within a second."""
    pytest.importorskip("aiomqtt", reason="pip install 'grabberd[mqtt]'")
    monkeypatch.setattr("grabberd_mqtt.publisher.LONGEST_WAIT_S", 1.0)


@contextmanager
def publishing(folder: Path, port: int, **mqtt: Any) -> Iterator[Service]:
    """A service that has started, wherever the broker is."""
    config = configuration({"pace": "free"})
    known = MqttConfig(host=mqtt.pop("host", "127.0.0.1"), port=port, every_s=1, keepalive_s=5, **mqtt)
    storage = config.storage.model_copy(update={"directory": folder})
    config = config.model_copy(update={"mqtt": known, "storage": storage, "site": {"barn": BARN}})
    service = Service.from_config(config, set_up(config, default_config_file()))
    service.start()
    try:
        wait_until_it_accepts(service)
        yield service
    finally:
        service.stop()


def capture(service: Service, **labels: str) -> str:
    capture_id = service.capture_control.start(None, CaptureRequest(fields=5, labels=labels)).id
    sealed(service)
    return capture_id


def mqtt_of(service: Service) -> MqttDocument:
    mqtt = service.state().mqtt
    assert mqtt is not None
    return mqtt


def eventually(service: Service, wanted: Callable[[MqttDocument], bool]) -> None:
    """The daemon shows it of itself."""
    end_s = time.monotonic() + PATIENCE_S
    while not wanted(mqtt_of(service)):
        assert time.monotonic() < end_s, mqtt_of(service)
        time.sleep(0.05)


@needs_mosquitto
def test_states_are_retained_and_captures_are_summed_up(tmp_path: Path) -> None:
    with broker(tmp_path) as known, receiver(known.port) as first:
        with publishing(tmp_path / "state", known.port) as service:
            first.until(lambda: (first.latest("/online") or {}).get("online"))
            capture_id = capture(service, cow="1807")
            first.until(lambda: first.captures() == [capture_id])
            summary = first.latest(f"{START}/captures")
            assert summary is not None
            assert (summary["verdict"], summary["fields"], summary["duration_s"]) == ("complete", 5, 0.1)
            assert (summary["labels"], summary["site"]) == ({"cow": "1807"}, {"barn": BARN})
            calibration = service.state().devices["simulated"].calibration
            assert calibration is not None
            assert summary["calibration_id"] == calibration.id
            assert summary["size_bytes"] == (service.archive.directory / summary["file"]).stat().st_size
            first.until(lambda: first.latest("/simulated/state") is not None)
            eventually(service, lambda now: now.waiting_captures == 0 and now.acknowledged_captures == 1)
        first.until(lambda: (first.latest("/online") or {}).get("online") is False)
        with receiver(known.port, "later") as later:
            later.until(lambda: len(later.heard) == 2)
            assert {topic for topic, _, _ in later.heard} == {
                f"{START}/online",
                f"{START}/devices/simulated/state",
            }
            assert all(retained for _, _, retained in later.heard)


@needs_mosquitto
def test_the_latest_analysis_of_a_device_is_retained(tmp_path: Path) -> None:
    with broker(tmp_path) as known, receiver(known.port) as heard:
        with publishing(tmp_path / "state", known.port) as service:
            capture_id = capture(service)
            problem = JobProblem(message="the wall does not pulsate", hint="start the pulsator")
            service.jobs.refuse(capture_id, problem)
            liner_of(service).capture_analyses.note(capture_id)
            heard.until(lambda: heard.latest("/simulated/analysis") is not None)
        with receiver(known.port, "later") as later:
            later.until(lambda: later.latest("/simulated/analysis") is not None)
            message = later.latest(f"{START}/devices/simulated/analysis")
            assert message is not None
            assert (message["capture_id"], message["state"]) == (capture_id, "failed")
            assert (message["problem"], message["quantities"]) == (problem.message, {})


@needs_mosquitto
def test_so_is_its_latest_guided_test(tmp_path: Path) -> None:
    with broker(tmp_path) as known, receiver(known.port) as heard:
        with publishing(tmp_path / "state", known.port) as service:
            capture_id = capture(service)
            test_id = stored_test(liner_of(service).liner_tests.store)
            job = JobDocument(
                id=test_id,
                kind="test",
                subject=capture_id,
                state=JobState.DONE,
                created_utc="2026-03-01T09:40:00.000Z",
                progress=1.0,
                result=LinerTestResult(test=test_id, kind="ramp", verdict="passed", analyses=[1]),
            )
            liner_of(service).liner_tests.ended(job)
            heard.until(lambda: heard.latest("/simulated/test") is not None)
        with receiver(known.port, "later") as later:
            later.until(lambda: later.latest("/simulated/test") is not None)
            message = later.latest(f"{START}/devices/simulated/test")
            assert message is not None
            assert (message["capture_id"], message["test"], message["state"]) == (capture_id, test_id, "done")
            assert (message["kind"], message["liner"], message["verdict"]) == ("ramp", "A", "passed")
            assert message["quantities"] == {"touch_kpa": {"value": 12.38, "sigma": 0.21, "unit": "kPa"}}


@needs_mosquitto
def test_a_broker_that_is_killed_and_comes_back_misses_nothing(tmp_path: Path) -> None:
    with broker(tmp_path) as known, receiver(known.port) as heard:
        with publishing(tmp_path / "state", known.port) as service:
            made = [capture(service)]
            heard.until(lambda: set(heard.captures()) == set(made))
            eventually(service, lambda now: now.waiting_captures == 0)
            known.kill()
            made += [capture(service), capture(service)]
            eventually(service, lambda now: not now.connected and now.waiting_captures == 2)
            known.start()
            heard.until(lambda: set(heard.captures()) == set(made))
            eventually(service, lambda now: now.waiting_captures == 0)
            known.kill()
            made.append(capture(service))
            eventually(service, lambda now: now.waiting_captures == 1)
        known.start()
        with publishing(tmp_path / "state", known.port):
            heard.until(lambda: set(heard.captures()) == set(made))
        assert known.taken(f"{START}/captures") == len(made)  # what comes twice is the broker's own doing


@needs_mosquitto
def test_a_summary_whose_acknowledgement_was_lost_comes_twice_under_one_id(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with broker(tmp_path) as known, receiver(known.port) as heard:
        with publishing(tmp_path / "state", known.port) as service, monkeypatch.context() as killed:
            killed.setattr(
                "grabberd.archive.state.state_database.Outbox.acknowledge", lambda *_: known.kill()
            )
            capture_id = capture(service)
            heard.until(lambda: heard.captures() == [capture_id])
            eventually(service, lambda now: not now.connected)
        known.start()
        with publishing(tmp_path / "state", known.port) as service:
            heard.until(lambda: heard.captures() == [capture_id, capture_id])
            eventually(service, lambda now: now.waiting_captures == 0)


@needs_mosquitto
def test_it_never_subscribes(tmp_path: Path) -> None:
    with broker(tmp_path) as known, receiver(known.port) as heard:
        with publishing(tmp_path / "state", known.port) as service:
            capture_id = capture(service)
            heard.until(lambda: heard.captures() == [capture_id])
        subscribed = [line for line in known.log.splitlines() if "SUBSCRIBE" in line]
    assert any("receiver" in line for line in subscribed)  # the log would show it
    assert not any("grabberd-" in line for line in subscribed)
    assert "Received PUBLISH from grabberd-Stall%203%2FNord" in known.log


@needs_mosquitto
def test_a_broker_that_refuses_a_topic_is_not_taken_to_have_it(tmp_path: Path) -> None:
    (tmp_path / "acl").write_text(
        f"topic write {START}/online\ntopic write {START}/devices/#\ntopic read #\n"
    )
    with (
        broker(tmp_path, "allow_anonymous true", f"acl_file {tmp_path}/acl") as known,
        publishing(tmp_path / "state", known.port) as service,
    ):
        capture(service)
        eventually(service, lambda now: "refuses" in (now.problem or ""))
        assert (mqtt_of(service).waiting_captures, mqtt_of(service).acknowledged_captures) == (1, 0)


@needs_mosquitto
def test_home_assistant_discovers_the_device_until_that_is_turned_off(tmp_path: Path) -> None:
    start = "homeassistant/sensor/grabberd_Stall_203_2fNord_simulated"
    with broker(tmp_path) as known, receiver(known.port) as heard:
        with publishing(tmp_path / "state", known.port, home_assistant=True) as service:
            capture_id = capture(service)
            heard.until(lambda: (heard.latest("/simulated/capture") or {}).get("capture_id") == capture_id)
        with receiver(known.port, "home-assistant") as later:
            later.until(lambda: later.latest(f"{start}/last_verdict/config") is not None)
            told = later.latest(f"{start}/last_verdict/config") or {}
            assert told["state_topic"] == f"{START}/devices/simulated/capture"
            assert told["availability"][0]["topic"] == f"{START}/online"
            later.until(lambda: (later.latest("/simulated/capture") or {}).get("verdict") == "complete")
        with publishing(tmp_path / "state", known.port, home_assistant=False) as service:
            eventually(service, lambda now: now.connected)
            heard.until(lambda: heard.heard[-1][1] is not None and heard.latest("/capture") is None)
        with receiver(known.port, "much-later") as afterwards:
            afterwards.until(lambda: afterwards.latest("/simulated/state") is not None)
            afterwards.until(lambda: afterwards.latest("/online") is not None)
            assert not [topic for topic, _, _ in afterwards.heard if "homeassistant" in topic]
            assert afterwards.latest("/simulated/capture") is None


@needs_mosquitto
def test_without_it_nothing_is_told_to_home_assistant(tmp_path: Path) -> None:
    with broker(tmp_path) as known, receiver(known.port) as heard:
        with publishing(tmp_path / "state", known.port) as service:
            capture_id = capture(service)
            heard.until(lambda: heard.captures() == [capture_id])
        assert all(topic.startswith(START) for topic, _, _ in heard.heard)
        assert heard.latest("/simulated/capture") is None


@needs_mosquitto
def test_a_broker_that_refuses_discovery_is_told_the_rest(tmp_path: Path) -> None:
    (tmp_path / "acl").write_text(f"topic write {START}/#\ntopic read #\n")
    with (
        broker(tmp_path, "allow_anonymous true", f"acl_file {tmp_path}/acl") as known,
        receiver(known.port) as heard,
        publishing(tmp_path / "state", known.port, home_assistant=True) as service,
    ):
        capture_id = capture(service)
        heard.until(lambda: heard.captures() == [capture_id])
        eventually(service, lambda now: now.acknowledged_captures == 1)
        assert "refuses homeassistant/" in (mqtt_of(service).problem or "")


def made_certificates(folder: Path) -> None:
    """An authority of our own, and what it certifies: localhost."""
    script = """
    openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=authority \
        -addext keyUsage=critical,keyCertSign -keyout ca.key -out ca.pem
    openssl req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj /CN=localhost \
        -keyout broker.key -out broker.csr
    printf 'subjectAltName=DNS:localhost\\n' > names
    openssl x509 -req -in broker.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 \
        -extfile names -out broker.pem
    openssl req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj /CN=barn \
        -keyout barn.key -out barn.csr
    openssl x509 -req -in barn.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 -out barn.pem
    mosquitto_passwd -c -b passwords barn 'right; word'
    chmod 600 passwords
    """
    subprocess.run(["bash", "-ec", script], cwd=folder, check=True, capture_output=True, timeout=120)


@needs_mosquitto
def test_over_tls_with_certificate_and_password_the_right_one_is_let_in(tmp_path: Path) -> None:
    made_certificates(tmp_path)
    right, wrong = tmp_path / "right", tmp_path / "wrong"
    right.write_text("right; word\n")
    wrong.write_text("wrong\n")
    own = {"ca": tmp_path / "ca.pem", "certificate": tmp_path / "barn.pem", "key": tmp_path / "barn.key"}
    lines = (
        "allow_anonymous false",
        f"password_file {tmp_path}/passwords",
        f"certfile {tmp_path}/broker.pem",
        f"keyfile {tmp_path}/broker.key",
        f"cafile {tmp_path}/ca.pem",
        "require_certificate true",
    )
    with broker(tmp_path, *lines) as known:
        how: dict[str, Any] = {"host": "localhost", "user": "barn", "tls": MqttTlsConfig(**own)}
        with (
            receiver(known.port, tls=own, user="barn", password="right; word") as heard,
            publishing(tmp_path / "state", known.port, password_file=right, **how) as service,
        ):
            capture_id = capture(service)
            heard.until(lambda: heard.captures() == [capture_id])
        with publishing(tmp_path / "other", known.port, password_file=wrong, **how) as service:
            eventually(service, lambda now: "authori" in (now.problem or "").lower())
            assert not mqtt_of(service).connected


def test_a_broker_that_hangs_holds_nobody_up(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:  # takes connections, and never says a word
        port = silent.getsockname()[1]
        with publishing(tmp_path / "state", port) as service:
            capture(service)
            eventually(service, lambda now: now.waiting_captures == 1)
            assert not mqtt_of(service).connected
            connection, _ = silent.accept()
            began_s = time.monotonic()
        assert time.monotonic() - began_s < PATIENCE_S / 4
        with connection:
            connection.settimeout(PATIENCE_S)
            assert connection.recv(4096)[0] == 0x10  # it introduced itself,
            assert connection.recv(4096) == b""  # and has hung up


@needs_mosquitto
def test_a_broker_that_stops_answering_holds_nobody_up_and_gets_it_later(tmp_path: Path) -> None:
    with broker(tmp_path) as known, receiver(known.port) as heard:
        with publishing(tmp_path / "state", known.port) as service:
            eventually(service, lambda now: now.connected)
            known.signal(signal.SIGSTOP)
            capture_id = capture(service)
            eventually(service, lambda now: now.waiting_captures == 1)
            began_s = time.monotonic()
        assert time.monotonic() - began_s < PATIENCE_S / 4
        known.signal(signal.SIGCONT)
        with publishing(tmp_path / "state", known.port) as service:
            heard.until(lambda: set(heard.captures()) == {capture_id})
            eventually(service, lambda now: now.waiting_captures == 0)


@needs_mosquitto
@pytest.mark.slow
def test_a_daemon_that_is_killed_is_said_to_be_gone_by_its_last_will(tmp_path: Path) -> None:
    with broker(tmp_path) as known, receiver(known.port) as heard:
        config = yaml.safe_load(default_config_file().read_text())
        device = config["devices"]["simulated"]
        device["calibration"] = str(shipped_configs() / "fake.calibration.json")
        device["object"] = str(shipped_configs() / "objects" / "liner.yaml")
        config["mqtt"] = {"host": "127.0.0.1", "port": known.port}
        file = tmp_path / "barn.yaml"
        file.write_text(json.dumps(config))
        words = "from grabberd.cli import main; main()"
        command = [sys.executable, "-c", words, "serve", "--config", str(file), "--port", "0"]
        environment = {**os.environ, "STATE_DIRECTORY": str(tmp_path / "state")}
        with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as daemon:
            try:
                heard.until(lambda: (heard.latest("grabberd/simulated/online") or {}).get("online") is True)
            finally:
                daemon.send_signal(signal.SIGKILL)
        heard.until(lambda: (heard.latest("grabberd/simulated/online") or {}).get("online") is False)
