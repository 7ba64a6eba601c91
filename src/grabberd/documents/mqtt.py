"""MQTT topics, and the messages on them; each leaves with `schema` before these keys."""

from collections.abc import Callable
from typing import NamedTuple

from grabberd.core.ledger import Outcome
from grabberd.core.reconstruction.coverage import CoverageVerdict
from grabberd.core.reconstruction.drift_check import RigVerdict
from grabberd.documents.channels import ChannelsVerdict
from grabberd.documents.devices import DeviceDocument, HealthLevel, HealthPart
from grabberd.documents.document import CaptureState, Document, Verdict
from grabberd.documents.enums import DeviceState
from grabberd.errors import Cause


class Topic(NamedTuple):
    """A topic below PREFIX/BARN: whether the broker retains its latest message, and what that tells."""

    name: str
    retained: bool
    words: str


class DeviceTopic(NamedTuple):
    """A topic of an extension on which each device has a message.

    Attributes:
        topic: The topic, whose name has the placeholder `device`.
        message: Its message by the device's state; None as long as there is nothing to tell.
    """

    topic: Topic
    message: Callable[[DeviceDocument], Document | None]


class OnlineMessage(Document):
    """The daemon is connected, or, as its last will, no longer."""

    online: bool
    version: str


class DeviceStateMessage(Document):
    """State of a device in short."""

    device: str
    state: DeviceState
    since_utc: str
    cause: str | None
    cause_code: Cause | None
    health: HealthLevel
    health_part: HealthPart | None
    health_word: str | None
    hint: str
    signal: str
    rate_hz: int | None
    fields_lost: int
    fields_damaged: int
    fields_no_signal: int
    fields_overrun: int
    calibration_id: str | None
    calibration_fits: bool | None
    rig: RigVerdict | None
    capture_id: str | None
    disk_minutes_left: float | None


class LedgerSummary(Document):
    """A capture's ledger in words and in numbers."""

    in_words: str
    counts: dict[Outcome, int]


class CaptureSummary(Document):
    """A finished capture; a receiver recognises a repeated message by `capture_id`."""

    capture_id: str
    group_id: str | None
    device: str
    state: CaptureState
    verdict: Verdict | None
    coverage_verdict: CoverageVerdict | None
    coverage_in_words: str | None
    share_found: float | None
    channels_verdict: ChannelsVerdict | None = None
    channels_in_words: str | None = None
    ended_because: str | None
    started_utc: str
    duration_s: float
    fields: int
    ledger: LedgerSummary
    bits: int
    lines: str | None
    labels: dict[str, str]
    site: dict[str, str]
    calibration_id: str | None
    file: str
    size_bytes: int
