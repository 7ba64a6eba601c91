"""Settings that an operator can change."""

from pydantic import Field

from grabberd.config import ThresholdConfig
from grabberd.documents.document import Document


class DeviceSettings(Document):
    """Settings in force for a device."""

    threshold: ThresholdConfig
    as_configured: bool = Field(description="True if the configuration's settings are in force.")


class SettingsDocument(Document):
    """Settings in force, by device."""

    devices: dict[str, DeviceSettings]
