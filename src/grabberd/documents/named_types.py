"""Types that have a name in OpenAPI, so that a generated client uses it instead of inventing one."""

from typing import Annotated, Any, Literal

from pydantic import Field, StringConstraints
from typing_extensions import TypeAliasType

from grabberd.config import BitDepth, Lines, OnInterruption

MOST_LABELS = 32
MOST_MARKS = 200

Label = Annotated[str, StringConstraints(max_length=200)]
Note = Annotated[str, StringConstraints(max_length=2000)]
MarkName = Annotated[str, StringConstraints(strip_whitespace=True, pattern=r"\S", max_length=200)]
MarkedField = Annotated[str, StringConstraints(pattern=r"^[0-9]{1,8}$")]
"""Number of a field as JSON has it for a key."""

Bits = TypeAliasType("Bits", BitDepth)
LinesKind = TypeAliasType("LinesKind", Lines)
LINES = "`doubled` or `field`; null for progressive pictures, which have all lines."
InterruptionPolicy = TypeAliasType("InterruptionPolicy", OnInterruption)
OverrunPolicy = TypeAliasType("OverrunPolicy", Literal["count", "stop"])
CaptureState = TypeAliasType(
    "CaptureState", Literal["armed", "recording", "sealing", "sealed", "unsealed", "damaged", "disarmed"]
)
Verdict = TypeAliasType("Verdict", Literal["complete", "incomplete"])
ListedVerdict = TypeAliasType("ListedVerdict", Literal["complete", "incomplete", "damaged"])
AcceptanceVerdict = TypeAliasType("AcceptanceVerdict", Literal["passed", "passed_with_remarks", "failed"])
Labels = TypeAliasType("Labels", Annotated[dict[Label, Label], Field(max_length=MOST_LABELS)])
LabelChanges = TypeAliasType(
    "LabelChanges", Annotated[dict[Label, Label | None], Field(max_length=MOST_LABELS)]
)
MarkChanges = TypeAliasType(
    "MarkChanges",
    Annotated[
        dict[MarkedField, MarkName | None],
        Field(max_length=MOST_MARKS, json_schema_extra={"additionalProperties": False}),
    ],
)
Weights = TypeAliasType("Weights", Literal["honest", "equal"])
CalibrationFrameTreatment = TypeAliasType("CalibrationFrameTreatment", Literal["weighted", "held"])
Handedness = TypeAliasType("Handedness", Literal[-1, 1])
CalibrationOrigin = TypeAliasType("CalibrationOrigin", Literal["capture", "import", "configuration"])
Glass = TypeAliasType("Glass", dict[str, float])
ImageSize = TypeAliasType("ImageSize", dict[str, int])
Latency = TypeAliasType("Latency", dict[str, float])
ViewCounts = TypeAliasType("ViewCounts", dict[str, int])
JsonObject = TypeAliasType("JsonObject", dict[str, Any])
"""JSON of another schema: documents from files, configuration, and results that a job kind defines."""
AllDevices = TypeAliasType("AllDevices", Literal["all"])
DeviceNames = TypeAliasType(
    "DeviceNames", Annotated[list[Annotated[str, Field(max_length=32)]], Field(min_length=1, max_length=64)]
)
