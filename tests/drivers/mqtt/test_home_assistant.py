"""What Home Assistant is told, and what it makes of that."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
from jinja2 import Environment
from running import running

from grabberd.documents.captures import CaptureDocument
from grabberd.documents.examples import CAPTURE
from grabberd_mqtt.home_assistant import ENTITIES, discovery
from grabberd_mqtt.messages import LAST_CAPTURE, STATE, Message, Topics, capture_summary, device_state

BARN = "Stall 3/Nord"
PEER = Path(__file__).with_name("home_assistant_peer.py")
HOME_ASSISTANT = os.environ.get("HOME_ASSISTANT_PYTHON")
needs_home_assistant = pytest.mark.skipif(
    HOME_ASSISTANT is None,
    reason="HOME_ASSISTANT_PYTHON is not set: the Python of an environment with homeassistant and paho-mqtt",
)


def discovered(barn: str = BARN, device: str = "north") -> list[Message]:
    return list(discovery("homeassistant", Topics("grabberd", barn), barn, device, "v4l2"))


def contents() -> dict[str, dict[str, Any]]:
    """The messages by their objects."""
    return {message.topic.split("/")[3]: message.content or {} for message in discovered()}


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What the daemon says on the topics that the entities take their values from."""
    with running(tmp_path_factory.mktemp("state")) as service:
        now = service.state()
    state = device_state(now.devices["simulated"], now.storage)
    state = state.model_copy(update={"health": "bad", "health_part": "rate", "rate_hz": None})
    capture = CaptureDocument.model_validate(CAPTURE)
    summary = capture_summary(capture, file="a.grab", site={}, rate_hz=50.0, calibration_id=None)
    topics, said = Topics("grabberd", BARN), {STATE: state, LAST_CAPTURE: summary}
    made = [topics.message(topic, one, device="north") for topic, one in said.items()]
    return {message.topic: message.content or {} for message in made}


EXPECTED = {
    "health": "bad",
    "problem": "ON",
    "capturing": "OFF",
    "rate": "None",  # by which Home Assistant understands that it is unknown
    "fields_lost": "0",
    "last_capture": "2026-03-01T09:30:00.125Z",
    "last_verdict": "incomplete",
}


def test_every_entity_is_told_once_and_retained() -> None:
    topics = [message.topic for message in discovered()]
    assert len(set(topics)) == len(topics) == len(ENTITIES)
    assert topics[0] == "homeassistant/sensor/grabberd_Stall_203_2fNord_north/health/config"
    assert all(message.retained for message in discovered())


@pytest.mark.parametrize(("one", "other"), [(("a", "b_c"), ("a_b", "c")), (("a b", "c"), ("a_20b", "c"))])
def test_devices_of_different_names_are_different_devices(
    one: tuple[str, str], other: tuple[str, str]
) -> None:
    ids = [{(message.content or {})["unique_id"] for message in discovered(*names)} for names in (one, other)]
    assert not ids[0] & ids[1]


def test_all_of_a_devices_entities_are_one_device_and_away_with_the_daemon() -> None:
    found = contents().values()
    [identifiers] = {tuple(content["device"]["identifiers"]) for content in found}
    assert identifiers == ("grabberd_Stall_203_2fNord_north",)
    [[available]] = [content["availability"] for content in found][:1]
    assert available["topic"] == "grabberd/Stall%203%2FNord/online"


def test_values_come_from_what_the_daemon_publishes(messages: dict[str, dict[str, Any]]) -> None:
    jinja = Environment(autoescape=False)
    shown = {
        name: jinja.from_string(content["value_template"]).render(value_json=messages[content["state_topic"]])
        for name, content in contents().items()
    }
    assert {name: shown[name] for name in EXPECTED} == EXPECTED
    attributes = contents()["health"]["json_attributes_template"]
    said = messages["grabberd/Stall%203%2FNord/devices/north/state"]
    assert json.loads(jinja.from_string(attributes).render(value_json=said))["health_part"] == "rate"


@needs_home_assistant
def test_home_assistant_accepts_every_message_and_shows_the_values(
    messages: dict[str, dict[str, Any]],
) -> None:
    asked = [
        {"topic": one.topic, "payload": one.content, "message": messages[(one.content or {})["state_topic"]]}
        for one in discovered()
    ]
    assert HOME_ASSISTANT is not None
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    said = subprocess.run(
        [HOME_ASSISTANT, str(PEER)],
        input=json.dumps(asked),
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert said.returncode == 0, said.stderr
    judged = dict(zip(contents(), json.loads(said.stdout), strict=True))
    assert {name: judged[name]["state"] for name in EXPECTED} == EXPECTED
    for one in judged.values():
        assert one["refused"] == []
        assert one["available"] == one["payloads"] == ["online", "offline"]
    assert json.loads(judged["health"]["attributes"])["health_part"] == "rate"
