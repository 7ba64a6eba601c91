"""MQTT topics and the messages on them."""

from collections.abc import Mapping
from functools import cache
from typing import NamedTuple
from urllib.parse import quote

from grabberd.core.ledger import Outcome
from grabberd.documents.captures import CaptureDocument
from grabberd.documents.devices import DeviceDocument
from grabberd.documents.document import Document, JsonObject, assembled
from grabberd.documents.mqtt import CaptureSummary, DeviceStateMessage, DeviceTopic, LedgerSummary, Topic
from grabberd.documents.state import StorageDocument
from grabberd.extension import extensions, load

SCHEMA = 1
"""Schema version of all messages; a new key does not change it, a new meaning of a key does."""


ONLINE = Topic("online", True, "whether the daemon is connected; `false` is its last will")
STATE = Topic("devices/{device}/state", True, "the state of a device")
LAST_CAPTURE = Topic(
    "devices/{device}/capture",
    True,
    "the summary of the device's capture that ended last; only with `home_assistant`",
)
CAPTURE = Topic("captures", False, "the summary of a capture that has ended")


@cache
def device_topics() -> tuple[DeviceTopic, ...]:
    """The topics that extensions add for each device."""
    return tuple(topic for one in extensions() if one.messages for topic in load(one.messages))


def all_topics() -> tuple[Topic, ...]:
    """All topics, in the order of the documentation."""
    return ONLINE, STATE, *(one.topic for one in device_topics()), LAST_CAPTURE, CAPTURE


class Message(NamedTuple):
    """A JSON object and its topic; None removes what the broker retains there. All go out with QoS 1."""

    topic: str
    content: JsonObject | None
    retained: bool


class Topics:
    """The topics of one barn.

    Args:
        prefix: Prefix of every topic.
        barn: Name of the barn; every character but letters and digits becomes %XX, as in a data set's
            folders.
    """

    def __init__(self, prefix: str, barn: str) -> None:
        self._start = f"{prefix}/{quote(barn, safe='')}"

    def name(self, topic: Topic, **parts: str) -> str:
        """A topic in full."""
        return f"{self._start}/{topic.name.format(**parts)}"

    def message(self, topic: Topic, document: Document | JsonObject, **parts: str) -> Message:
        """A message on a topic, with its schema version.

        Args:
            topic: Where it goes.
            document: A document, or the JSON of one that was stored, perhaps by an earlier version.
            parts: Values of the placeholders in the topic's name.
        """
        content = document.model_dump(mode="json") if isinstance(document, Document) else document
        return Message(self.name(topic, **parts), {"schema": SCHEMA, **content}, topic.retained)


def device_state(device: DeviceDocument, storage: StorageDocument) -> DeviceStateMessage:
    """The state of a device in short; values that always fluctuate are rounded until they are stable.

    Args:
        device: The device.
        storage: The disk with its captures.
    """
    calibration, health = device.calibration, device.health
    lacks = {one.lacks for one in device.lacks}
    return assembled(
        DeviceStateMessage,
        device,
        device=device.name,
        health=health.level,
        health_part=health.part,
        health_word=health.parts[health.part].word if health.part else None,
        hint=health.hint,
        rate_hz=None if device.rate_hz is None else round(device.rate_hz),
        fields_lost=device.fields[Outcome.LOST],
        fields_damaged=device.fields[Outcome.DAMAGED],
        fields_no_signal=device.fields[Outcome.NO_SIGNAL],
        fields_overrun=device.fields[Outcome.OVERRUN],
        calibration_id=calibration.id if calibration else None,
        calibration_fits="calibration" not in lacks if calibration else None,
        rig=device.rig.verdict if device.rig else None,
        disk_minutes_left=_two_digits(storage.minutes_left),
    )


def capture_summary(
    document: CaptureDocument,
    *,
    file: str,
    site: Mapping[str, str],
    rate_hz: float,
    calibration_id: str | None,
) -> CaptureSummary:
    """The summary of a finished capture; receivers use its id to detect one that came twice.

    Args:
        document: The capture.
        file: Name of its file.
        site: Where it was recorded.
        rate_hz: Fields per second.
        calibration_id: Calibration that its latest points were measured with; None without points.
    """
    ledger, covered = document.ledger, document.coverage
    return assembled(
        CaptureSummary,
        document,
        capture_id=document.id,
        group_id=document.group.id if document.group else None,
        coverage_verdict=covered.verdict if covered else None,
        coverage_in_words=covered.in_words if covered else None,
        share_found=covered.share if covered else None,
        channels_verdict=document.channels.verdict if document.channels else None,
        channels_in_words=document.channels.in_words if document.channels else None,
        started_utc=document.created_utc,
        duration_s=round(sum(ledger.counts.values()) / rate_hz, 3),
        ledger=assembled(LedgerSummary, ledger),
        site=dict(site),
        calibration_id=calibration_id,
        file=file,
    )


def _two_digits(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.2g}")
