"""Groups of captures as they go in and out over HTTP."""

from typing import Annotated, Literal

from pydantic import Field
from typing_extensions import TypeAliasType

from grabberd.api.docs.examples import CAPTURE
from grabberd.api.routes.capture_models import CaptureDocument, CaptureWish
from grabberd.api.routes.models import Document, shown
from grabberd.api.routes.named_types import Labels

_ID = "20260301T093000125Z"
_EXAMPLE = {
    "id": _ID,
    "devices": ["left", "right"],
    "start_utc": "2026-03-01T09:30:00.125Z",
    "start_ns": 81_302_117_400_512,
    "captures": [
        {
            **CAPTURE,
            "id": f"{_ID}-{device}",
            "device": device,
            "group": {
                "id": _ID,
                "devices": ["left", "right"],
                "start_utc": "2026-03-01T09:30:00.125Z",
                "start_ns": 81_302_117_400_512,
            },
            "first_field_s": 0.0134,
        }
        for device in ("left", "right")
    ],
}

AllDevices = TypeAliasType("AllDevices", Literal["all"])
DeviceNames = TypeAliasType(
    "DeviceNames", Annotated[list[Annotated[str, Field(max_length=32)]], Field(min_length=1, max_length=64)]
)


class CaptureGroupOrder(CaptureWish):
    """Captures of several devices that begin at the same moment, each with the same length and bits."""

    model_config = shown(
        {"devices": "all", "duration_s": 60, "labels": {"cow": "112"}},
        {
            "devices": ["left", "right"],
            "armed": True,
            "pre_trigger_fields": 25,
            "labels_of": {"left": {"teat": "front left"}, "right": {"teat": "front right"}},
        },
    )

    devices: AllDevices | DeviceNames = Field("all", description="Their names, or 'all'.")
    labels_of: dict[str, Labels] = Field(
        default_factory=dict, description="Labels of single devices' captures, beside those of all."
    )


class CaptureGroup(Document):
    """Captures that begin at the same moment."""

    model_config = shown(_EXAMPLE)

    id: str
    devices: list[str]
    start_utc: str | None = Field(description="When all of them began; None while they are armed.")
    start_ns: int | None = Field(
        description="The same moment by the computer's monotonic clock, which counts the fields' times."
    )
    captures: list[CaptureDocument] = Field(description="Those that there are; a deleted one is left out.")
