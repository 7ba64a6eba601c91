"""Every option of the simulated grabber, with its default and its range.

    FakeGrabber(scene="liner", rig={"reflections": 1}, picture={"noise": 0.05}, faults=[{"at_s": 1, "kind":
    "lose"}])

All options have defaults, which give the reference rig before the pulsating liner. `rig`, `camera` and
the scene determine the truth; `picture` determines how the camera renders it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from grabberd_fake.faults import KINDS, Fault
from grabberd_fake.light_options import LightOptions
from grabberd_fake.liner_options import EllipseOptions, LinerOptions
from grabberd_fake.reading import (
    Group,
    ListOf,
    Number,
    OneOfKinds,
    Text,
    by,
    choice,
    flag,
    integer,
    number,
    read,
    ruled,
)


@dataclass(frozen=True, slots=True)
class CameraOptions:
    """The one real camera.

    Attributes:
        f_mm: focal length (principal distance).
        pixel_x_mm: pixel pitch along a line; `pixel_y_mm`: from frame line to frame line.
        x0_px: principal point, column; `y0_px`: sensor line.
        radial: k3, k5, k7 of dr = k3 r³ + k5 r⁵ + k7 r⁷ in mm⁻², mm⁻⁴, mm⁻⁶.
        decentering: p1, p2 in mm⁻¹.
    """

    f_mm: float = number(8.0, 2, 100)
    pixel_x_mm: float = number(0.0086, 0.002, 0.05)
    pixel_y_mm: float = number(0.0083, 0.002, 0.05)
    x0_px: float = number(363.2, 260, 460)
    y0_px: float = number(284.6, 200, 375)
    radial: tuple[float, ...] = ruled(ListOf(Number(-0.01, 0.01)), (-7e-4, 8e-6, 0.0))
    decentering: tuple[float, ...] = ruled(ListOf(Number(-0.01, 0.01)), (8e-5, -6e-5))

    def check(self) -> Iterator[str]:
        """Problems that involve several keys."""
        if len(self.radial) != 3:
            yield f"radial: {list(self.radial)} has not 3 numbers"
        if len(self.decentering) != 2:
            yield f"decentering: {list(self.decentering)} has not 2 numbers"


@dataclass(frozen=True, slots=True)
class PointOption:
    """A disc of the scene `points`, or on the cup; it faces along (nx, ny, nz), by default up."""

    id: int = ruled(Number(0, 2**31 - 1, whole=True))
    x_mm: float = ruled(Number(-200, 200))
    y_mm: float = ruled(Number(-200, 200))
    z_mm: float = ruled(Number(-100, 100))
    nx: float = number(0.0, -1, 1)
    ny: float = number(0.0, -1, 1)
    nz: float = number(1.0, -1, 1)

    def check(self) -> Iterator[str]:
        """Problems that involve several keys."""
        if self.nx == self.ny == self.nz == 0:
            yield "nx, ny, nz: all zero"


@dataclass(frozen=True, slots=True)
class RigOptions:
    """Camera, mirrors and cup.

    Attributes:
        base_mm: nominal distance of the virtual projection centres.
        distance_mm: nominal height of the projection centres above the object's origin.
        reflections: mirrors per view: 2 (handedness +1) or 1 (handedness -1).
        fold_mm: with two mirrors, distance before the camera at which the inner one folds the middle ray.
        mirror_tilt_mrad: σ of each mirror's misalignment about each axis.
        mirror_shift_mm: σ of each mirror's displacement along its normal.
        camera_tilt_mrad: σ of the camera's misalignment about each axis.
        camera_shift_mm: σ of the camera's displacement along each axis.
        mirror_error_px: rms over a half picture of the mirrors' local unmodelled displacements.
        seed: seed of misalignments and mirror errors; each seed is one particular rig.
        marks: discs fixed to the cup, of the targets' diameter, which no object knows.
    """

    base_mm: float = number(128.0, 20, 400)
    distance_mm: float = number(240.0, 60, 2000)
    reflections: int = choice(2, 1)
    fold_mm: float = number(20.0, 5, 60)
    mirror_tilt_mrad: float = number(3.0, 0, 30)
    mirror_shift_mm: float = number(0.3, 0, 5)
    camera_tilt_mrad: float = number(4.0, 0, 30)
    camera_shift_mm: float = number(0.5, 0, 5)
    mirror_error_px: float = number(0.06, 0, 2)
    seed: int = integer(1, 0, 2**32 - 1)
    marks: tuple[PointOption, ...] = ruled(ListOf(Group(PointOption)), ())


@dataclass(frozen=True, slots=True)
class PictureOptions:
    """The camera's picture of the scene. Grey values are those of the 8-bit picture before gamma and gain.

    Attributes:
        background: grey value between the targets; `contrast`: difference of the targets' grey value.
        noise: σ of each pixel's noise in units of `contrast`, independent for every field.
        jitter_px: σ of each field line's shift, which both halves share.
        spread_x_px: Gaussian spread (σ) of lens, sensor and video along a line, columns.
        spread_y_px: across the lines, frame lines.
        field_integration: row k of parity p collects sensor lines 2k+p and 2k+p+1; otherwise 2k+p alone.
        exposure_ms: exposure time, centred on the field's time.
        gamma: grey value out = 255 (grey value in / 255)^gamma.
        agc_level: mean grey value that the automatic gain aims at; null: no gain control.
        agc_fields: time constant of the gain control.
        uneven_light: the light varies smoothly by ± this proportion over the picture.
        stamp: field number and parity stand in the top left corner.
    """

    background: float = number(20.0, 0, 200)
    contrast: float = number(190.0, 1, 300)
    noise: float = number(0.02, 0, 0.5)
    jitter_px: float = number(0.12, 0, 0.5)
    spread_x_px: float = number(0.8, 0.3, 2.5)
    spread_y_px: float = number(0.8, 0.3, 2.5)
    field_integration: bool = flag(True)
    exposure_ms: float = number(1.0, 0, 20)
    gamma: float = number(1.0, 0.2, 3)
    agc_level: float | None = number(None, 1, 254, optional=True)
    agc_fields: float = number(12.0, 1, 1000)
    uneven_light: float = number(0.0, 0, 0.6)
    stamp: bool = flag(True)


@dataclass(frozen=True, slots=True)
class DriverOptions:
    """Way in which the driver hands fields over.

    Attributes:
        order: `alternate`, a field a buffer; frames of two, `top_first` or `bottom_first`; or `progressive`,
            pictures of 576 lines, without field integration and line jitter.
        rate_hz: fields, or progressive pictures, per second.
        stamps: time of the `exposure`, or of the `arrival` with the reader.
        counts: what the sequence counts: `fields`, `frames`, whose fields share a number, or `nothing`.
        jitter_ms: timestamps are late by up to so much.
        late: share of timestamps that are late by `late_ms` more on average, exponentially.
    """

    order: str = choice("alternate", "top_first", "bottom_first", "progressive")
    rate_hz: float = number(50.0, 5, 250)
    stamps: str = choice("exposure", "arrival")
    counts: str = choice("fields", "frames", "nothing")
    jitter_ms: float = number(0.0, 0, 20)
    late: float = number(0.0, 0, 1)
    late_ms: float = number(25.0, 1, 1000)

    @property
    def is_progressive(self) -> bool:
        """True if every picture has all lines."""
        return self.order == "progressive"

    @property
    def a_buffer(self) -> int:
        """Number of fields in a buffer."""
        return 2 if self.order in ("top_first", "bottom_first") else 1

    @property
    def period_ns(self) -> int:
        """Time from field to field."""
        return round(1e9 / self.rate_hz)

    @property
    def arrival_ns(self) -> int:
        """Delay from the middle of a field's exposure to its arrival in the driver."""
        return self.period_ns // 2

    def check(self) -> Iterator[str]:
        """Problems that involve several keys."""
        if self.order not in ("alternate", "progressive") and self.counts == "frames":
            yield "counts: the fields of a frame come together; count 'fields' or 'nothing'"


SCENES = ("liner", "ellipse", "calibration_frame", "accuracy_object", "blank", "points")
"""Objects before the camera."""


@dataclass(frozen=True, slots=True)
class FakeOptions:
    """All options of the simulated grabber.

    Attributes:
        scene: object before the camera, one of `SCENES`.
        liner: see `LinerOptions`; `ellipse`: see `EllipseOptions`.
        points: the targets of the scene `points`.
        target_diameter_mm: diameter of the discs.
        grazing_limit_deg: greatest angle between a visible target's normal and the line of sight.
        rig: see `RigOptions`; `camera`: `CameraOptions`; `picture`: `PictureOptions`.
        light: a lamp in the picture, see `LightOptions`.
        driver: see `DriverOptions`.
        pace: `real`: fields arrive as the clock goes; `free`: as fast as they are read, each a period later.
        buffers: number of fields or frames that can wait for a reader; once all are full, new ones are lost.
        seed: seed of noise and jitter.
        faults: fault script; each entry has a `kind` and `at_s` or `at_field`, see `faults`.
        cue: path of a file whose appearance starts the script; null: it starts with the first field.
        stage: path of a file, from the working directory, that replaces the liner's wall and vacuum, and is
            followed when it changes, see `stage`; null or no such file: they are as given here.
    """

    scene: str = choice(*SCENES)
    liner: LinerOptions = field(default_factory=LinerOptions, metadata=by(Group(LinerOptions)))
    ellipse: EllipseOptions = field(default_factory=EllipseOptions, metadata=by(Group(EllipseOptions)))
    points: tuple[PointOption, ...] = ruled(ListOf(Group(PointOption)), ())
    target_diameter_mm: float = number(1.5, 0.2, 5)
    grazing_limit_deg: float = number(65.0, 10, 85)
    rig: RigOptions = field(default_factory=RigOptions, metadata=by(Group(RigOptions)))
    camera: CameraOptions = field(default_factory=CameraOptions, metadata=by(Group(CameraOptions)))
    picture: PictureOptions = field(default_factory=PictureOptions, metadata=by(Group(PictureOptions)))
    light: LightOptions = field(default_factory=LightOptions, metadata=by(Group(LightOptions)))
    driver: DriverOptions = field(default_factory=DriverOptions, metadata=by(Group(DriverOptions)))
    pace: str = choice("real", "free")
    buffers: int = integer(16, 2, 32)
    seed: int = integer(0, 0, 2**32 - 1)
    faults: tuple[Fault, ...] = ruled(ListOf(OneOfKinds(KINDS)), ())
    cue: str | None = ruled(Text(), None)
    stage: str | None = ruled(Text(), None)

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> "FakeOptions":
        """Reads the `options` of a configuration.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        options = read(cls, values)
        if options.driver.is_progressive:
            whole = replace(options.picture, field_integration=False, jitter_px=0.0)
            options = replace(options, picture=whole)
        return options

    def check(self) -> Iterator[str]:
        """Problems that involve several keys."""
        ids = [point.id for point in self.points]
        if len(set(ids)) < len(ids):
            yield "points: an id is given twice"
        if self.points and self.scene != "points":
            yield f"points: given, but the scene is {self.scene!r}"
        if self.stage is not None and self.scene != "liner":
            yield f"stage: given, but the scene is {self.scene!r}, not 'liner'"
