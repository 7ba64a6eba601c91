"""The wrong set-ups: what is wrong, and the words that tell it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.calibration import CheckLength
from grabberd.core.chain.calibration.acceptance.verdict import AcceptanceInputs, judge
from grabberd.core.chain.calibration.calibrate import calibrate
from grabberd.core.chain.calibration.calibration_result import CalibrateSettings
from grabberd.core.field import NumberedField
from grabberd.core.geometry import NominalRig
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import MeasurementError
from proofs.setups.pictures import (
    covered,
    dimmed,
    fields,
    frame,
    mirrored,
    moving,
    picture,
    picture_of,
    swapped,
)

NOMINAL = NominalRig(720, 576, (0, 360), (360, 720), 240.0, 128.0, 30.0, 8.0, 0.0086, 0.0083)
STATED = replace(NOMINAL, handedness=(1, 1))
ENDS = (1, 108)
UNREMARKED = "passed"


@dataclass(frozen=True, slots=True)
class Setup:
    """A set-up of a calibration; the defaults are right.

    Attributes:
        wrong: What is wrong, in words.
        told: Words that the user must be told: of a refusal's message or hint, or a reason's code.
        shown: The fields that the grabber delivers.
        nominal: The configured rig.
        model: The calibration frame's file.
        length: The check length; None for none.
    """

    wrong: str
    told: str
    shown: Callable[[], Iterator[NumberedField]] = lambda: fields(picture())
    nominal: NominalRig = STATED
    model: Callable[[], ObjectModel] = frame
    length: Callable[[], CheckLength | None] = lambda: _certified()  # noqa: PLW0108 - it is defined below
    settings: CalibrateSettings | None = None


@dataclass(frozen=True, slots=True)
class Told:
    """What the user is told: the verdict, or that it was refused, and the lines in order."""

    verdict: str
    lines: tuple[str, ...]
    codes: tuple[str, ...]

    def says(self, words: str) -> bool:
        return words in self.codes or any(words in line for line in self.lines)


def _certified() -> CheckLength:
    """A certificate of the true frame, whatever its file says."""
    first, second = frame().xyz_mm[[0, -1]]
    return CheckLength(*ENDS, float(np.linalg.norm(second - first)), 0.02)


def tried(setup: Setup) -> Told:
    """Calibrate as the command does, and collect what it says."""
    try:
        result = calibrate([setup.shown()], setup.nominal, setup.model(), setup.settings)
    except MeasurementError as error:
        return Told("refused", (f"{error.message} – {error.hint}",), ())
    found = judge(result, AcceptanceInputs(None, setup.length()))
    return Told(
        str(found.verdict),
        tuple(f"{one.level}: {one.message} – {one.hint}" for one in found.reasons),
        tuple(one.code for one in found.reasons),
    )


def placed(change: Callable[[np.ndarray], None]) -> Callable[[], ObjectModel]:
    """The frame's file with other places."""

    def changed() -> ObjectModel:
        xyz = frame().xyz_mm.copy()
        change(xyz)
        return replace(frame(), xyz_mm=xyz)

    return changed


def _scaled(factor: float) -> Callable[[], ObjectModel]:
    return lambda: replace(frame(), xyz_mm=factor * frame().xyz_mm)


def _rows_alike() -> ObjectModel:
    depth = np.array([0.0, 5.0, -3.0, 4.0, -6.0, 2.0, 6.0, -5.0, 1.0])
    return replace(frame(), xyz_mm=np.column_stack([frame().xyz_mm[:, :2], depth[frame().column]]))


def _first_rows_differ() -> ObjectModel:
    alike = _rows_alike()
    depth = np.where(alike.row < 2, frame().xyz_mm[:, 2], alike.xyz_mm[:, 2])
    return replace(alike, xyz_mm=np.column_stack([alike.xyz_mm[:, :2], depth]))


def _half_turn() -> ObjectModel:
    """Depths that are the same after a turn by 180 degrees."""
    row, column = frame().row - 5.5, frame().column - 4.0
    depth = 5 * np.sin(1.7 * row + 2.3 * column) * np.sign(row * 10 + column + 1e-9)
    return replace(frame(), xyz_mm=np.column_stack([frame().xyz_mm[:, :2], depth]))


def _swap(xyz: np.ndarray) -> None:
    xyz[[40, 41]] = xyz[[41, 40]]


def _swap_z(xyz: np.ndarray) -> None:
    xyz[[40, 41], 2] = xyz[[41, 40], 2]


def _displace(xyz: np.ndarray, by_mm: float) -> None:
    xyz[40, 0] += by_mm


def _none() -> None:
    return None


SETUPS = (
    Setup("halves of the picture swapped", "the views are swapped", lambda: fields(swapped(picture()))),
    Setup("whole picture mirrored", "mirrored as a whole", lambda: fields(picture()[:, ::-1])),
    Setup(
        "left half mirrored",
        "the left view is seen mirrored",
        lambda: fields(mirrored(picture(), right=False)),
    ),
    Setup(
        "right half mirrored",
        "the right view is seen mirrored",
        lambda: fields(mirrored(picture(), left=False)),
    ),
    Setup(
        "both halves mirrored in place", "both views are seen mirrored", lambda: fields(mirrored(picture()))
    ),
    Setup(
        "both views through one mirror, rig states two",
        "mirrored",
        lambda: fields(picture(one_mirror=True)),
    ),
    Setup(
        "both views through one mirror, rig states nothing",
        "left_handed",
        lambda: fields(picture(one_mirror=True)),
        nominal=NOMINAL,
    ),
    Setup("frame's file 2 % too large, a check length", "check_length", model=_scaled(1.02)),
    Setup(
        "frame's file 2 % too large, no check length", "no_check_length", model=_scaled(1.02), length=_none
    ),
    Setup("frame's file .2 % too small, a check length", "check_length", model=_scaled(0.998)),
    Setup("frame's file in cm instead of mm", "in cm instead of mm", model=_scaled(0.1)),
    Setup("frame's file in inches instead of mm", "in inches instead of mm", model=_scaled(1 / 25.4)),
    Setup(
        "rows of the frame alike",
        "its rows are alike",
        lambda: fields(picture_of(_rows_alike().xyz_mm)),
        model=_rows_alike,
    ),
    Setup(
        "frame that a half turn maps onto itself",
        "a turn by",
        lambda: fields(picture_of(_half_turn().xyz_mm)),
        model=_half_turn,
    ),
    Setup(
        "rows alike but for the first two, outer rows covered",
        "looks the same shifted by",  # by one row or two: both explain every blob
        lambda: fields(covered(picture_of(_first_rows_differ().xyz_mm), 150, 426)),
        model=_first_rows_differ,
    ),
    Setup("two targets of the file swapped", "targets 41 and 42 are swapped", model=placed(_swap)),
    Setup(
        "depths of two targets of the file swapped",
        "each has the z of the other",
        model=placed(_swap_z),
    ),
    Setup("a target displaced by .4 mm", "41 by 0.4", model=placed(lambda xyz: _displace(xyz, 0.4))),
    Setup("a target displaced by 3 mm", "41 by 3.0", model=placed(lambda xyz: _displace(xyz, 3.0))),
    Setup(
        "focal length of the rig 9.5 mm instead of 7.7",
        "focal length",
        nominal=replace(STATED, focal_length_mm=9.5),
    ),
    Setup(
        "focal length of the rig 12 mm instead of 7.7",
        "focal length",
        nominal=replace(STATED, focal_length_mm=12.0),
    ),
    Setup(
        "focal length of the rig 6 mm instead of 7.7",
        "focal length",
        nominal=replace(STATED, focal_length_mm=6.0),
    ),
    Setup(
        "distance and base of the rig a quarter too large",
        "the distance comes out as",
        nominal=replace(STATED, distance_mm=300.0, base_mm=160.0),
    ),
    Setup(
        "principal point 60 px aside",
        "principal point in x",
        nominal=replace(STATED, left=(0, 360), columns=840),
    ),
    Setup("stand sinks by .25 px", "moved", lambda: moving(picture(), 0.25)),
    Setup("stand sinks by .6 px", "moved", lambda: moving(picture(), 0.6)),
    Setup("stand sinks by 4 px", "the calibration frame moved", lambda: moving(picture(), 4.0)),
    Setup(
        "σ of the frame's file .05 mm, its error .01 mm (σ0 near .4)",
        "sigma0",
        model=lambda: replace(frame(), sigma_mm=0.05),
    ),
    Setup(
        "σ of the frame's file .1 mm, its error .01 mm",
        "sigma0",
        model=lambda: replace(frame(), sigma_mm=0.1),
    ),
    Setup("picture out of focus", "large", lambda: fields(picture(3.0))),
    Setup("right half at a quarter of the brightness", "uneven", lambda: fields(dimmed(picture(), 0.25))),
    Setup("right half dark", "the right view is dark", lambda: fields(dimmed(picture(), 0.0))),
    Setup("a third of the targets covered", "few", lambda: fields(covered(picture(), 230))),
    Setup("nine targets in ten covered", "at least 12 are needed", lambda: fields(covered(picture(), 475))),
    Setup("four fields only", "short", lambda: fields(picture(), count=2)),
    Setup(
        "lens terms held",
        "pattern",
        settings=CalibrateSettings(
            free=tuple(
                f"{one}" for one in ("f_mm", "omega_rad", "phi_rad", "kappa_rad", "X0_mm", "Y0_mm", "Z0_mm")
            ),
            local_field=False,
        ),
    ),
)
