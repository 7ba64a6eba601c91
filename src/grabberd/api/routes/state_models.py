"""The state of devices, disk and daemon, as it goes out."""

from typing import Literal

from pydantic import Field

from grabberd.acquisition import Outcome
from grabberd.api.routes.calibration_models import ActiveCalibration
from grabberd.api.routes.models import Document
from grabberd.api.routes.named_types import (
    JsonObject,
    LackKind,
    Latency,
    ViewCounts,
)
from grabberd.errors import Cause
from grabberd.reconstruction.accuracy.drift_check import RigVerdict
from grabberd.service.device.device_state import DeviceState
from grabberd.service.device.recovery import Rung


class RingDocument(Document):
    """The ring of a device."""

    slots: int
    bits: int
    lines: str
    threshold: int
    waiting: int = Field(description="Slots that its slowest reader has not read yet.")
    deepest: int = Field(description="The most that ever were, in this ring.")


class ViewColumnsDocument(Document):
    """The columns of the picture that a view has."""

    first_column: int
    end_column: int


class DeviceLackDocument(Document):
    """What keeps a device from measuring."""

    lacks: LackKind
    message: str
    hint: str
    cause_code: Cause | None = Field(description="The same in a word.")


class WidthDocument(Document):
    """How far apart two targets are."""

    targets: tuple[int, int]
    width_mm: float | None = Field(description="None where one of both has no point.")
    sigma_mm: float | None = Field(description="From pointing and line jitter.")


class LiveDocument(Document):
    """The newest measured field."""

    n: int
    blobs: int
    views: ViewCounts | None = Field(description="How many targets each view shows whole.")
    points: int
    residual_px: float | None
    widths: list[WidthDocument] = Field(
        description="Of targets that face each other in the middle row, the outermost first."
    )
    latency_ms: Latency | None


class RigDocument(Document):
    """Whether camera and mirrors still are as they were calibrated, from the last seconds' pictures."""

    verdict: RigVerdict
    shift_px: float | None = Field(
        description="By how much the views have moved against each other, across the epipolar lines; what "
        "moves images along them or both alike only a check with the calibration frame can tell."
    )
    sigma_px: float | None = Field(description="What that is expected to be on a rig that has not moved.")
    ratio: float | None = Field(description="Root mean square in units of σ; 1 on a rig that has not moved.")
    residual_px: dict[str, dict[str, float | None]] = Field(
        description="Root mean square of the images' residuals, by view and axis."
    )
    targets: int
    fields: int


class DeviceDocument(Document):
    """A device at this moment."""

    name: str
    state: DeviceState
    since_utc: str
    cause: str | None
    hint: str | None = Field(description="What can be done about the cause.")
    cause_code: Cause | None = Field(description="The cause in a word, the same for every driver.")
    driver: str
    stream: JsonObject | None
    signal: str
    rate_hz: float | None = Field(description="Fields that come a second; None while none do.")
    fields: dict[Outcome, int]
    openings: int
    recoveries: dict[Rung, int] = Field(
        description="How often each step was taken to have it deliver again, since the daemon started."
    )
    last_failure: str | None = Field(description="Why the last of them was taken.")
    last_failure_utc: str | None = Field(description="Since when for that reason.")
    ring: RingDocument
    views: dict[str, ViewColumnsDocument]
    calibration: ActiveCalibration | None
    lacks: list[DeviceLackDocument] = Field(description="What keeps it from measuring; the same as /readyz.")
    warnings: list[str] = Field(description="What a person has to know of it, in sentences.")
    capture_id: str | None = Field(description="The capture that is being recorded.")
    armed_capture_id: str | None = Field(description="The capture that waits for its trigger.")
    group_id: str | None = Field(description="The group that either of them belongs to.")
    rig: RigDocument | None = Field(description="None before the first second of measuring.")
    live: LiveDocument | None


class StorageDocument(Document):
    """The disk with the captures."""

    free_bytes: int | None
    minutes_left: float | None = Field(
        description="So long all devices together can still capture, as their rings are now."
    )
    problem: str | None = Field(description="Why the disk cannot be asked.")
    cause_code: Cause | None = Field(description="The problem in a word.")
    removed: int = Field(description="Captures that retention has removed since the daemon started.")
    removed_bytes: int


class MqttDocument(Document):
    """The broker that is told of devices and captures."""

    connected: bool
    since_utc: str
    problem: str | None = Field(description="What went wrong last, and has not gone well since.")
    waiting_captures: int = Field(description="Captures that have ended and are not acknowledged yet.")
    acknowledged_captures: int = Field(description="Since the daemon started.")
    missed_captures: int = Field(description="Deleted before their summaries could be kept.")


class StateDocument(Document):
    """Everything that a glance needs."""

    version: str
    devices: dict[str, DeviceDocument]
    storage: StorageDocument
    mqtt: MqttDocument | None = Field(description="None where the configuration names no broker.")


class HealthDocument(Document):
    """The daemon serves."""

    status: Literal["ok"] = "ok"
    version: str
