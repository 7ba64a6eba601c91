"""What is told over MQTT, and that the documents say so."""

import re
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from running import running

from grabberd.acquisition import Ledger
from grabberd.service.archive.capture_documents import ledger_document
from grabberd.service.mqtt.messages import (
    SCHEMA,
    STATE,
    TOPICS,
    Topics,
    capture_summary,
    device_state,
)

DOCUMENT = Path(__file__).parents[3] / "docs" / "howto" / "mqtt.md"


def state_of(folder: Path) -> dict[str, Any]:
    with running(folder) as service:
        state = service.state()
    return device_state(state["devices"]["simulated"], state["storage"])


def summary() -> dict[str, Any]:
    shown = dict.fromkeys(
        ("id", "device", "state", "verdict", "ended_because", "created_utc", "bits", "lines")
    )
    known = {
        "fields": 3,
        "group": None,
        "ledger": ledger_document(Ledger(), 50.0),
        "labels": {},
        "size_bytes": 1,
    }
    return capture_summary({**shown, **known}, file="a.grab", site={}, rate_hz=50.0, calibration_id=None)


@given(st.text(min_size=1))
def test_a_barns_name_never_makes_another_topic_of_it(barn: str) -> None:
    topic = Topics("herd/north", barn).message(STATE, {}, device="cup").topic
    assert re.fullmatch(r"herd/north/[A-Za-z0-9._~%-]+/devices/cup/state", topic)


def test_every_document_says_its_schema() -> None:
    assert Topics("a", "b").message(STATE, {"state": "ready"}, device="c").document["schema"] == SCHEMA


def test_numbers_that_always_waver_are_quiet(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        state = service.state()
    device = state["devices"]["simulated"]
    told = [
        device_state({**device, "rate_hz": rate_hz}, {**state["storage"], "minutes_left": minutes})
        for rate_hz, minutes in ((49.9, 1234.5), (50.2, 1229.1))
    ]
    assert told[0] == told[1]
    assert (told[0]["rate_hz"], told[0]["disk_minutes_left"]) == (50, 1200)


def test_the_document_names_every_topic_and_every_key(tmp_path: Path) -> None:
    text = DOCUMENT.read_text()
    for topic in TOPICS:
        retained = "yes" if topic.retained else "no"
        assert (
            f"| `PREFIX/BARN/{topic.name.replace('{device}', 'DEVICE')}` | {retained} | {topic.words} |"
            in text
        )
    state_keys, summary_keys = (set(re.findall(r"^\| `(\w+)` \|", part, re.M)) for part in parts(text))
    assert state_keys == set(state_of(tmp_path))
    assert summary_keys == set(summary())


def parts(text: str) -> tuple[str, str]:
    _, _, rest = text.partition("## A device's state")
    state, _, rest = rest.partition("## A capture's summary")
    return state, rest.partition("\n## ")[0]
