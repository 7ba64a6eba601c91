"""Finds out which targets of the calibration frame a capture shows, before anybody calibrates from it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.calibration import MeanImages
from grabberd.field import NumberedField
from grabberd.processes.calibration.identify import SeenFrame, identify
from grabberd.reconstruction import ObjectModel
from grabberd.service.calibrations.calibration_frames import calibration_frame_model
from grabberd.service.jobs.calibration import nominal_rig, recorded_rig
from grabberd.service.jobs.progress import Progress, counted, portion
from grabberd.service.jobs.runner import JobSpec
from grabberd.service.setup import location_settings, settings_of_capture
from grabberd.storage import CaptureReader

VIEWS = ("left", "right")
ENOUGH_FIELDS = 16
"""More fields do not show more targets."""
QUICKEST = "centroid"
"""Identification does not depend on hundredths of a pixel, so the quickest locator does."""
_LOCATED = 0.9
"""Share of the work that is location."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationJob(JobSpec):
    """Identifies the calibration frame's targets in a capture; see `identify_file` for fields and result."""

    kind = "identify"
    path: Path
    calibration_frame: Mapping[str, Any]

    def run(self, progress: Progress) -> dict[str, Any]:
        """Runs `identify_file`."""
        return identify_file(progress, path=self.path, calibration_frame=self.calibration_frame)


def identify_file(progress: Progress, *, path: Path, calibration_frame: Mapping[str, Any]) -> dict[str, Any]:
    """Finds the targets of a calibration frame in a sealed capture of it.

    Returns:
        For each view the targets found, the targets missing, and the images that are no target. `problem`
        says why it is unclear which target is which; `moved` is true if the calibration frame did not stand
        still.

    Raises:
        InputError: The calibration frame or the rig is invalid.
        CaptureFileError: The file cannot be read.
        MeasurementError: The capture has no fields.
    """
    model = calibration_frame_model(calibration_frame)
    with CaptureReader(path) as reader:
        fields = list(_spread(reader))
        seen = identify(
            counted(fields, len(fields), portion(progress, 0.0, _LOCATED)),
            nominal_rig(recorded_rig(reader)),
            model,
            replace(location_settings(settings_of_capture(reader.meta.config)), method=QUICKEST),
        )
        about = {"capture": reader.meta.id, "calibration_frame": model.name, "of": len(model)}
    return {**about, "picture": _picture(fields, seen.moved), **_document(seen, model)}


def _spread(reader: CaptureReader) -> Iterator[NumberedField]:
    """Yields fields from the whole length of a capture, by an odd step so that both parities come."""
    step = max(1, reader.field_count // ENOUGH_FIELDS) | 1
    return islice(reader.received(), 0, None, step)


def _picture(fields: list[NumberedField], moved: bool) -> dict[str, int]:
    """Chooses the field to show the targets on, and where its rows lie in the frame.

    Of a calibration frame that moved, the positions are those of the first field, not means over all.
    """
    chosen = fields[0 if moved else len(fields) // 2]
    return {"field": chosen.n, "y0": chosen.packed.y0, "y_step": chosen.packed.y_step}


def _document(seen: SeenFrame, model: ObjectModel) -> dict[str, Any]:
    sides = zip(VIEWS, seen.images, seen.target, strict=True)
    refusal = seen.refusal
    return {
        "views": {name: _view(images, target, model) for name, images, target in sides},
        "moved": seen.moved,
        "problem": {"message": refusal.message, "hint": refusal.hint} if refusal else None,
    }


def _view(images: MeanImages, target: NDArray[np.intp], model: ObjectModel) -> dict[str, Any]:
    positions = [{"x_px": round(x, 2), "y_px": round(y, 2)} for x, y in images.xy_px.tolist()]
    found = [
        {"target": int(model.target[index]), **position}
        for index, position in zip(target, positions, strict=True)
        if index >= 0
    ]
    known = {one["target"] for one in found}
    return {
        "found": sorted(found, key=lambda one: one["target"]),
        "missing": [one for one in model.target.tolist() if one not in known],
        "other": [position for index, position in zip(target, positions, strict=True) if index < 0],
    }
