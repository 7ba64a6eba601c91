"""Configuration sections of one grabber: its rig, its ring, and how its fields are processed."""

import math
from itertools import combinations
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from grabberd.config.section import ExistingFile, Section
from grabberd.core.field import LARGEST_SIDE_PX
from grabberd.core.measurement.marks import CLEAR_PX, LEAST_PLACES, MOST_MARKS

BitDepth = Literal[1, 2, 3, 4, 5, 6, 8]
Lines = Literal["doubled", "field"]
OnInterruption = Literal["continue", "end"]

Millimetres = Annotated[float, Field(allow_inf_nan=False)]


class ViewColumns(Section):
    """Columns of the picture that belong to one view."""

    first_column: int = Field(ge=0, description="first column of the view")
    end_column: int = Field(gt=0, description="first column after the view")
    handedness: Literal[-1, 1] | None = Field(
        None, description="-1 for an odd number of mirrors, 1 for an even one; a calibration must agree"
    )


class Views(Section):
    """Both halves of the picture."""

    left: ViewColumns = ViewColumns(first_column=0, end_column=360)
    right: ViewColumns = ViewColumns(first_column=360, end_column=720)

    @model_validator(mode="after")
    def _side_by_side(self) -> Self:
        for name, view in (("left", self.left), ("right", self.right)):
            if view.end_column <= view.first_column:
                raise ValueError(f"{name} has no columns: {view.first_column} to {view.end_column}")
        if self.left.end_column > self.right.first_column:
            raise ValueError(
                f"the views overlap: left ends at column {self.left.end_column}, "
                f"right starts at {self.right.first_column}"
            )
        return self


class GlassConfig(Section):
    """A plane-parallel glass plate between the mirrors and the object."""

    thickness_mm: Millimetres = Field(gt=0, le=50, description="thickness of the plate")
    refractive_index: float = Field(ge=1, le=3, description="about 1.52 for window glass")


class RigConfig(Section):
    """Nominal geometry of the rig, within about ten per cent: prior knowledge for a calibration."""

    columns: int = Field(720, ge=16, le=4096, description="columns of the picture")
    lines: int = Field(
        576, ge=16, le=4096, multiple_of=2, description="lines of the picture: of a frame, if interlaced"
    )
    views: Views = Views()
    # The defaults are the reference rig's: .25 to .27 mm on the object for a pixel.
    distance_mm: Millimetres = Field(
        240.0, ge=20, le=5000, description="from the lens along the mirrors' path to the object"
    )
    base_mm: Millimetres = Field(128.0, ge=5, le=2000, description="distance between the two virtual cameras")
    convergence_deg: float = Field(30.0, ge=0, le=120, description="angle between their axes")
    focal_length_mm: Millimetres = Field(8.0, ge=1, le=200, description="focal length of the lens")
    pixel_x_mm: Millimetres = Field(
        0.0086, ge=0.001, le=0.05, description="width of the sensor divided by the number of columns"
    )
    pixel_y_mm: Millimetres = Field(
        0.0083, ge=0.001, le=0.05, description="height of the sensor divided by the number of lines"
    )
    exposure_ms: float = Field(1.0, gt=0, le=20, description="exposure time of the camera")
    glass: GlassConfig | None = Field(
        None, description="glass plate in the path; a calibration must match it"
    )

    @model_validator(mode="after")
    def _views_inside_picture(self) -> Self:
        if self.views.right.end_column > self.columns:
            raise ValueError(
                f"the right view ends at column {self.views.right.end_column}, the picture has {self.columns}"
            )
        return self


class RingConfig(Section):
    """The ring of packed fields."""

    # As many as the paper: .64 s. Stalls of .9 s have been seen; the recorder's queue bridges those.
    slots: int | None = Field(
        None, ge=4, le=4096, description="number of slots; default: as many as last for 0.64 s, at least 32"
    )
    bits: BitDepth = Field(1, description="bits per pixel: 1 to 6, or 8")
    lines: Lines | None = Field(
        None, description="doubled (default at 1 bit) or field: intact (default for grey)"
    )
    interpolation: Literal["linear", "kernel3x3"] = Field(
        "linear", description="how the missing lines of doubled fields are interpolated from grey values"
    )


class ThresholdConfig(Section):
    """Choice of the grey value that separates targets from the background."""

    kind: Literal["fixed", "trinder", "automatic"] = Field(
        "automatic", description="fixed: `value`; trinder: the paper's equation 3; automatic: least error"
    )
    value: int | None = Field(None, ge=0, le=254, description="grey value, for kind fixed")
    map: bool = Field(
        False, description="one threshold per pixel, for uneven light; requires kind automatic and 1 bit"
    )

    @model_validator(mode="after")
    def _value_belongs_to_fixed(self) -> Self:
        if (self.kind == "fixed") != (self.value is not None):
            raise ValueError("kind fixed requires 'value', and only kind fixed takes it")
        return self

    @model_validator(mode="after")
    def _map_belongs_to_automatic(self) -> Self:
        if self.map and self.kind != "automatic":
            raise ValueError(f"'map' requires kind automatic, not {self.kind}")
        return self


class LocationConfig(Section):
    """Location of targets in the picture."""

    method: str = Field(
        "automatic", description="name of a locator; automatic: the most accurate one for the number of bits"
    )
    target_px: float | None = Field(
        None, gt=0, le=100, description="diameter of the targets; default: estimated from the picture"
    )
    line_shifts: bool | None = Field(
        None, description="false: leave the shifts of lines alone; else they are estimated and taken away"
    )


class TargetsConfig(Section):
    """Sizes on the object that count as a target: limits of a blob's diameter, for all objects."""

    least_mm: Millimetres | None = Field(
        None, gt=0, le=100, description="least diameter; default: .43 of the object's `target_diameter_mm`"
    )
    most_mm: Millimetres | None = Field(
        None, gt=0, le=100, description="greatest diameter; default: 2.6 times `target_diameter_mm`"
    )

    @model_validator(mode="after")
    def _least_below_most(self) -> Self:
        if self.least_mm is not None and self.most_mm is not None and self.least_mm >= self.most_mm:
            raise ValueError(f"least_mm {self.least_mm:g} is not below most_mm {self.most_mm:g}")
        return self


class CaptureConfig(Section):
    """Defaults of captures."""

    on_interruption: OnInterruption = Field(
        "continue",
        description="what to do if the device stops delivering: continue, with the gap in the ledger, or end",
    )


class AnalysisConfig(Section):
    """Analysis of a device's captures."""

    when_sealed: bool = Field(
        False,
        description="analyse every capture as soon as it is sealed; applies to captures started after the "
        "daemon was first started with this setting",
    )
    inputs: ExistingFile | None = Field(
        None,
        description="inputs besides the points, as for `grabberd analyse --inputs`; completed by the "
        "profiles that a capture's labels select",
    )


class MarkConfig(Section):
    """A mark's place in the picture, to within four pixels; calibrating learns it exactly."""

    x_px: float = Field(ge=0, lt=LARGEST_SIDE_PX, description="column of its centre")
    y_px: float = Field(ge=0, lt=LARGEST_SIDE_PX, description="frame line of its centre")


class DeviceConfig(Section):
    """One grabber, the rig in front of it, and how its fields are processed."""

    driver: str = Field(description="name of the driver; `grabberd devices` lists them")
    options: dict[str, Any] = Field(default_factory=dict, description="the driver's own options")
    rig: RigConfig = RigConfig()
    calibration: ExistingFile | None = Field(
        None, description="calibration (JSON) to measure with, unless another one is activated"
    )
    object: ExistingFile | None = Field(None, description="object model (YAML) to measure")
    ring: RingConfig = RingConfig()
    threshold: ThresholdConfig = ThresholdConfig()
    location: LocationConfig = LocationConfig()
    targets: TargetsConfig = TargetsConfig()
    capture: CaptureConfig = CaptureConfig()
    analysis: AnalysisConfig = AnalysisConfig()
    marks: list[MarkConfig] = Field(
        default_factory=list,
        max_length=MOST_MARKS,
        description="discs glued to the cup, which hold the calibration: in opposite corners of each view, "
        "better in all four",
    )
    line_jitter_px: float = Field(0.12, ge=0, le=2, description="σ of the line jitter, in frame pixels")
    spread_px: float = Field(
        0.8, gt=0, le=5, description="σ of the spread function of lens and camera, in frame pixels"
    )

    @model_validator(mode="after")
    def _marks_can_be_located(self) -> Self:
        problems = [*_crowded(self.marks), *_at_the_edge(self.marks, self.rig), *_alone(self.marks, self.rig)]
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @model_validator(mode="after")
    def _map_belongs_to_one_bit(self) -> Self:
        if self.threshold.map and self.ring.bits != 1:
            raise ValueError(f"threshold.map needs ring.bits: 1, not {self.ring.bits}")
        return self


def _crowded(marks: list[MarkConfig]) -> list[str]:
    """Marks that are named twice, or whose windows show a neighbour."""
    return [
        f"marks {first} and {second} are {apart_px:.3g} px apart, at least {CLEAR_PX:g} px are needed: "
        "name each disc once in each view"
        for (first, one), (second, other) in combinations(enumerate(marks, 1), 2)
        if (apart_px := math.hypot(one.x_px - other.x_px, one.y_px - other.y_px)) < CLEAR_PX
    ]


def _at_the_edge(marks: list[MarkConfig], rig: RigConfig) -> list[str]:
    """Marks that are cut by the edge of their view once they move, or lie in none."""
    return [
        f"mark {number} at column {one.x_px:g}, line {one.y_px:g} lies less than {CLEAR_PX:g} px inside a "
        "view: glue it further in, or leave it out"
        for number, one in enumerate(marks, 1)
        if not any(_holds(view, rig.lines, one, CLEAR_PX) for view in _views(rig).values())
    ]


def _alone(marks: list[MarkConfig], rig: RigConfig) -> list[str]:
    """Views with fewer marks than show a movement."""
    counts = {
        name: sum(_holds(view, rig.lines, one, 0.0) for one in marks) for name, view in _views(rig).items()
    }
    return [
        f"the {name} view has a single mark, which does not tell a shift from a turn: add one in the "
        "opposite corner, or leave it out"
        for name, count in counts.items()
        if 0 < count < LEAST_PLACES
    ]


def _views(rig: RigConfig) -> dict[str, ViewColumns]:
    return {"left": rig.views.left, "right": rig.views.right}


def _holds(view: ViewColumns, lines: int, mark: MarkConfig, inside_px: float) -> bool:
    across = view.first_column + inside_px <= mark.x_px <= view.end_column - 1 - inside_px
    return across and inside_px <= mark.y_px <= lines - 1 - inside_px
