"""What leaves the daemon by MQTT and by the Lab Streaming Layer, for documents that never change."""

import tempfile
from pathlib import Path
from typing import Any

from .doors import (
    CAPTURE,
    CaptureDocument,
    DeviceAnalysis,
    DeviceEvents,
    PointsLayout,
    Topics,
    all_topics,
    capture_summary,
    device_analysis,
    device_state,
    discovery,
    opened,
)
from .names import NOW

MASKED_STATE = ("since_utc", "disk_minutes_left")
"""Keys of a device's state that the clock and the computer's disk decide on."""


def mqtt() -> dict[str, Any]:
    """Topics; the message on each for an example; announcements for Home Assistant."""
    topics = Topics("herd/north", "Ås barn 2")
    document = CaptureDocument.model_validate(CAPTURE)
    assert document.analysis is not None
    latest = DeviceAnalysis.model_validate({**document.analysis.model_dump(), "capture": document.id})
    summary = capture_summary(
        document, file="one.grab", site={"barn": "Ås"}, rate_hz=50.0, calibration_id="rig-7"
    )
    announced = discovery("homeassistant", topics, "Ås barn 2", "cup north", "v4l2")
    return {
        "topics": {one.name: [topics.name(one, device="cup"), one.retained] for one in all_topics()},
        "capture": summary.model_dump(mode="json"),
        "analysis": device_analysis("cup", latest).model_dump(mode="json"),
        "state": _state(),
        "home_assistant": [one._asdict() for one in announced],
    }


def lsl() -> dict[str, Any]:
    """Channels of a stream of points, and events of two answers of the daemon."""
    document = {"name": "liner", "target": [7, 9], "row": [0, 1], "column": [3, 4]}
    layout = PointsLayout.from_document(document)
    return {
        "digest": layout.digest,
        "channels": [one._asdict() for one in layout.channels()],
        "events": [[one.name, dict(one.details), str(one.utc)] for one in _events()],
    }


def _state() -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder, opened(Path(folder), NOW) as service:
        state = service.state()
    message = device_state(state.devices["simulated"], state.storage).model_dump(mode="json")
    return {key: "…" if key in MASKED_STATE else value for key, value in message.items()}


def _events() -> list[Any]:
    part = {"signal": {"word": "none"}, "rate": {"word": "good"}}
    health = {"level": "bad", "part": "signal", "message": "no signal", "hint": "plug it in", "parts": part}
    fields = {"received": 9, "lost": 0, "damaged": 0, "no_signal": 0, "overrun": 0}
    device = {"stream": {"rate_hz": 50.0}, "health": health, "fields": fields}
    first = CaptureDocument.model_validate({**CAPTURE, "first_field_s": 0.01}).model_dump(mode="json")
    begun, ended = ({**first, "id": "second", "state": state} for state in ("recording", "sealed"))
    events = DeviceEvents()
    return [
        *events.of_state(device),
        *events.of_captures([first]),
        *events.of_state({**device, "fields": {**fields, "received": 12, "lost": 3}}),
        *events.of_captures([begun, first]),
        *events.of_captures([ended, first]),
    ]
