"""Reasons from the check length."""

from collections.abc import Iterator

from grabberd.core.calibration import CheckLength, MeasuredLength, measured_length
from grabberd.core.chain.calibration.acceptance.reason import REMARK, Limits, Reason, graded
from grabberd.core.chain.calibration.calibration_result import CalibrateResult

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
