"""Checks a calibration with a capture of the calibration frame: does it still hold?"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grabberd.archive import CaptureReader
from grabberd.archive.calibrations.calibration_frames import calibration_frame_model
from grabberd.archive.measure_setups import location_settings, nominal_rig, settings_of_capture
from grabberd.core.chain.calibration.calibration_check import Check, CheckVerdict, check
from grabberd.core.chain.target_sizes import px_per_mm
from grabberd.core.geometry import Calibration
from grabberd.documents.calibration_reports import PixelAxes
from grabberd.documents.named_types import JsonObject
from grabberd.documents.results import AxesDocument, CheckResult, Placement
from grabberd.errors import NotReady
from grabberd.library.jobs.calibration import recorded_rig
from grabberd.work.progress import Progress, counted

VIEWS = ("left", "right")
ADVICE: Mapping[CheckVerdict, str] = {
    CheckVerdict.FITS: "the calibration fits: go on measuring",
    CheckVerdict.DOUBTFUL: "the calibration is doubtful: clean the mirrors and the glass, make sure the "
    "calibration frame stands firmly, and check again; recalibrate if it stays doubtful",
    CheckVerdict.RECALIBRATE: "the calibration no longer fits: recalibrate with the calibration frame",
}


def check_file(
    progress: Progress,
    *,
    path: Path,
    calibration_frame: JsonObject,
    calibration: JsonObject | None = None,
    in_place: bool = False,
) -> CheckResult:
    """Checks a calibration with a sealed capture of the calibration frame.

    Args:
        progress: Called with the share that is done.
        path: The capture.
        calibration_frame: Document of the calibration frame.
        calibration: Document of the calibration; None for the one the capture was made with.
        in_place: See `grabberd.core.chain.calibration.calibration_check.check`.

    Raises:
        NotReady: There is no calibration.
        InputError: Calibration frame, calibration or rig are invalid.
        CaptureFileError: The file cannot be read.
        MeasurementError: The capture does not show the calibration frame.
    """
    model = calibration_frame_model(calibration_frame)
    with CaptureReader(path) as reader:
        reader.check_unchanged(runs=())
        made_with = reader.runs[-1].made_with if reader.runs else {}
        document = calibration or made_with.get("calibration")
        if not document:
            raise NotReady(
                f"capture {reader.meta.id} was made without a calibration", "name the one to check"
            )
        nominal = nominal_rig(recorded_rig(reader))
        found = check(
            counted(reader.received(), reader.field_count, progress),
            nominal,
            model,
            Calibration.from_document(document),
            location_settings(settings_of_capture(reader.meta.config), px_per_mm(nominal)),
            in_place=in_place,
        )
        capture_id = reader.meta.id
    return _result(found, capture_id, document["id"], model.name, in_place=in_place)


def _result(
    found: Check, capture_id: str, calibration_id: str, calibration_frame: str, *, in_place: bool
) -> CheckResult:
    return CheckResult(
        capture=capture_id,
        calibration=calibration_id,
        calibration_frame=calibration_frame,
        in_place=in_place,
        verdict=found.verdict.value,
        advice=ADVICE[found.verdict],
        reasons=list(found.reasons),
        fields=found.fields,
        seen=found.seen,
        of=found.of,
        rmse=AxesDocument(**found.rmse._asdict()),
        chi2=found.chi2,
        parallax_px=found.parallax_px,
        shift_px=_by_view(found.shift_px),
        residual_px=_by_view(found.residual_px),
        as_placed=AxesDocument(**found.as_placed._asdict()),
        placed=Placement(angle_deg=found.placed.angle_deg, shift_mm=found.placed.shift_mm.tolist()),
    )


def _by_view(xy_px: NDArray[np.float64]) -> dict[str, PixelAxes]:
    """Names the rows of a (2, 2) array, in frame pixels."""
    return {view: PixelAxes(x=x, y=y) for view, (x, y) in zip(VIEWS, xy_px.tolist(), strict=True)}
