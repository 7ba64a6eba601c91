"""Points, column by column."""

from typing import Literal

from pydantic import Field

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
