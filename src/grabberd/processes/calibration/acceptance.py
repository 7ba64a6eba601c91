"""Acceptance of a calibration: one verdict, and its reasons, the gravest first."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from grabberd.calibration import (
    CheckLength,
    MeasuredLength,
    Pattern,
    RigQuantity,
    Stillness,
    Symmetry,
    compared_rig,
    measured_length,
    out_of_order,
    residual_patterns,
    symmetries,
)
from grabberd.geometry import Calibration
from grabberd.processes.calibration.acceptance_reason import (
    FAILED,
    REMARK,
    Limits,
    Reason,
    graded,
)
from grabberd.processes.calibration.calibration_result import CalibrateResult
from grabberd.processes.calibration.rig_reasons import rig_reasons

ENOUGH_SEEN, LEAST_SEEN = 0.9, 0.5
ENOUGH_FIELDS = 16
FEW_LEFT_OUT, MOST_LEFT_OUT = 0.0, 0.1
SIGMA0_LOW, SIGMA0_HIGH = Limits(0.7, 0.3), Limits(1.5, 3.0)
UNMODELLED_PX = Limits(0.15, 0.6)
"""Well above the .06 px of uneven mirrors."""
HELD_OUT_MM = Limits(0.15, 0.5)
EXPECTED_MM = Limits(0.15, 0.5)
MOVED_PX = Limits(0.04, 0.1)
"""A stand at rest shows .013 px at 8 bits and .021 at 1, a drift of .2 px over the capture .06."""
CLEAR_MARGIN = 150.0
PATTERN_Z, PATTERN_CORRELATION = 6.0, 0.25
LARGE_DISC, UNEVEN_DISCS, UNEVEN_SIGMA = 2.1, 1.5, 2.0
"""Area of a disc over that of its geometric image, 1.5 to 1.7 in focus; its ratio between the views, and that
of their pointing."""
LENGTH_Z = Limits(2.5, 4.0)
LENGTH_MM = 0.01


class Verdict(StrEnum):
    """Verdict on a calibration."""

    PASSED = "passed"
    REMARKS = "passed_with_remarks"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, eq=False)
class Acceptance:
    """The verdict with what it rests on.

    Attributes:
        verdict: Failed if any reason says so, with remarks if there is any.
        reasons: The gravest first.
        rig: The rig beside the nominal and the previous one.
        symmetries: Motions that map most of the calibration frame onto itself.
        check_length: The check length as measured; None if there is none, or it could not be measured.
        patterns: Agreement of neighbouring residuals, by view.
        stillness: Movement of the picture, left and right.
    """

    verdict: Verdict
    reasons: tuple[Reason, ...]
    rig: tuple[RigQuantity, ...]
    symmetries: tuple[Symmetry, ...]
    check_length: MeasuredLength | None
    patterns: tuple[Pattern, ...]
    stillness: tuple[Stillness, Stillness]


@dataclass(frozen=True, slots=True)
class AcceptanceInputs:
    """Knowledge from elsewhere.

    Attributes:
        previous: The calibration that was in use before.
        check_length: A certified length between two targets.
    """

    previous: Calibration | None = None
    check_length: CheckLength | None = None


def judge(result: CalibrateResult, known: AcceptanceInputs | None = None) -> Acceptance:
    """Judge a calibration, with what is known from elsewhere."""
    known = known or AcceptanceInputs()
    before = known.previous
    rig = compared_rig(
        result.views,
        result.final.parameter_covariance,
        result.nominal,
        result.frame.xyz_mm.mean(axis=0),
        None if before is None else (before.views, before.covariance),
    )
    evidence = _Evidence(result, known, symmetries(result.frame), residual_patterns(result.final))
    reasons = [*rig_reasons(rig), *evidence.reasons()]
    reasons.sort(key=lambda one: one.level != FAILED)
    failed = any(one.level == FAILED for one in reasons)
    verdict = Verdict.FAILED if failed else Verdict.REMARKS if reasons else Verdict.PASSED
    return Acceptance(
        verdict, tuple(reasons), rig, evidence.symmetric, evidence.length, evidence.patterns, result.stillness
    )


@dataclass(slots=True, eq=False)
class _Evidence:
    """Evidence from everything but the rig itself, and the reasons that follow from it."""

    result: CalibrateResult
    known: AcceptanceInputs
    symmetric: tuple[Symmetry, ...]
    patterns: tuple[Pattern, ...]
    length: MeasuredLength | None = field(init=False, default=None)

    def reasons(self) -> Iterator[Reason]:
        yield from self._length()
        yield from self._images()
        yield from self._frame()
        yield from self._pictures()
        yield from self._adjustment()
        yield from self._accuracy()

    def _length(self) -> Iterator[Reason]:
        check = self.known.check_length
        if check is None:
            yield Reason(
                "no_check_length",
                REMARK,
                "no check length is given, so nothing tells whether the scale of the calibration frame's "
                "file is right",
                "have the distance of two targets certified, and state it as check_length in that file",
            )
            return
        ids = {int(one): index for index, one in enumerate(self.result.frame.target)}
        self.length = measured_length(self.result.final, check, ids[check.first], ids[check.second])
        between = {"first": check.first, "second": check.second}
        if self.length is None:
            yield Reason(
                "length_unseen",
                REMARK,
                f"the check length from target {check.first} to {check.second} could not be measured: not "
                "both views have kept both targets",
                "uncover the two targets and take the capture again, or certify another distance",
                between,
            )
        elif abs(self.length.difference_mm) > LENGTH_MM:
            off = self.length.difference_mm
            level = graded(abs(off) / self.length.sigma_mm, LENGTH_Z)
            yield from level.reason(
                "check_length",
                f"the check length from target {check.first} to {check.second} comes out as "
                f"{self.length.measured_mm:.3f} mm, certified are {check.length_mm:.3f} mm: the scale is off "
                f"by {self.length.scale_percent:+.2f} %",
                "check the calibration frame's file and its certificate: the adjustment takes its scale from "
                "that file alone",
                {**between, "mm": off, "percent": self.length.scale_percent},
            )

    def _images(self) -> Iterator[Reason]:
        """Check that the picture stood still and the right targets were found in it."""
        result = self.result
        moved = max(one.rms_px for one in result.stillness)
        yield from graded(moved, MOVED_PX).reason(
            "moved",
            f"the picture moved by {moved:.2f} px rms during the capture, "
            f"{max(one.drift_px for one in result.stillness):.2f} px of it steadily",
            "fasten the stand of the calibration frame, touch nothing, and take the capture again",
            {"px": moved},
        )
        if (count := result.images[0].of_fields) < ENOUGH_FIELDS:
            yield Reason(
                "short",
                REMARK,
                f"only {count} fields: too few to average out noise and line jitter",
                "take two seconds or more",
                {"n": count},
            )
        for side in (result.identification.left, result.identification.right):
            if side.margin < CLEAR_MARGIN:
                yield Reason(
                    "runner_up",
                    REMARK,
                    f"the {side.view.name} view is nearly as well explained in another way: "
                    f"{side.runner_up_targets} targets to {side.runner_up_rms_px:.2f} px, against "
                    f"{int((side.target >= 0).sum())} to {side.rms_px:.2f} px",
                    "show the whole calibration frame, or identify some targets by hand",
                    {"view": side.view.name, "margin": side.margin},
                )

    def _frame(self) -> Iterator[Reason]:
        """Check that the calibration frame's file can be trusted to name its targets."""
        frame, identified = self.result.frame, self.result.identification
        seen = min(int((side.target >= 0).sum()) for side in (identified.left, identified.right))
        if len(wrong := out_of_order(frame)):
            ids = ", ".join(str(frame.target[index]) for index in wrong)
            yield Reason(
                "grid_order",
                REMARK,
                f"targets {ids} do not stand where their rows and columns in the calibration frame's file "
                "put them: ids or places are exchanged",
                "correct the ids, places or rows and columns of these targets in the file",
                {"ids": ids},
            )
        if seen < len(frame) and self.symmetric and self.symmetric[0].cost < 2 * CLEAR_MARGIN:
            yield Reason(
                "alike",
                REMARK,
                f"{self.symmetric[0]}, and not all of them are seen: only those missing tell which is which",
                "show the whole calibration frame, or add a target that breaks the repetition",
            )

    def _found(self) -> list[int]:
        network = self.result.adjustment.network
        return [int((network.view == index).sum()) for index in (0, 1)]

    def _pictures(self) -> Iterator[Reason]:
        result, of = self.result, len(self.result.frame)
        for view, found in zip(result.views, self._found(), strict=True):
            yield from graded(1 - found / of, Limits(1 - ENOUGH_SEEN, 1 - LEAST_SEEN)).reason(
                "few",
                f"the {view.name} view shows {found} of {of} targets",
                "move the calibration frame until both views show all of it; check light and threshold",
                {"view": view.name, "n": found, "of": of},
            )
        for view, share in zip(result.views, result.disc_share, strict=True):
            if share > LARGE_DISC:
                yield Reason(
                    "large",
                    REMARK,
                    f"the discs of the {view.name} view appear {share:.1f} times as large as their geometric "
                    "image: the picture is out of focus, or far too bright",
                    "turn the lens until the targets are smallest; close the iris a little",
                    {"view": view.name, "times": share},
                )
        discs, sigmas = (_uneven(pair) for pair in (result.disc_share, result.view_sigma_px))
        if discs > UNEVEN_DISCS or sigmas > UNEVEN_SIGMA:
            yield Reason(
                "uneven",
                REMARK,
                f"the views are lit unequally: targets of one are {discs:.1f} times as large and "
                f"{sigmas:.1f} times as uncertain as those of the other",
                "light both views alike; clean the mirrors of the darker one",
                {"times": max(discs, sigmas)},
            )

    def _adjustment(self) -> Iterator[Reason]:
        """Read the residuals."""
        result, adjustment = self.result, self.result.adjustment
        if result.blunders:
            ids = ", ".join(f"{one.view} {result.frame.target[one.target]}" for one in result.blunders)
            share = len(result.blunders) / (len(result.blunders) + len(adjustment.network))
            yield from graded(share, Limits(FEW_LEFT_OUT, MOST_LEFT_OUT)).reason(
                "left_out",
                f"{len(result.blunders)} image points contradict the others and were left out: {ids}",
                "measure these targets' places anew, and look whether anything covers or dazzles them",
                {"n": len(result.blunders), "ids": ids},
            )
        yield from graded(1 / max(adjustment.sigma0, 1e-9), SIGMA0_LOW.inverted).reason(
            "sigma0",
            f"σ0 is {adjustment.sigma0:.2f}: the residuals are smaller than the stated σ allow, so that σ is "
            "stated too large",
            "check sigma_mm of the calibration frame's file, and that nothing else moved or shone",
            {"sigma0": adjustment.sigma0},
        )
        yield from graded(adjustment.sigma0, SIGMA0_HIGH).reason(
            "sigma0",
            f"σ0 is {adjustment.sigma0:.2f}: the residuals are larger than the stated σ allow",
            "adjust more parameters; check the calibration frame's file",
            {"sigma0": adjustment.sigma0},
        )
        yield from graded(result.unmodelled_px, UNMODELLED_PX).reason(
            "unmodelled",
            f"the image points are off by {result.unmodelled_px:.2f} px beyond their own σ: dirty or bent "
            "mirrors, a calibration frame that differs from its file, or parameters that were held",
            "clean the mirrors, measure the calibration frame anew, or adjust more parameters",
            {"px": result.unmodelled_px},
        )
        for one in self.patterns:
            if one.statistic > PATTERN_Z and one.correlation > PATTERN_CORRELATION:
                yield Reason(
                    "pattern",
                    REMARK,
                    f"neighbouring residuals of the {one.view} view agree (correlation "
                    f"{one.correlation:.2f}): the picture is bent in a way that nothing describes",
                    "clean and straighten the mirrors of that view; leave the local field switched on",
                    {"view": one.view, "correlation": one.correlation},
                )

    def _accuracy(self) -> Iterator[Reason]:
        result = self.result
        if result.validation is None:
            yield Reason(
                "unvalidated",
                REMARK,
                f"the calibration could not be cross-validated: {result.unvalidated}",
                "show more targets in both views",
            )
        else:
            missed = float(result.validation.rmse_mm[-1])
            yield from graded(missed, HELD_OUT_MM).reason(
                "missed",
                f"targets that were held out are missed by {missed:.3f} mm",
                "check the calibration frame's file, and take a longer capture with more light",
                {"mm": missed},
            )
        variance = (result.volume.sigma_mm**2).sum(axis=-1)
        expected = float(np.sqrt(np.nanmedian(variance)))
        yield from graded(expected, EXPECTED_MM).reason(
            "coarse",
            f"a point of one field is good to {expected:.3f} mm only",
            "capture with 8 bits, more light and a sharp picture",
            {"mm": expected},
        )


def _uneven(pair: tuple[float, float]) -> float:
    low, high = sorted(pair)
    return high / low if low > 0 else 1.0
