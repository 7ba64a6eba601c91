"""The measured fields in a few numbers each, and the vacuum, as a page draws them under each other."""

from pydantic import Field

from grabberd.core.channels import Quantity
from grabberd.documents.document import Document


class LiveWidths(Document):
    """Distance between two facing targets, field by field."""

    targets: tuple[int, int]
    width_mm: list[float | None] = Field(description="Null where either target has no point.")
    sigma_mm: list[float | None] = Field(
        description="Standard deviation from pointing and line jitter, without the calibration's."
    )


class LiveChannel(Document):
    """The mean of a channel's readings, every 20 ms; there is no entry for a time without readings."""

    name: str
    quantity: Quantity
    logger: str
    time_s: list[float]
    kpa: list[float]


class LiveCurves(Document):
    """The measured fields of a device, and its channels, over the last seconds.

    All times are seconds of the monotonic clock of the daemon's computer. Messages overlap, so that one that
    is missed leaves no gap. Every list but those of the channels has a value for each field.
    """

    device: str
    now_s: float
    now_utc_s: float = Field(description="The same moment in seconds since 1970 (UTC).")
    time_s: list[float] = Field(
        description="Middle of the exposure of each field; one that was not measured is not there."
    )
    targets: dict[str, list[int]] = Field(description="Number of complete targets in each view.")
    points: list[int]
    residual_px: list[float | None] = Field(description="Root mean square over the points.")
    latency_ms: list[float | None] = Field(description="From the arrival of the field to its points.")
    widths: list[LiveWidths] = Field(
        description="Distances between targets that face each other in the middle row, the outermost first."
    )
    channels: list[LiveChannel]
