"""Channels: what is measured beside the picture, live and in captures."""

from typing import Literal

from pydantic import Field
from typing_extensions import TypeAliasType

from grabberd.core.channels import Dating, Quantity
from grabberd.documents.document import Document
from grabberd.documents.enums import DeviceState
from grabberd.errors import Cause


class ChannelValueDocument(Document):
    """A channel of a logger at this moment."""

    quantity: Quantity
    column: str = Field(description="The logger's column.")
    devices: list[str] = Field(description="Devices whose captures record it; empty: all of them.")
    kpa: float | None = Field(
        description="Vacuum in kPa below atmosphere, the mean of the last half second; null while none "
        "comes, and for a light."
    )
    level: float | None = Field(None, description="Newest reading of a light; null for a vacuum.")
    sigma_kpa: float = Field(description="Standard deviation of its calibration.")
    calibrated: str | None = Field(description="Date of its calibration; null if it was never calibrated.")


class LoggerDocument(Document):
    """Present state of a data logger."""

    name: str
    driver: str
    state: DeviceState
    since_utc: str
    cause: str | None
    hint: str | None = Field(description="What to do about the cause.")
    cause_code: Cause | None = Field(description="Machine-readable code of the cause.")
    model: str | None = Field(description="The logger's own name; null before it was opened.")
    rate_hz: float | None = Field(description="Readings per second; null if only the logger knows.")
    dating: Dating | None = Field(description="What the times of its readings go by.")
    openings: int
    readings: int = Field(description="Number of readings since the daemon started.")
    anomalies: dict[str, int] = Field(
        description="What else it said since then, and readings that it did not say, by reason."
    )
    lost: int = Field(description="Number of readings that are missing because of these, where it is known.")
    warnings: list[str] = Field(description="Warnings for people, in sentences.")
    channels: dict[str, ChannelValueDocument]


ChannelsVerdict = TypeAliasType("ChannelsVerdict", Literal["complete", "with gaps"])


class ChannelsSummary(Document):
    """Verdict on the channels of a capture, apart from that on its fields."""

    names: list[str]
    verdict: ChannelsVerdict | None = Field(description="Null while it is recording.")
    in_words: str = Field(description="The verdict with its reasons.")


class ChannelGapDocument(Document):
    """A time without readings."""

    first_s: float = Field(description="Last reading before it, from the capture's first field on.")
    last_s: float = Field(description="First reading after it.")
    reason: str


class ChannelAnomalyDocument(Document):
    """Anomalies of a logger for one reason: what it said that is no reading, or did not say."""

    logger: str
    reason: str
    times: int
    lost: int = Field(description="Number of readings that are missing because of it, where it is known.")
    first_s: float = Field(description="When it was first noticed, from the capture's first field on.")
    example: str


class ChannelCalibrationDocument(Document):
    """Calibration of a channel: kPa = gain · value + offset_kpa."""

    unit: str
    gain: float
    offset_kpa: float
    sigma_kpa: float = Field(description="Standard deviation of the calibration, common to all readings.")
    calibrated: str | None
    delay_ms: float = Field(description="Time by which readings are late; their times are without it.")
    delay_sigma_ms: float


class ChannelDocument(Document):
    """A channel of a capture, thinned out."""

    name: str
    quantity: Quantity
    logger: str
    calibration: ChannelCalibrationDocument
    datings: list[Dating] = Field(
        description="What its times go by; several if the logger was opened anew meanwhile."
    )
    sigma_time_s: float | None = Field(description="Standard deviation of its times, the largest of all.")
    readings: int = Field(description="Number of readings in the capture.")
    gap_count: int
    gap_s: float
    gaps: list[ChannelGapDocument] = Field(description="The first hundred gaps.")
    time_s: list[float] = Field(description="Times of every k-th reading, from the capture's first field on.")
    kpa: list[float] = Field(description="Vacuum below atmosphere; empty for a light.")
    level: list[float] = Field(description="Readings of a light as measured; empty for a vacuum.")


class CaptureChannelsDocument(Document):
    """The channels of a capture."""

    capture: str
    verdict: ChannelsVerdict | None = Field(description="Null while it is recording, and without channels.")
    in_words: str
    anomalies: list[ChannelAnomalyDocument]
    channels: list[ChannelDocument]
