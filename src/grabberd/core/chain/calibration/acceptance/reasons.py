"""Reasons that speak against a calibration, graded into levels: from the calibration frame, whether its file
names and places its targets as they stand; from the pictures: movement, number of fields, targets seen, focus
and light; from the adjustment: its residuals, what it left out, and the accuracy that it promises.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np

from grabberd.core.calibration.calibration_frame import (
    DisplacedTarget,
    LeftOver,
    displaced_targets,
    grid_order,
    pitch_mm,
    swapped_axes,
)
from grabberd.core.calibration.residuals import Pattern
from grabberd.core.chain.calibration.calibration_result import CalibrateResult
from grabberd.core.reconstruction import ObjectModel

Level = Literal["failed", "remark"]
FAILED: Level = "failed"
REMARK: Level = "remark"

Value = float | int | str


@dataclass(frozen=True, slots=True)
class Reason:
    """One thing that speaks against a calibration.

    Attributes:
        code: Name of the reason, for programs and translations.
        level: `failed` if the calibration must not be used for it, `remark` if somebody should know.
        message: What was found, with values, as a sentence without a full stop.
        hint: What to do.
        values: The values, for translations.
    """

    code: str
    level: Level
    message: str
    hint: str
    values: Mapping[str, Value] = field(default_factory=dict)


def remark(code: str, message: str, hint: str, values: Mapping[str, Value] | None = None) -> Reason:
    """A reason that leaves the calibration usable."""
    return Reason(code, REMARK, message, hint, values or {})


class Limits(NamedTuple):
    """Values above which there is a remark, and above which a calibration fails."""

    remark: float
    failed: float

    @property
    def inverted(self) -> "Limits":
        """The limits of the reciprocal, for values that must not be small."""
        return Limits(1 / self.remark, 1 / self.failed)


class Grade(NamedTuple):
    """The level that a value has reached; None for none."""

    level: Level | None

    def reason(
        self, code: str, message: str, hint: str, values: Mapping[str, Value] | None = None
    ) -> Iterator[Reason]:
        """Yield the reason if the value has reached a level."""
        if self.level is not None:
            yield Reason(code, self.level, message, hint, values or {})


def graded(value: float, limits: Limits) -> Grade:
    """Grade a value; one that is not a number fails."""
    if not value <= limits.failed:
        return Grade(FAILED)
    return Grade(REMARK if value > limits.remark else None)


DISPLACED_SHARE = Limits(0.0, 0.1)
MOST_DISPLACED = 0.5
"""Displacement in pitches from which it is another place of the grid, or none, and never a bent pin."""


def frame_reasons(result: CalibrateResult, displaced: Sequence[DisplacedTarget]) -> Iterator[Reason]:
    """Yield what is wrong with the calibration frame's file, or left open by it."""
    if result.identification.by_statement:
        yield remark(
            "stated",
            "the calibration frame looks the same in several ways: how it stands, and that the picture is "
            "not mirrored, rests on what was stated alone",
            "compare the ids in the picture with the frame, or add a further target that tells",
        )
    yield from _grid(result)
    yield from _displaced(result.frame, displaced)


def _grid(result: CalibrateResult) -> Iterator[Reason]:
    frame = result.frame
    order = grid_order(frame)
    for pair in order.swapped:
        first, second = frame.target[list(pair)].tolist()
        yield remark(
            "swapped",
            f"targets {first} and {second} are swapped in the calibration frame's file: each is where "
            "the row and column of the other belong",
            f"give target {first} the id of {second} and vice versa, or swap their rows and "
            "columns if the ids are right; the calibration, which uses positions, is not affected",
            {"first": first, "second": second, "what": "id"},
        )
    if order.astray:
        ids = ", ".join(str(frame.target[index]) for index in order.astray)
        yield remark(
            "grid_order",
            f"targets {ids} are not where their rows and columns in the calibration frame's file put them",
            "correct the ids, positions or rows and columns of these targets in the file",
            {"ids": ids},
        )


def _displaced(frame: ObjectModel, displaced: Sequence[DisplacedTarget]) -> Iterator[Reason]:
    for one, other in combinations(displaced, 2):
        if axes := ", ".join(swapped_axes(one, other, frame)):
            first, second = int(frame.target[one.target]), int(frame.target[other.target])
            displaced = [each for each in displaced if each not in (one, other)]
            yield remark(
                "swapped",
                f"targets {first} and {second} are swapped in the calibration frame's file: each has the "
                f"{axes} of the other",
                f"swap their {axes} in the file, and calibrate again",
                {"first": first, "second": second, "what": axes},
            )
    yield from _far(frame, displaced)
    said = "; ".join(
        f"{frame.target[one.target]} by {one.distance_mm:.2f} mm "
        "(x {:+.2f}, y {:+.2f}, z {:+.2f})".format(*one.shift_mm)
        for one in displaced
    )
    short = ", ".join(f"{frame.target[one.target]} ({one.distance_mm:.2f} mm)" for one in displaced)
    yield from graded(len(displaced) / len(frame), DISPLACED_SHARE).reason(
        "displaced",
        f"targets are not where the calibration frame's file places them: {said}",
        "measure these targets again, correct the file, and recalibrate",
        {"n": len(displaced), "ids": short},
    )


def _far(frame: ObjectModel, displaced: Sequence[DisplacedTarget]) -> Iterator[Reason]:
    """Yield targets that stand elsewhere altogether, however few: an error of the file, or a wrong frame."""
    far = [one for one in displaced if one.distance_mm > MOST_DISPLACED * pitch_mm(frame)]
    if far:
        ids = ",".join(str(frame.target[one.target]) for one in far)
        yield Reason(
            "elsewhere",
            FAILED,
            f"more than half a pitch from where the calibration frame's file places them: target {ids}; the "
            "file is wrong, or the picture shows another frame",
            f"correct the file, or leave out what is wrong by --drop {ids}, and calibrate again",
            {"n": len(far), "ids": ids},
        )


def displaced_of(result: CalibrateResult) -> tuple[DisplacedTarget, ...]:
    """Find the targets that both views show elsewhere, and of which an image point was left out for it."""
    kept = result.adjustment.network
    seen = [np.isin(np.arange(len(result.frame)), kept.target[kept.view == view]) for view in range(2)]
    missing = np.flatnonzero(~(seen[0] & seen[1]))
    left, right = (
        LeftOver(images.xy_px[free], side.target[free])
        for images, side in zip(result.images, result.identification, strict=True)
        for free in [np.isin(side.target, (-1, *missing))]
    )
    return displaced_targets(result.views, result.frame, missing, left, right)


MOVED_PX = Limits(0.04, 0.1)
"""A stand at rest shows .013 px at 8 bits and .021 at 1, a drift of .2 px over the capture .06."""
CREEP_PX, CREEP_Z = 0.03, 4.5
"""A steady drift of which there is a remark, even where all movement together is less: both are exceeded."""
ENOUGH_FIELDS = 16
UNSEEN_SHARE = Limits(0.1, 0.5)
LARGE_DISC = 2.1
"""Area of a disc over that of its geometric image; in focus it is 1.5 to 1.7."""
UNEVEN_DISCS, UNEVEN_SIGMA = 1.5, 2.0
"""Ratios between the views, of these areas and of the pointing σ."""


def picture_reasons(result: CalibrateResult) -> Iterator[Reason]:
    """Yield what is wrong with the pictures."""
    yield from _movement(result)
    yield from _depth(result)
    yield from _seen(result)
    yield from _merging(result)
    yield from _focus(result)
    yield from _light(result)


def _movement(result: CalibrateResult) -> Iterator[Reason]:
    moved = max(one.rms_px for one in result.stillness)
    drift = max(result.stillness, key=lambda one: one.drift_px)
    creeps = drift.drift_px > CREEP_PX and drift.drift_px > CREEP_Z * drift.drift_sigma_px
    grade = graded(moved, MOVED_PX)
    yield from (Grade(REMARK) if creeps and grade.level is None else grade).reason(
        "moved",
        f"the picture moved by {moved:.2f} px rms during the capture, {drift.drift_px:.2f} px of it steadily",
        "fasten the calibration frame's stand, touch nothing, and repeat the capture",
        {"px": max(moved, drift.drift_px) if creeps else moved},
    )
    count = result.images[0].of_fields
    if result.repeated:
        yield remark(
            "repeated",
            f"{result.repeated} of {count + result.repeated} fields repeat the one before, and are left out",
            "record without repetitions: 'grabberd inspect' says which pictures repeat",
            {"n": result.repeated, "of": count + result.repeated},
        )
    if count < ENOUGH_FIELDS:
        yield remark(
            "short",
            f"only {count} fields: too few to average out noise and line jitter",
            "take two seconds or more",
            {"n": count},
        )


def _depth(result: CalibrateResult) -> Iterator[Reason]:
    if result.bits == 1 and result.y_step == 2:
        yield remark(
            "one_bit",
            "the fields have 1 bit and 288 lines: σ of the calibration, and of all points measured with it, "
            "may be wrong by a factor of up to 1.7",
            "calibrate from 8 bits, or from 1 bit with doubled lines",
        )


def _seen(result: CalibrateResult) -> Iterator[Reason]:
    of, network = len(result.frame), result.adjustment.network
    for index, view in enumerate(result.views):
        found = int((network.view == index).sum())
        yield from graded(1 - found / of, UNSEEN_SHARE).reason(
            "few",
            f"the {view.name} view shows {found} of {of} targets",
            "move the calibration frame until both views show all of it; check light and threshold",
            {"view": view.name, "n": found, "of": of},
        )


def _merging(result: CalibrateResult) -> Iterator[Reason]:
    for view, targets in zip(result.views, result.merging, strict=True):
        if len(targets):
            ids = ", ".join(str(one) for one in result.frame.target[targets])
            yield remark(
                "merging",
                f"discs overlap in the {view.name} view: targets {ids} run into each other there, and were "
                "left out of it",
                "turn the calibration frame until both views show its discs apart, or use one with smaller "
                "steps in depth",
                {"view": view.name, "n": len(targets), "ids": ids},
            )


def _focus(result: CalibrateResult) -> Iterator[Reason]:
    for view, share in zip(result.views, result.disc_share, strict=True):
        if share > LARGE_DISC:
            yield remark(
                "large",
                f"the discs of the {view.name} view appear {share:.1f} times as large as their geometric "
                "image: the picture is out of focus, or far too bright",
                "focus the lens until the targets are smallest; close the iris a little",
                {"view": view.name, "times": share},
            )


def _light(result: CalibrateResult) -> Iterator[Reason]:
    areas, sigmas = result.disc_share, result.view_sigma_px
    darker = result.views[sigmas.index(max(sigmas))].name
    larger, less_certain = max(areas) / min(areas), max(sigmas) / min(sigmas)
    if larger > UNEVEN_DISCS or less_certain > UNEVEN_SIGMA:
        yield remark(
            "uneven",
            f"the {darker} view is darker than the other: its targets are {less_certain:.1f} times as "
            f"uncertain, and the areas of the discs differ by a factor of {larger:.1f}",
            "light both views alike; clean the mirrors of the darker one",
            {"view": darker, "times": less_certain},
        )


LEFT_OUT_SHARE = Limits(0.0, 0.1)
SIGMA0_LOW, SIGMA0_HIGH = Limits(0.7, 0.3), Limits(1.5, 3.0)
UNMODELLED_PX = Limits(0.15, 0.6)
"""Well above the .06 px of uneven mirrors."""
PATTERN_Z, PATTERN_CORRELATION = 6.0, 0.25
HELD_OUT_MM = EXPECTED_MM = Limits(0.15, 0.5)


def adjustment_reasons(
    result: CalibrateResult, patterns: Sequence[Pattern], displaced: Sequence[DisplacedTarget]
) -> Iterator[Reason]:
    """Yield what the adjustment tells against itself."""
    yield from _left_out(result, {one.target for one in displaced})
    yield from _sigma0(result.adjustment.sigma0)
    yield from _unmodelled(result.unmodelled_px)
    yield from _bent(patterns)
    yield from _validation(result)
    yield from _expected(result)


def _left_out(result: CalibrateResult, explained: set[int]) -> Iterator[Reason]:
    blunders = [one for one in result.blunders if one.target not in explained]
    ids = ", ".join(f"{one.view} {result.frame.target[one.target]}" for one in blunders)
    share = len(blunders) / (len(blunders) + result.image_points)
    yield from graded(share, LEFT_OUT_SHARE).reason(
        "left_out",
        f"{len(blunders)} image points contradict the others and were left out: {ids}",
        "check whether anything covers these targets or shines on them; measure their positions again",
        {"n": len(blunders), "ids": ids},
    )


def _sigma0(sigma0: float) -> Iterator[Reason]:
    yield from graded(1 / max(sigma0, 1e-9), SIGMA0_LOW.inverted).reason(
        "sigma0",
        f"σ0 is {sigma0:.2f}: the residuals are smaller than the stated σ allows, so it is stated too large",
        "check sigma_mm in the calibration frame's file",
        {"sigma0": sigma0},
    )
    yield from graded(sigma0, SIGMA0_HIGH).reason(
        "sigma0",
        f"σ0 is {sigma0:.2f}: the residuals are larger than the stated σ allows",
        "adjust more parameters; check the calibration frame's file",
        {"sigma0": sigma0},
    )


def _unmodelled(unmodelled_px: float) -> Iterator[Reason]:
    yield from graded(unmodelled_px, UNMODELLED_PX).reason(
        "unmodelled",
        f"the image points are off by {unmodelled_px:.2f} px beyond their own σ: dirty or bent mirrors, a "
        "calibration frame that differs from its file, or parameters that were held",
        "clean the mirrors, measure the calibration frame again, or adjust more parameters",
        {"px": unmodelled_px},
    )


def _bent(patterns: Sequence[Pattern]) -> Iterator[Reason]:
    for one in patterns:
        if one.statistic > PATTERN_Z and one.correlation > PATTERN_CORRELATION:
            yield remark(
                "pattern",
                f"neighbouring residuals of the {one.view} view are correlated ({one.correlation:.2f}): "
                "the picture is distorted in a way that no parameter describes",
                "clean and straighten the mirrors of that view; leave the local field switched on",
                {"view": one.view, "correlation": one.correlation},
            )


def _validation(result: CalibrateResult) -> Iterator[Reason]:
    if result.validation is None:
        yield remark(
            "unvalidated",
            f"the calibration could not be cross-validated: {result.unvalidated}",
            "show more targets in both views",
        )
        return
    missed = float(result.validation.rmse_mm[-1])
    yield from graded(missed, HELD_OUT_MM).reason(
        "missed",
        f"targets that were held out are missed by {missed:.3f} mm",
        "check the calibration frame's file, and take a longer capture with more light",
        {"mm": missed},
    )


def _expected(result: CalibrateResult) -> Iterator[Reason]:
    variance = (result.volume.sigma_mm**2).sum(axis=-1)
    expected = float(np.sqrt(np.nanmedian(variance)))
    yield from graded(expected, EXPECTED_MM).reason(
        "coarse",
        f"the σ of a point of one field is {expected:.3f} mm",
        "capture with 8 bits, more light and a sharp picture",
        {"mm": expected},
    )
