"""Finds out which targets of the calibration frame a capture shows, before anybody calibrates from it."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grabberd.archive import CaptureReader
from grabberd.archive.calibrations.calibration_frames import calibration_frame_model
from grabberd.archive.measure_setups import location_settings, nominal_rig, settings_of_capture
from grabberd.core.calibration import MeanImages
from grabberd.core.chain.calibration.identify import identify
from grabberd.core.chain.target_sizes import px_per_mm
from grabberd.core.field import NumberedField
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents.job_problem import JobProblem
from grabberd.documents.named_types import JsonObject
from grabberd.documents.results import (
    IdentificationResult,
    IdentifiedTarget,
    IdentifiedView,
    ImagePosition,
    ShownField,
)
from grabberd.library.jobs.calibration import recorded_rig
from grabberd.work.progress import Progress, counted, portion

VIEWS = ("left", "right")
ENOUGH_FIELDS = 16
"""More fields do not show more targets."""
QUICKEST = "centroid"
"""Identification does not depend on hundredths of a pixel, so the quickest locator does."""
_LOCATED = 0.9
"""Share of the work that is location."""


def identify_file(progress: Progress, path: Path, calibration_frame: JsonObject) -> IdentificationResult:
    """Identifies the targets in fields from the whole length of a sealed capture.

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
            replace(
                location_settings(settings_of_capture(reader.meta.config), px_per_mm(nominal)),
                method=QUICKEST,
            ),
        )
        capture = reader.meta.id
    sides = zip(VIEWS, seen.images, seen.target, strict=True)
    refusal = seen.refusal
    return IdentificationResult(
        capture=capture,
        calibration_frame=model.name,
        of=len(model),
        picture=_picture(fields, seen.moved),
        views={name: _view(images, target, model) for name, images, target in sides},
        moved=seen.moved,
        problem=JobProblem(message=refusal.message, hint=refusal.hint) if refusal else None,
    )


def _spread(reader: CaptureReader) -> Iterator[NumberedField]:
    """Yields fields from the whole length of a capture, by an odd step so that both parities come."""
    step = max(1, reader.field_count // ENOUGH_FIELDS) | 1
    return islice(reader.received(), 0, None, step)


def _picture(fields: list[NumberedField], moved: bool) -> ShownField:
    """Chooses the field to show the targets on, and where its rows lie in the frame.

    Of a calibration frame that moved, the positions are those of the first field, not means over all.
    """
    chosen = fields[0 if moved else len(fields) // 2]
    return ShownField(field=chosen.n, y0=chosen.packed.y0, y_step=chosen.packed.y_step)


def _view(images: MeanImages, target: NDArray[np.intp], model: ObjectModel) -> IdentifiedView:
    positions = [ImagePosition(x_px=round(x, 2), y_px=round(y, 2)) for x, y in images.xy_px.tolist()]
    found = {
        int(model.target[index]): position
        for index, position in zip(target, positions, strict=True)
        if index >= 0
    }
    return IdentifiedView(
        found=[
            IdentifiedTarget(target=one, x_px=found[one].x_px, y_px=found[one].y_px) for one in sorted(found)
        ],
        missing=[one for one in model.target.tolist() if one not in found],
        other=[position for index, position in zip(target, positions, strict=True) if index < 0],
    )
