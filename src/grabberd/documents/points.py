"""Points, column by column, and the curves of measured fields that a page draws under each other."""

from typing import Literal

from pydantic import Field

from grabberd.core.channels import Quantity
from grabberd.documents.document import Document, with_examples
from grabberd.documents.examples import POINTS


class PointColumns(Document):
    """Points of one field; every list has the targets in the same sequence."""

    target: list[int]
    x_mm: list[float]
    y_mm: list[float]
    z_mm: list[float]
    sigma_x_mm: list[float] = Field(description="Standard deviation from pointing and line jitter.")
    sigma_y_mm: list[float]
    sigma_z_mm: list[float]
    calibration_sigma_x_mm: list[float] = Field(
        description="Standard deviation from the calibration; common to all fields."
    )
    calibration_sigma_y_mm: list[float]
    calibration_sigma_z_mm: list[float]
    residual_px: list[float]


class FieldPoints(PointColumns):
    """The points of one field of a capture."""

    n: int
    time_s: float = Field(description="Time since the capture's first field.")


class PointsDocument(Document):
    """Points of a run, thinned out."""

    model_config = with_examples(POINTS)

    capture: str
    run: int
    every: int = Field(description="Only fields whose number is a multiple of this are included.")
    fields: list[FieldPoints]


class NewestPoints(PointColumns):
    """The points of the newest measured field; every list has the targets in the same sequence."""

    device: str
    n: int
    utc: str = Field(description="Middle of the field's exposure.")


class PointsDescription(Document):
    """Description of the points of a stream, which holds until the next one."""

    type: Literal["description"] = "description"
    number: int = Field(description="Number by which the frames refer to it.")
    device: str
    rate_hz: float
    calibration_id: str | None = Field(description="Calibration that the fields are measured with.")
    object_name: str | None = Field(description="Object model that they are measured with.")


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
