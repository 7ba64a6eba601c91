"""Reasons from the calibration frame: whether its file names and places its targets as they stand."""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from grabberd.core.calibration import DisplacedTarget, Symmetry, displaced_targets, grid_order, swapped_axes
from grabberd.core.chain.calibration.acceptance.reason import REMARK, Limits, Reason, graded
from grabberd.core.chain.calibration.calibration_result import CalibrateResult
from grabberd.core.reconstruction import ObjectModel

CLEAR_MARGIN = 150.0
DISPLACED_SHARE = Limits(0.0, 0.1)


def frame_reasons(
    result: CalibrateResult, alike: Sequence[Symmetry], displaced: Sequence[DisplacedTarget]
) -> Iterator[Reason]:
    """Yield what is wrong with the calibration frame's file, or with telling its targets apart."""
    yield from _runner_up(result)
    yield from _alike(result, alike)
    yield from _grid(result)
    yield from _displaced(result.frame, displaced)


def _runner_up(result: CalibrateResult) -> Iterator[Reason]:
    for side in (result.identification.left, result.identification.right):
        if side.margin < CLEAR_MARGIN:
            yield Reason(
                "runner_up",
                REMARK,
                f"the {side.view.name} view is explained nearly as well by another assignment: "
                f"{side.runner_up_targets} targets to {side.runner_up_rms_px:.2f} px, against "
                f"{int((side.target >= 0).sum())} to {side.rms_px:.2f} px",
                "show the whole calibration frame, or identify some targets by hand",
                {"view": side.view.name, "margin": side.margin},
            )


def _alike(result: CalibrateResult, alike: Sequence[Symmetry]) -> Iterator[Reason]:
    sides = (result.identification.left, result.identification.right)
    seen = min(int((side.target >= 0).sum()) for side in sides)
    if seen < len(result.frame) and alike and alike[0].cost < 2 * CLEAR_MARGIN:
        yield Reason(
            "alike",
            REMARK,
            f"{alike[0]}, and not all of them are visible: only the missing ones resolve the ambiguity",
            "show the whole calibration frame, or add a target that breaks the repetition",
        )


def _grid(result: CalibrateResult) -> Iterator[Reason]:
    frame = result.frame
    order = grid_order(frame)
    for pair in order.swapped:
        first, second = frame.target[list(pair)].tolist()
        yield Reason(
            "swapped",
            REMARK,
            f"targets {first} and {second} are swapped in the calibration frame's file: each is where "
            "the row and column of the other belong",
            f"give target {first} the id of {second} and vice versa, or swap their rows and "
            "columns if the ids are right; the calibration, which uses positions, is not affected",
            {"first": first, "second": second, "what": "id"},
        )
    if order.astray:
        ids = ", ".join(str(frame.target[index]) for index in order.astray)
        yield Reason(
            "grid_order",
            REMARK,
            f"targets {ids} are not where their rows and columns in the calibration frame's file put them",
            "correct the ids, positions or rows and columns of these targets in the file",
            {"ids": ids},
        )


def _displaced(frame: ObjectModel, displaced: Sequence[DisplacedTarget]) -> Iterator[Reason]:
    for one, other in combinations(displaced, 2):
        if axes := ", ".join(swapped_axes(one, other, frame)):
            first, second = int(frame.target[one.target]), int(frame.target[other.target])
            displaced = [each for each in displaced if each not in (one, other)]
            yield Reason(
                "swapped",
                REMARK,
                f"targets {first} and {second} are swapped in the calibration frame's file: each has the "
                f"{axes} of the other",
                f"swap their {axes} in the file, and calibrate again",
                {"first": first, "second": second, "what": axes},
            )
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


def displaced_of(result: CalibrateResult) -> tuple[DisplacedTarget, ...]:
    """Find the targets that both views show elsewhere; their image points took no part in the adjustment."""
    kept = result.adjustment.network
    sides = zip(result.images, (result.identification.left, result.identification.right), strict=True)
    left_px, right_px = (
        images.xy_px[~np.isin(side.target, kept.target[kept.view == index])]
        for index, (images, side) in enumerate(sides)
    )
    missing = np.setdiff1d(np.arange(len(result.frame)), kept.target)
    return displaced_targets(result.views, result.frame, missing, left_px, right_px)
