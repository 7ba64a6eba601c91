"""The wrong set-ups: what is wrong, and the words that tell it, by the kind of calibration frame."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from grabberd.core.calibration.significance import CheckLength
from grabberd.core.chain.calibration.acceptance.verdict import AcceptanceInputs, judge
from grabberd.core.chain.calibration.calibrate import calibrate
from grabberd.core.chain.calibration.calibration_result import CalibrateSettings
from grabberd.core.field import NumberedField
from grabberd.core.geometry import NominalRig
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import GrabberdError
from proofs.setups.pictures import (
    FRAMES,
    covered,
    creeping,
    dimmed,
    fields,
    made,
    mirrored,
    model,
    moving,
    picture,
    picture_of,
    swapped,
)

NOMINAL = NominalRig(720, 576, (0, 360), (360, 720), 240.0, 128.0, 30.0, 8.0, 0.0086, 0.0083)
STATED = replace(NOMINAL, handedness=(1, 1))
ENDS = (1, 108)
UNREMARKED = "passed"
ASKED = "does not tell how"
"""Words of a refusal that asks how the frame stands."""

Shown = Callable[[str, int], Iterator[NumberedField]]
"""Fields that the grabber delivers, of a frame and with so many bits."""
Files = Callable[[ObjectModel], ObjectModel]


@dataclass(frozen=True, slots=True)
class Shift:
    """A target that is not where the file places it; its shift must be told to three of its σ."""

    target: int
    by_mm: tuple[float, float, float]

    def is_told_in(self, lines: Sequence[str]) -> bool:
        number = r"([+-]\d+\.\d+)"
        shift = re.compile(rf"\b{self.target} by \d+\.\d+ mm \(x {number}, y {number}, z {number}\)")
        told = [tuple(map(float, found.groups())) for line in lines for found in shift.finditer(line)]
        return any(
            all(abs(a - b) < 3 * sigma for a, b, sigma in zip(one, self.by_mm, SHIFT_SIGMA_MM, strict=True))
            for one in told
        )


SHIFT_SIGMA_MM = (0.01, 0.015, 0.045)
"""Of the place of one target that both views show; X, Y and Z."""


@dataclass(frozen=True, slots=True)
class Setup:
    """A set-up of a calibration; the defaults are right.

    Attributes:
        wrong: What is wrong, in words.
        told: What the user must be told: words of a refusal's message or hint, a reason's code, or a shift.
        shown: The fields.
        nominal: The configured rig.
        file: The calibration frame's file, made from the right one.
        length: True if a length is certified.
        settings: Settings of the calibration.
        marked, regular: Words for a frame that looks the same in several ways, but for one target or
            altogether, where they are others: only a person can tell then.
        frames: The frames that can be wrong in this way.
        answered: True if the person who calibrates a regular frame has stated how it stands.
    """

    wrong: str
    told: str | Shift
    shown: Shown = lambda frame, bits: fields(picture(frame), bits)
    nominal: NominalRig = STATED
    file: Files = lambda right: right
    length: bool = True
    settings: CalibrateSettings = field(default_factory=CalibrateSettings)
    marked: str | None = None
    regular: str | None = None
    frames: tuple[str, ...] = FRAMES
    answered: bool = True

    def told_of(self, frame: str) -> str | Shift:
        """Words that the user of this frame must be told."""
        own = {"marked": self.marked, "regular": self.regular}.get(frame)
        return self.told if own is None else own


@dataclass(frozen=True, slots=True)
class Told:
    """What the user is told: the verdict, or that it was refused, and the lines in order."""

    verdict: str
    lines: tuple[str, ...]
    codes: tuple[str, ...]

    def says(self, words: str | Shift) -> bool:
        if isinstance(words, Shift):
            return words.is_told_in(self.lines)
        return words in self.codes or any(words in line for line in self.lines)


def tried(setup: Setup, frame: str = "irregular", bits: int = 8) -> Told:
    """Calibrate as the command does, and collect what it says."""
    settings = setup.settings
    if frame == "regular" and setup.answered and settings.turn_deg is None:
        settings = replace(settings, turn_deg=0)
    length = _certified(frame) if setup.length else None
    try:
        shown, file = setup.shown(frame, bits), setup.file(model(frame))
        result = calibrate([shown], setup.nominal, file, settings)
    except GrabberdError as error:
        return Told("refused", (f"{error.message} – {error.hint}",), ())
    found = judge(result, AcceptanceInputs(None, length))
    return Told(
        str(found.verdict),
        tuple(f"{one.level}: {one.message} – {one.hint}" for one in found.reasons),
        tuple(one.code for one in found.reasons),
    )


def _certified(frame: str) -> CheckLength:
    """A certificate of the true frame, whatever its file says."""
    first, second = model(frame).xyz_mm[[0, 107]]
    return CheckLength(*ENDS, float(np.linalg.norm(second - first)), 0.02)


def _seen(change: Callable[[np.ndarray], np.ndarray]) -> Shown:
    """The right frame, its picture changed."""
    return lambda frame, bits: fields(change(picture(frame)), bits)


def placed(change: Callable[[np.ndarray], None]) -> Files:
    """The file with other places."""

    def changed(right: ObjectModel) -> ObjectModel:
        xyz = right.xyz_mm.copy()
        change(xyz)
        return replace(right, xyz_mm=xyz)

    return changed


BENT = 41


def _bent(wrong: str, by_mm: tuple[float, float, float]) -> Setup:
    """The frame with one pin bent, from where it was made."""

    def shown(frame: str, bits: int) -> Iterator[NumberedField]:
        places = made(model(frame))
        places[BENT - 1] += by_mm
        return fields(picture_of(places), bits)

    x, y, z = ((made(model()) - model().xyz_mm)[BENT - 1] + by_mm).tolist()
    return Setup(wrong, Shift(BENT, (x, y, z)), shown)


def _scaled(factor: float) -> Files:
    return lambda right: replace(right, xyz_mm=factor * right.xyz_mm)


def _with_depths(depth_mm: Callable[[ObjectModel], np.ndarray]) -> dict[str, Shown | Files]:
    """Another frame and its file."""

    def file(right: ObjectModel) -> ObjectModel:
        return replace(right, xyz_mm=np.column_stack([right.xyz_mm[:, :2], depth_mm(right)]))

    return {"file": file, "shown": lambda frame, bits: fields(picture_of(file(model(frame)).xyz_mm), bits)}


_PLATES_MM = np.array([0.0, 5.0, -3.0, 4.0, -6.0, 2.0, 6.0, -5.0, 1.0])


def _rows_alike(right: ObjectModel) -> np.ndarray:
    return _PLATES_MM[right.column]


def _half_turn(right: ObjectModel) -> np.ndarray:
    """Depths that are the same after a turn by 180 degrees."""
    row, column = right.row - 5.5, right.column - 4.0
    return 5 * np.sin(1.7 * row + 2.3 * column) * np.sign(row * 10 + column + 1e-9)


def _steep(right: ObjectModel) -> np.ndarray:
    """Neighbours along the base so different in depth that one view sees their discs run into each other."""
    return np.where(right.column % 2, 9.0, -9.0) + right.xyz_mm[:, 2] / 8


def _first_rows_differ() -> dict[str, Shown | Files]:
    def depths(right: ObjectModel) -> np.ndarray:
        return np.where(right.row < 2, right.xyz_mm[:, 2], _rows_alike(right))

    both = _with_depths(depths)
    file = both["file"]
    assert callable(file)
    places = file(model()).xyz_mm  # type: ignore[call-arg, union-attr]
    return {"file": file, "shown": lambda _, bits: fields(covered(picture_of(places), 150, 426), bits)}


def _swap(xyz: np.ndarray) -> None:
    xyz[[40, 41]] = xyz[[41, 40]]


def _swap_z(xyz: np.ndarray) -> None:
    xyz[[40, 41], 2] = xyz[[41, 40], 2]


def _displace(xyz: np.ndarray, by_mm: float, axis: int = 0) -> None:
    xyz[40, axis] += by_mm


def _negate(xyz: np.ndarray) -> None:
    xyz[38, 1] *= -1


ORIENTATION = (
    Setup("halves of the picture swapped", "the views are swapped", _seen(swapped)),
    Setup(
        "whole picture mirrored",
        "mirrored as a whole",
        _seen(lambda one: one[:, ::-1]),
        regular="if it shows none of these, it is mirrored",
        answered=False,
    ),
    Setup(
        "whole picture upside down",
        "mirrored as a whole",
        _seen(lambda one: one[::-1]),
        regular="if it shows none of these, it is mirrored",
        answered=False,
    ),
    Setup(
        "left half mirrored",
        "the left view is seen mirrored",
        _seen(lambda one: mirrored(one, right=False)),
        regular="if it shows none of these, it is mirrored",
        answered=False,
    ),
    Setup(
        "right half mirrored", "the right view is seen mirrored", _seen(lambda one: mirrored(one, left=False))
    ),
    Setup(
        "both halves mirrored in place",
        "both views are seen mirrored",
        _seen(mirrored),
        regular="if it shows none of these, it is mirrored",
        answered=False,
    ),
    Setup(
        "whole picture mirrored, rig states nothing",
        "mirrored as a whole",
        _seen(lambda one: one[:, ::-1]),
        nominal=NOMINAL,
        regular="if it shows none of these, it is mirrored",
        answered=False,
    ),
    Setup(
        "whole picture upside down, rig states nothing",
        "mirrored as a whole",
        _seen(lambda one: one[::-1]),
        nominal=NOMINAL,
        regular="if it shows none of these, it is mirrored",
        answered=False,
    ),
    Setup(
        "both views through one mirror, rig states two",
        "shows the left and right views mirrored",
        lambda frame, bits: fields(picture(frame, one_mirror=True), bits),
        regular=ASKED,
        answered=False,
    ),
    Setup(
        "both views through one mirror, rig states nothing",
        "left_handed",
        lambda frame, bits: fields(picture(frame, one_mirror=True), bits),
        nominal=NOMINAL,
        regular=ASKED,
        answered=False,
    ),
    Setup(
        "picture mirrored as a whole, its handedness given as -1",
        "the rig's configuration states +1",
        _seen(lambda one: one[:, ::-1]),
        settings=CalibrateSettings(handedness=-1),
    ),
    Setup(
        "picture mirrored as a whole, its handedness given as +1",
        "mirrored as a whole",
        _seen(lambda one: one[:, ::-1]),
        nominal=NOMINAL,
        settings=CalibrateSettings(handedness=1),
        regular="if it shows none of these, it is mirrored",
        answered=False,
    ),
    Setup(
        "a turn of 90 degrees stated, the frame stands upright",
        "a turn by 90 degrees is stated, but the picture shows",
        settings=CalibrateSettings(turn_deg=90),
    ),
    Setup(
        "how the frame stands is not stated",
        UNREMARKED,
        regular="a turn of 0 degrees if it shows target 1 top left and 9 top right",
        answered=False,
        frames=("regular",),
    ),
    Setup(
        "the mark stands in the file alone",
        ASKED,
        lambda _, bits: fields(picture("regular"), bits),
        frames=("marked",),
    ),
)
"""What is wrong with how the picture shows the frame."""

WRONG_SIGN = Setup("the sign of one coordinate wrong in the file", "--drop 39", file=placed(_negate))
"""It brings target 39 to where 43 is."""
JOINED = Setup(
    "discs of neighbours run into each other in one view",
    "run into each other",
    frames=("irregular",),
    **_with_depths(_steep),
)

FRAME = (
    Setup("frame's file 2 % too large, a check length", "check_length", file=_scaled(1.02)),
    Setup("frame's file 2 % too large, no check length", "no_check_length", file=_scaled(1.02), length=False),
    Setup("frame's file .2 % too small, a check length", "check_length", file=_scaled(0.998)),
    Setup("frame's file in cm instead of mm", "in cm instead of mm", file=_scaled(0.1)),
    Setup("frame's file in inches instead of mm", "in inches instead of mm", file=_scaled(1 / 25.4)),
    Setup("rows of the frame alike", ASKED, frames=("irregular",), **_with_depths(_rows_alike)),
    Setup(
        "frame that a half turn maps onto itself", ASKED, frames=("irregular",), **_with_depths(_half_turn)
    ),
    Setup(
        "rows alike but for the first two, outer rows covered",
        "looks the same shifted",
        frames=("irregular",),
        **_first_rows_differ(),
    ),
    JOINED,
    Setup("two targets of the file swapped", "targets 41 and 42 are swapped", file=placed(_swap)),
    Setup("depths of two targets of the file swapped", "41", file=placed(_swap_z), frames=("irregular",)),
    Setup("a target displaced by .4 mm", "41 by 0.4", file=placed(partial(_displace, by_mm=0.4))),
    Setup("a target displaced by 3 mm", "41 by 3.0", file=placed(partial(_displace, by_mm=3.0))),
    Setup("a target displaced by 13 mm", "--drop 41", file=placed(partial(_displace, by_mm=13.0))),
    WRONG_SIGN,
    _bent("a pin bent by .2 mm along X", (0.2, 0.0, 0.0)),
    _bent("a pin bent by .2 mm along Y", (0.0, 0.2, 0.0)),
    _bent("a pin bent by .2 mm along Z", (0.0, 0.0, 0.2)),
    Setup(
        "σ of the frame's file .05 mm, its error .01 mm (σ0 near .4)",
        "sigma0",
        file=lambda right: replace(right, sigma_mm=0.05),
    ),
    Setup(
        "σ of the frame's file .1 mm, its error .01 mm",
        "sigma0",
        file=lambda right: replace(right, sigma_mm=0.1),
    ),
)
"""What is wrong with the frame, or with its file."""


RIG = (
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
    Setup(
        "lens terms held",
        "pattern",
        settings=CalibrateSettings(
            free=("f_mm", "omega_rad", "phi_rad", "kappa_rad", "X0_mm", "Y0_mm", "Z0_mm"), local_field=False
        ),
    ),
)
"""What is wrong with the rig's configuration."""

PICTURE = (
    Setup("frame creeps by .06 mm along X", "moved", lambda frame, bits: creeping(frame, 0, 0.06, bits)),
    Setup("frame creeps by .06 mm along Y", "moved", lambda frame, bits: creeping(frame, 1, 0.06, bits)),
    Setup("frame creeps by .06 mm along Z", "moved", lambda frame, bits: creeping(frame, 2, 0.06, bits)),
    Setup("stand sinks by .25 px", "moved", lambda frame, bits: moving(picture(frame), 0.25, bits)),
    Setup("stand sinks by .6 px", "moved", lambda frame, bits: moving(picture(frame), 0.6, bits)),
    Setup(
        "stand sinks by 4 px",
        "the calibration frame moved",
        lambda frame, bits: moving(picture(frame), 4.0, bits),
    ),
    Setup(
        "picture out of focus",
        "large",
        lambda frame, bits: fields(picture(frame, 3.0), bits),
        frames=("irregular",),
    ),
    Setup(
        "right half at a quarter of the brightness",
        "uneven",
        _seen(lambda one: dimmed(one, 0.25)),
        frames=("irregular",),
    ),
    Setup("right half dark", "the right view is dark", _seen(lambda one: dimmed(one, 0.0))),
    Setup(
        "a third of the targets covered",
        "few",
        _seen(lambda one: covered(one, 230)),
        marked="the part in view does not tell",
        regular="the part in view does not tell",
        answered=False,
    ),
    Setup("nine targets in ten covered", "at least 12 are needed", _seen(lambda one: covered(one, 475))),
    Setup("four fields only", "short", lambda frame, bits: fields(picture(frame), bits, count=2)),
)
"""What is wrong with the picture itself."""

SETUPS = (*ORIENTATION, *FRAME, *RIG, *PICTURE)


def tried_by_number(number: int, frame: str, bits: int) -> Told:
    """The same of one of all set-ups: another process finds it by its number."""
    return tried(SETUPS[number], frame, bits)
