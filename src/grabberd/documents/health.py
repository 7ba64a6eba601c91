"""Faults of the daemon itself, and the health of a device.

Health is one verdict, made in the daemon, that page, broker and /readyz go by.
"""

from typing import Literal

from pydantic import Field
from typing_extensions import TypeAliasType

from grabberd.documents.document import Document
from grabberd.errors import Cause


class FaultDocument(Document):
    """A fault of the daemon itself, its captures' folder or its settings."""

    cause_code: Cause = Field(description="Machine-readable code.")
    level: Literal["fault", "warning"] = Field(
        description="fault: a person has to act; warning: to be known, or repaired by itself."
    )
    message: str
    hint: str
    since_utc: str


HealthLevel = TypeAliasType("HealthLevel", Literal["good", "unknown", "warning", "bad"])
HealthPart = TypeAliasType(
    "HealthPart",
    Literal[
        "device",
        "signal",
        "rate",
        "lost",
        "ring",
        "computer",
        "measurement",
        "calibration",
        "rig",
        "order",
        "disk",
        "records",
        "clock",
    ],
)
StartAdvice = TypeAliasType("StartAdvice", Literal["allowed", "doubtful", "refused"])


class HealthPartDocument(Document):
    """One part of the instrument."""

    level: HealthLevel
    word: str = Field(description="Machine-readable word for what it is like, such as `off` or `moved`.")
    message: str = Field("", description="What is wrong, with values; empty if nothing is.")
    hint: str = Field("", description="What to do about it.")
    cause_code: Cause | None = Field(None, description="Machine-readable code of the cause, if it has one.")
    since_utc: str | None = Field(None, description="Since when, if that is known.")


class DeviceHealth(Document):
    """Health of a device and of what it needs: the computer, the disk, the daemon's records."""

    level: HealthLevel = Field(description="The worst of its parts; what is unknown does not count.")
    part: HealthPart | None = Field(description="The part that is worst, the first if several are.")
    message: str = Field(description="What is wrong with that part; empty if nothing is.")
    hint: str = Field(description="What to do about it.")
    start: StartAdvice = Field(
        description="Whether a capture may be started: `doubtful` if it would be of little use now, "
        "`refused` if there would be none."
    )
    parts: dict[HealthPart, HealthPartDocument] = Field(
        description="Every part, but `order` where a device gives progressive pictures."
    )
