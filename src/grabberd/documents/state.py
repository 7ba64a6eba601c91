"""State and health of the daemon, the settings that an operator can change, and the identity of a client."""

from typing import Literal

from pydantic import Field

from grabberd.config import ThresholdConfig
from grabberd.documents.channels import LoggerDocument
from grabberd.documents.devices import DeviceDocument, FaultDocument
from grabberd.documents.document import Document, with_examples
from grabberd.documents.enums import Role
from grabberd.errors import Cause


class StorageDocument(Document):
    """The disk that holds the captures."""

    free_bytes: int | None
    minutes_left: float | None = Field(
        description="Minutes for which all devices together can still capture with their present rings."
    )
    problem: str | None = Field(description="Why the disk cannot be read.")
    cause_code: Cause | None = Field(description="Machine-readable code of the problem.")
    removed: int = Field(
        description="Number of captures that retention has removed since the daemon started."
    )
    removed_bytes: int


class MqttDocument(Document):
    """Connection to the MQTT broker that receives device states and capture summaries."""

    connected: bool
    since_utc: str
    problem: str | None = Field(description="The latest problem that has not been resolved.")
    waiting_captures: int = Field(description="Finished captures that are not acknowledged yet.")
    acknowledged_captures: int = Field(description="Captures acknowledged since the daemon started.")
    missed_captures: int = Field(
        description="Captures that were deleted before their summaries could be stored."
    )


class StateDocument(Document):
    """State of the devices, the disk and the daemon at a glance."""

    version: str
    devices: dict[str, DeviceDocument]
    loggers: dict[str, LoggerDocument] = Field(
        default_factory=dict, description="Data loggers, whose channels captures record beside the picture."
    )
    storage: StorageDocument
    faults: list[FaultDocument] = Field(description="What is wrong with the daemon itself, the worst first.")
    mqtt: MqttDocument | None = Field(description="Null if the configuration names no broker.")


class HealthDocument(Document):
    """The daemon is serving."""

    status: Literal["ok"] = "ok"
    version: str


class DeviceSettings(Document):
    """Settings in force for a device."""

    threshold: ThresholdConfig
    as_configured: bool = Field(description="True if the configuration's settings are in force.")


class SettingsDocument(Document):
    """Settings in force, by device."""

    devices: dict[str, DeviceSettings]


class SessionDocument(Document):
    """Identity and role of the client; on the machine itself a token may not be needed."""

    model_config = with_examples(
        {"role": "operator", "by": "session", "token": "tablet-north", "expires_utc": None}
    )

    role: Role
    by: Literal["token", "session", "socket", "machine"]
    token: str | None = Field(description="Name of the token.")
    expires_utc: str | None = Field(description="Expiry of the token; null: valid until it is removed.")
