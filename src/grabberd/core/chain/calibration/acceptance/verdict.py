"""The verdict on a calibration: passed, passed with remarks, or failed; and the acceptance as a document."""

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from grabberd.core.calibration import (
    CheckLength,
    MeasuredLength,
    Pattern,
    RigQuantity,
    Stillness,
    Symmetry,
    compared_rig,
    residual_patterns,
    symmetries,
)
from grabberd.core.chain.calibration.acceptance.reasons import (
    FAILED,
    Reason,
    adjustment_reasons,
    displaced_of,
    frame_reasons,
    picture_reasons,
)
from grabberd.core.chain.calibration.acceptance.rig_reasons import length_of, length_reasons, rig_reasons
from grabberd.core.chain.calibration.calibration_result import CalibrateResult
from grabberd.core.geometry import Calibration
from grabberd.core.geometry.document_reader import finite


class Verdict(StrEnum):
    """Verdict on a calibration."""

    PASSED = "passed"
    REMARKS = "passed_with_remarks"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, eq=False)
class Acceptance:
    """The verdict with what it rests on.

    Attributes:
        reasons: The gravest first.
        rig: The rig beside the nominal and the previous one.
        symmetries: Motions that map most of the calibration frame onto itself.
        check_length: The check length as measured; None if there is none, or it could not be measured.
        patterns: Agreement of neighbouring residuals, by view.
        stillness: Movement of the picture, left and right.
    """

    reasons: tuple[Reason, ...]
    rig: tuple[RigQuantity, ...]
    symmetries: tuple[Symmetry, ...]
    check_length: MeasuredLength | None
    patterns: tuple[Pattern, ...]
    stillness: tuple[Stillness, Stillness]

    @property
    def verdict(self) -> Verdict:
        """The verdict: failed if any reason says so, with remarks if there is any."""
        if any(one.level == FAILED for one in self.reasons):
            return Verdict.FAILED
        return Verdict.REMARKS if self.reasons else Verdict.PASSED


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
    length = None if known.check_length is None else length_of(result, known.check_length)
    alike, patterns = symmetries(result.frame), residual_patterns(result.final)
    displaced = displaced_of(result)
    reasons = [
        *rig_reasons(rig),
        *length_reasons(known.check_length, length),
        *picture_reasons(result),
        *frame_reasons(result, alike, displaced),
        *adjustment_reasons(result, patterns, displaced),
    ]
    reasons.sort(key=lambda one: one.level != FAILED)
    return Acceptance(tuple(reasons), rig, alike, length, patterns, result.stillness)


_MOST_SYMMETRIES = 5


def acceptance_document(acceptance: Acceptance) -> dict[str, Any]:
    """The document; its keys are those of `documents.calibration_acceptance`."""
    return {
        "verdict": str(acceptance.verdict),
        "reasons": [asdict(one) for one in acceptance.reasons],
        "rig": [_quantity(one) for one in acceptance.rig],
        "check_length": _length(acceptance.check_length),
        "symmetries": [str(one) for one in acceptance.symmetries[:_MOST_SYMMETRIES]],
        "patterns": [
            {"view": one.view, "correlation": one.correlation, "statistic": one.statistic}
            for one in acceptance.patterns
        ],
        "movement": {
            view: asdict(one) for view, one in zip(("left", "right"), acceptance.stillness, strict=True)
        },
    }


def _quantity(one: RigQuantity) -> dict[str, Any]:
    values = asdict(one)
    return {"quantity": values.pop("name"), **values}


def _length(one: MeasuredLength | None) -> dict[str, Any] | None:
    if one is None:
        return None
    return {
        "first": one.check.first,
        "second": one.check.second,
        "certified_mm": one.check.length_mm,
        "measured_mm": one.measured_mm,
        "difference_mm": finite(one.difference_mm),
        "sigma_mm": one.sigma_mm,
    }
