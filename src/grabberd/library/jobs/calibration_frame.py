"""Captures of the calibration frame: the targets that one shows, and whether a calibration still holds."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.calibrations.calibration_catalog import calibration_frame_model
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.measure_setups import nominal_rig
from grabberd.core.calibration.mean_images import MeanImages
from grabberd.core.chain.calibration.calibration_check import Check, CheckVerdict, check
from grabberd.core.chain.calibration.frame_capture import identify
from grabberd.core.field import NumberedField
from grabberd.core.geometry import Calibration
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents import jobs
from grabberd.documents.calibration_reports import PixelAxes
from grabberd.documents.document import JobProblem, JsonObject, assembled
from grabberd.documents.requests import TargetMark
from grabberd.errors import AmbiguousView, MirroredPicture, NotReady
from grabberd.library.jobs.calibration import as_mark, recorded_location, recorded_rig
from grabberd.work.job_spec import Progress, counted, portion

VIEWS = ("left", "right")
ENOUGH_FIELDS = 16
"""More fields do not show more targets."""
QUICKEST = "centroid"
"""Identification does not depend on hundredths of a pixel, so the quickest locator does."""
_LOCATED = 0.9
"""Share of the work that is location."""


def identify_file(
    progress: Progress,
    path: Path,
    calibration_frame: JsonObject,
    turn_deg: float | None = None,
    marks: Sequence[TargetMark] = (),
) -> jobs.IdentificationResult:
    """Identifies the targets in fields from the whole length of a sealed capture.

    Args:
        progress: Called with the share that is done.
        path: The capture.
        calibration_frame: Document of the calibration frame.
        turn_deg: Its turn in the picture, if somebody has looked.
        marks: Targets that somebody has marked.

    Raises:
        InputError: The calibration frame or the rig is invalid.
        CaptureFileError: The file cannot be read.
        MeasurementError: The capture has no fields.
    """
    model = calibration_frame_model(calibration_frame)
    with CaptureReader(path) as reader:
        fields = list(_spread(reader))
        nominal = nominal_rig(recorded_rig(reader))
        seen = identify(
            counted(fields, len(fields), portion(progress, 0.0, _LOCATED)),
            nominal,
            model,
            replace(recorded_location(reader, nominal), method=QUICKEST),
            turn_deg=turn_deg,
            marked=[as_mark(one) for one in marks],
        )
        capture = reader.meta.id
    sides = zip(VIEWS, seen.images, seen.target, strict=True)
    refusal, found = seen.refusal, seen.identification
    return jobs.IdentificationResult(
        capture=capture,
        calibration_frame=model.name,
        of=len(model),
        picture=_picture(fields, seen.moved),
        views={name: _view(images, target, model) for name, images, target in sides},
        moved=seen.moved,
        turn_deg=found.orientation.turn_deg if found else None,
        handedness=dict(zip(VIEWS, found.handedness, strict=True)) if found else None,
        mirrored=isinstance(refusal, MirroredPicture),
        asks=_sought(refusal, model) if isinstance(refusal, AmbiguousView) else [],
        problem=JobProblem(message=refusal.message, hint=refusal.hint) if refusal else None,
    )


def _sought(refusal: AmbiguousView, model: ObjectModel) -> list[jobs.SoughtTarget]:
    """The targets that are asked for, with their places on the frame and those in the picture."""
    places_mm = dict(zip(model.target.tolist(), model.xyz_mm.tolist(), strict=True))
    return [
        jobs.SoughtTarget(
            target=one.id,
            x_mm=places_mm[one.id][0],
            y_mm=places_mm[one.id][1],
            places=[jobs.ImagePosition(x_px=round(x, 2), y_px=round(y, 2)) for x, y in one.places_px],
        )
        for one in refusal.asks
    ]


def _spread(reader: CaptureReader) -> Iterator[NumberedField]:
    """Yields fields from the whole length of a capture, by an odd step so that both parities come."""
    step = max(1, reader.field_count // ENOUGH_FIELDS) | 1
    return islice(reader.received(), 0, None, step)


def _picture(fields: list[NumberedField], moved: bool) -> jobs.ShownField:
    """Chooses the field to show the targets on, and where its rows lie in the frame.

    Of a calibration frame that moved, the positions are those of the first field, not means over all.
    """
    chosen = fields[0 if moved else len(fields) // 2]
    return jobs.ShownField(field=chosen.n, y0=chosen.packed.y0, y_step=chosen.packed.y_step)


def _view(images: MeanImages, target: NDArray[np.intp], model: ObjectModel) -> jobs.IdentifiedView:
    positions = [jobs.ImagePosition(x_px=round(x, 2), y_px=round(y, 2)) for x, y in images.xy_px.tolist()]
    found = {
        int(model.target[index]): position
        for index, position in zip(target, positions, strict=True)
        if index >= 0
    }
    return jobs.IdentifiedView(
        found=[
            jobs.IdentifiedTarget(target=one, x_px=found[one].x_px, y_px=found[one].y_px)
            for one in sorted(found)
        ],
        missing=[one for one in model.target.tolist() if one not in found],
        other=[position for index, position in zip(target, positions, strict=True) if index < 0],
    )


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
) -> jobs.CheckResult:
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
            recorded_location(reader, nominal),
            in_place=in_place,
            turn_deg=(document.get("details", {}).get("calibration_frame") or {}).get("turn_deg"),
        )
        capture_id = reader.meta.id
    return _result(found, capture_id, document["id"], model.name, in_place=in_place)


def _result(
    found: Check, capture_id: str, calibration_id: str, calibration_frame: str, *, in_place: bool
) -> jobs.CheckResult:
    return assembled(
        jobs.CheckResult,
        found,
        capture=capture_id,
        calibration=calibration_id,
        calibration_frame=calibration_frame,
        in_place=in_place,
        verdict=found.verdict.value,
        advice=ADVICE[found.verdict],
        reasons=list(found.reasons),
        rmse=jobs.AxesDocument(**found.rmse._asdict()),
        shift_px=_by_view(found.shift_px),
        residual_px=_by_view(found.residual_px),
        as_placed=jobs.AxesDocument(**found.as_placed._asdict()),
        placed=jobs.Placement(angle_deg=found.placed.angle_deg, shift_mm=found.placed.shift_mm.tolist()),
    )


def _by_view(xy_px: NDArray[np.float64]) -> dict[str, PixelAxes]:
    """Names the rows of a (2, 2) array, in frame pixels."""
    return {view: PixelAxes(x=x, y=y) for view, (x, y) in zip(VIEWS, xy_px.tolist(), strict=True)}
