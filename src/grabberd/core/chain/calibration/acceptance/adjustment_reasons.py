"""Reasons from the adjustment: its residuals, what it left out, and the accuracy that it promises."""

from collections.abc import Iterator, Sequence

import numpy as np

from grabberd.core.calibration import DisplacedTarget, Pattern
from grabberd.core.chain.calibration.acceptance.reason import REMARK, Limits, Reason, graded
from grabberd.core.chain.calibration.calibration_result import CalibrateResult

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
            yield Reason(
                "pattern",
                REMARK,
                f"neighbouring residuals of the {one.view} view are correlated ({one.correlation:.2f}): "
                "the picture is distorted in a way that no parameter describes",
                "clean and straighten the mirrors of that view; leave the local field switched on",
                {"view": one.view, "correlation": one.correlation},
            )


def _validation(result: CalibrateResult) -> Iterator[Reason]:
    if result.validation is None:
        yield Reason(
            "unvalidated",
            REMARK,
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
