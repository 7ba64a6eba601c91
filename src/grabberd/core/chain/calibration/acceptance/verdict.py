"""The verdict on a calibration: passed, passed with remarks, or failed; and the acceptance as a document.

Reasons from the rig: its comparison with the nominal and the previous one, and its scale by the check
length.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from grabberd.core.calibration.calibration_frame import Symmetry, symmetries
from grabberd.core.calibration.mean_images import Stillness
from grabberd.core.calibration.residuals import Pattern, residual_patterns
from grabberd.core.calibration.rig_quantities import RigQuantity, compared_rig
from grabberd.core.calibration.significance import CheckLength, MeasuredLength, measured_length
from grabberd.core.chain.calibration.acceptance.reasons import (
    FAILED,
    REMARK,
    Limits,
    Reason,
    Value,
    adjustment_reasons,
    displaced_of,
    frame_reasons,
    graded,
    picture_reasons,
)
from grabberd.core.chain.calibration.calibration_result import CalibrateResult
from grabberd.core.geometry import Calibration
from grabberd.core.geometry.document_reader import finite

NOMINAL_Z = Limits(2.2, 3.0)
"""In σ of five per cent: eleven and fifteen per cent."""
PREVIOUS_Z, PREVIOUS_SHARE, PREVIOUS_PX = 5.0, 0.02, 10.0
"""Both have to be exceeded: σ alone flags harmless changes, such as a frame that stands elsewhere."""
WORDS = {
    "focal_length": "focal length",
    "principal_x": "principal point in x",
    "principal_y": "principal point in y",
    "base": "base",
    "distance": "distance",
    "convergence": "convergence",
}
HINTS = {
    "focal_length": "check the focal length and pixel pitch of the rig's configuration against the lens",
    "base": "measure the base; check the unit and pitch of the calibration frame's file",
    "distance": "measure the distance; check the unit and pitch of the calibration frame's file",
    "convergence": "check the angles of the mirrors, and base and distance of the rig's configuration",
    "principal_x": "check that the lens is screwed in straight and the columns of the views are right",
    "principal_y": "check that the lens is screwed in straight and the lines of the picture are right",
}


def rig_reasons(rig: Sequence[RigQuantity]) -> Iterator[Reason]:
    """Yield what is wrong with the rig that was found: first its handedness, then its dimensions."""
    handedness = [one for one in rig if one.name == "handedness"]
    yield from _handedness(handedness)
    for one in rig:
        if one.name != "handedness":
            yield from _nominal(one)
            yield from _previous(one)


def _handedness(rows: Sequence[RigQuantity]) -> Iterator[Reason]:
    for one in rows:
        built, before = one.nominal, one.previous
        values: dict[str, Value] = {"view": one.view, "found": int(one.found)}
        if before is not None and built is None and before != one.found:
            yield Reason(
                "mirrored_since",
                FAILED,
                f"the {one.view} view has handedness {one.found:+.0f}, before it was {before:+.0f}",
                "check whether camera or grabber mirror the picture now, or whether a mirror was added; "
                "state the handedness in the rig's configuration if it is right",
                values,
            )
    left, right = rows
    unstated = left.nominal is None and right.nominal is None
    if unstated and left.found != right.found:
        yield Reason(
            "half_mirrored",
            FAILED,
            f"the left view has handedness {left.found:+.0f}, the right one {right.found:+.0f}: one half of "
            "the picture is mirrored, or one path has one mirror more",
            "switch off the mirroring; if the paths differ, state handedness for both views of the rig",
        )
    elif unstated and left.found < 0 and left.previous is None:
        yield Reason(
            "left_handed",
            REMARK,
            "both views are left-handed: an odd number of mirrors stands before each, or the picture is "
            "mirrored; points are right in either case, as long as that stays",
            "count the mirrors, and state handedness for both views of the rig: a change is told then",
        )


def _nominal(one: RigQuantity) -> Iterator[Reason]:
    if one.nominal is None or one.nominal_z is None:
        return
    yield from graded(abs(one.nominal_z), NOMINAL_Z).reason(
        "nominal",
        f"the {_name(one)} comes out as {one.found:.2f} {one.unit}, {abs(one.nominal_z):.1f} σ from its "
        f"nominal {one.nominal:.2f} {one.unit}",
        HINTS[one.name],
        _values(one, one.nominal, one.nominal_z),
    )


def _previous(one: RigQuantity) -> Iterator[Reason]:
    if one.previous is None or one.previous_z is None or abs(one.previous_z) < PREVIOUS_Z:
        return
    change = abs(one.found - one.previous)
    if change > (PREVIOUS_PX if one.unit == "px" else PREVIOUS_SHARE * abs(one.previous)):
        yield Reason(
            "previous",
            REMARK,
            f"the {_name(one)} was {one.previous:.2f} {one.unit} in the previous calibration and is "
            f"{one.found:.2f} now",
            "nothing to do if the rig was changed since; look for loose mirrors and lens otherwise",
            _values(one, one.previous, one.previous_z),
        )


def _name(one: RigQuantity) -> str:
    return f"{WORDS[one.name]} of the {one.view} view" if one.view else WORDS[one.name]


def _values(one: RigQuantity, other: float, z: float) -> dict[str, Value]:
    return {
        "quantity": one.name,
        "view": one.view,
        "unit": one.unit,
        "found": one.found,
        "other": other,
        "z": abs(z),
    }


LENGTH_Z = Limits(2.5, 4.0)
LENGTH_MM = 0.01
"""Both have to be exceeded."""


def length_of(result: CalibrateResult, check: CheckLength) -> MeasuredLength | None:
    """Measure the check length; None if not both views have kept both of its targets."""
    index = {int(one): index for index, one in enumerate(result.frame.target)}
    return measured_length(result.final, check, index[check.first], index[check.second])


def length_reasons(check: CheckLength | None, length: MeasuredLength | None) -> Iterator[Reason]:
    """Yield what is wrong with the scale, or that nothing tells whether it is right."""
    if check is None:
        yield Reason(
            "no_check_length",
            REMARK,
            "no check length is given, so nothing confirms that the scale of the calibration frame's file is "
            "right",
            "have the distance between two targets certified, and state it as check_length in that file",
        )
        return
    between = {"first": check.first, "second": check.second}
    if length is None:
        yield Reason(
            "length_unseen",
            REMARK,
            f"the check length from target {check.first} to {check.second} could not be measured: a view "
            "lacks one of the targets",
            "uncover the two targets and repeat the capture, or certify another distance",
            between,
        )
    elif abs(length.difference_mm) > LENGTH_MM:
        yield from graded(abs(length.difference_mm) / length.sigma_mm, LENGTH_Z).reason(
            "check_length",
            f"the check length from target {check.first} to {check.second} comes out as "
            f"{length.measured_mm:.3f} mm, its certificate says {check.length_mm:.3f} mm: the scale is off "
            f"by {length.scale_percent:+.2f} %",
            "check the calibration frame's file and the certificate: the adjustment takes its scale from "
            "that file alone",
            {**between, "mm": length.difference_mm, "percent": length.scale_percent},
        )


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
        *frame_reasons(result, displaced),
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
            view: {**asdict(one), "drift_sigma_px": finite(one.drift_sigma_px)}
            for view, one in zip(("left", "right"), acceptance.stillness, strict=True)
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
