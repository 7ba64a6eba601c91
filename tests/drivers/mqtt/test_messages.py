"""What is told over MQTT, and that the documents say so."""

import re
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
from running import running

from grabberd.documents.captures import CaptureDocument
from grabberd.documents.examples import CAPTURE
from grabberd.documents.mqtt import (
    CaptureSummary,
    DeviceStateMessage,
    OnlineMessage,
)
from grabberd.documents.state import StateDocument
from grabberd_mqtt.messages import (
    ONLINE,
    SCHEMA,
    STATE,
    Topics,
    all_topics,
    capture_summary,
    device_state,
)

DOCUMENT = Path(__file__).parents[3] / "docs" / "howto" / "mqtt.md"


def state_of(folder: Path) -> StateDocument:
    with running(folder) as service:
        return service.state()


@given(st.text(min_size=1))
def test_a_barns_name_never_makes_another_topic_of_it(barn: str) -> None:
    topic = Topics("herd/north", barn).message(STATE, {}, device="cup").topic
    assert re.fullmatch(r"herd/north/[A-Za-z0-9._~%-]+/devices/cup/state", topic)


def test_every_message_says_its_schema_before_its_documents_keys() -> None:
    message = Topics("a", "b").message(ONLINE, OnlineMessage(online=True, version="1"))
    assert list(message.content.items()) == [("schema", SCHEMA), ("online", True), ("version", "1")]


def test_a_summary_of_an_earlier_version_goes_out_as_it_was_stored() -> None:
    assert Topics("a", "b").message(STATE, {"odd": 1}, device="c").content == {"schema": SCHEMA, "odd": 1}


def test_numbers_that_always_waver_are_quiet(tmp_path: Path) -> None:
    state = state_of(tmp_path)
    device, storage = state.devices["simulated"], state.storage
    one, two = (
        device_state(
            device.model_copy(update={"rate_hz": rate_hz}), storage.model_copy(update={"minutes_left": left})
        )
        for rate_hz, left in ((49.9, 1234.5), (50.2, 1229.1))
    )
    assert one == two
    assert (one.rate_hz, one.disk_minutes_left) == (50, 1200)


def test_a_summary_sums_a_capture_up() -> None:
    capture = CaptureDocument.model_validate(CAPTURE)
    summary = capture_summary(capture, file="a.grab", site={}, rate_hz=50.0, calibration_id="rig-7")
    assert (summary.capture_id, summary.duration_s, summary.group_id) == (capture.id, 1.28, None)
    assert summary.ledger.counts == capture.ledger.counts


def test_the_document_names_every_topic_and_every_key() -> None:
    text = DOCUMENT.read_text()
    for topic in all_topics():
        retained = "yes" if topic.retained else "no"
        assert (
            f"| `PREFIX/BARN/{topic.name.replace('{device}', 'DEVICE')}` | {retained} | {topic.words} |"
            in text
        )
    for heading, message in (
        ("## A device's state", DeviceStateMessage),
        ("## A capture's summary", CaptureSummary),
    ):
        part = text.partition(heading)[2].partition("\n## ")[0]
        assert set(re.findall(r"^\| `(\w+)` \|", part, re.M)) == set(message.model_fields)
